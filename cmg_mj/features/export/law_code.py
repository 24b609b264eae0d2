"""Prints a law's part of an export: its state, its functions and their calls."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import casadi

from cmg_mj.features.export.formulas import MEASURED
from cmg_mj.features.export.traced_law import TracedLaw

WIDEST = 110
"""Longest line [characters]."""

PrintBody = Callable[[casadi.Function, Sequence[str], Sequence[str]], str]
"""(function, places of its inputs, places of its outputs) -> its body in C."""


def function_head(head: str, parameters: Sequence[str]) -> str:
    """Print a function's name and parameters, on as many lines as they need."""
    text = f"{head}({', '.join(parameters)})"
    return text if len(text) <= WIDEST else f"{head}(\n    {(',' + chr(10) + '    ').join(parameters)})"


class LawPrinter(NamedTuple):
    """Prints a law's part of an export.

    Attributes:
        law: The law's formulas.
        name: Prefix of everything in C.
        described: The law, for a comment.
        constants: Names of the law's constants.
    """

    law: TracedLaw
    name: str
    described: str
    constants: Sequence[str]

    @property
    def state_type(self) -> str:
        """The type of its state, with the comment above it; nothing without a state beside the integrator."""
        if not self.law.state:
            return ""
        members = "".join(f"    {self.name}_real {member};\n" for member in self.law.state)
        beside = ", without its integrator" if self.law.has_integrator else ""
        return f"/* The law's state{beside}. */\ntypedef struct {{\n{members}}} {self.name}_law_state;\n\n"

    @property
    def member(self) -> str:
        """The state's line in the controller's struct."""
        return f"    {self.name}_law_state law;\n" if self.law.state else ""

    @property
    def integrator_comment(self) -> str:
        """The meaning of the controller's `x_e`."""
        return "integrator [rad s]" if self.law.has_integrator else "NaN: the law has no integrator"

    @property
    def finite_members(self) -> list[str]:
        """Members of the controller that must be finite after a decision, besides u."""
        return [*(f"law.{member}" for member in self.law.state), *(["x_e"] if self.law.has_integrator else [])]

    def functions(self, print_body: PrintBody) -> str:
        """Print `law`, and `init_law` if it has one."""
        law, memory = self.law, self._memory("state->", "*x_e")
        inputs, outputs = [*law.arguments, *memory, *self.constants], ["*u", *memory]
        step = f"{self._step_head()}\n{{\n{print_body(law.step, inputs, outputs)}}}\n"
        if law.is_state_feedback:
            words = "u = -K_e [x1, x2, x3, x_e], limited; then a step of the integrator, unless it would wind up."
            return f"/* {words} */\n{step}"
        step = f"/* {self.described}: u, not yet limited, and the next state. */\n{step}"
        if law.init is None or not memory:
            return step
        init = function_head("static void init_law", [*self._reals(law.measured), *self._pointers()])
        start = f"{init}\n{{\n{print_body(law.init, MEASURED, memory)}}}\n"
        return f"/* {self.described}: the state before the first decision. */\n{start}\n{step}"

    def init_call(self, measured: Mapping[str, str], state: str, x_e: str) -> str:
        """Print the call of `init_law`; nothing if it has none.

        Args:
            measured: Name of a measurement -> where it is.
            state: Address of the state.
            x_e: Address of the integrator.
        """
        if self.law.init is None or not self.law.numbers:
            return ""
        return f"init_law({', '.join([*(measured[name] for name in self.law.measured), *self._passed(state, x_e)])});"

    def step_call(self, values: Mapping[str, str], state: str, x_e: str, u: str) -> str:
        """Print the call of `law`.

        Args:
            values: Name of a parameter -> where it is.
            state: Address of the state.
            x_e: Address of the integrator.
            u: Address of the command.
        """
        return f"law({', '.join([*(values[name] for name in self._parameters()), *self._passed(state, x_e), u])});"

    def limit(self, indent: str) -> str:
        """Print the lines that limit the command, behind the check that it is finite; (8) has done so."""
        if self.law.is_state_feedback:
            return ""
        lines = [
            "else if (controller->u < -rate_limit)",
            "    controller->u = -rate_limit;",
            "else if (controller->u > rate_limit)",
            "    controller->u = rate_limit;",
        ]
        return "".join(f"{indent}{line}\n" for line in lines)

    def _step_head(self) -> str:
        real, estimates = f"{self.name}_real", f"{self.name.upper()}_ESTIMATES"
        texts = {"estimate": f"const {real} estimate[{estimates}]"}
        parameters = [texts.get(name, f"{real} {name}") for name in self._parameters()]
        return function_head("static void law", [*parameters, *self._pointers(), f"{real} *u"])

    def _parameters(self) -> list[str]:
        """Name the parameters of `law` before its pointers; extra signals come as the whole estimate."""
        return list(dict.fromkeys(name.partition("[")[0] for name in self.law.arguments))

    def _reals(self, names: Sequence[str]) -> list[str]:
        return [f"{self.name}_real {name}" for name in names]

    def _memory(self, member: str, x_e: str) -> list[str]:
        """Place the numbers of the state, the integrator last."""
        return [*(f"{member}{name}" for name in self.law.state), *([x_e] if self.law.has_integrator else [])]

    def _pointers(self) -> list[str]:
        return self._passed(f"{self.name}_law_state *state", f"{self.name}_real *x_e")

    def _passed(self, state: str, x_e: str) -> list[str]:
        """Select those of the two that the law has."""
        return [*([state] if self.law.state else []), *([x_e] if self.law.has_integrator else [])]
