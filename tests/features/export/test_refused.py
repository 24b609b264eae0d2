"""Classes that cannot be exported are refused in one line, with the place; a comparison finds wrong results."""

from __future__ import annotations

import inspect
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from cmg_mj.core.axis import AxisControl, Delivered, Known
from cmg_mj.core.controller import Controller
from cmg_mj.core.errors import InputError
from cmg_mj.core.types import Measurement
from cmg_mj.features.export import export, generate_code
from tests.command import cmg_mj
from tests.features.export import own, own_laws
from tests.features.export.compiled import control, controller

NUMBER = "a plain number is asked for"
CURE = "compiled routines of numpy and scipy take no symbols; write it out in + - * /"
DIFFERENCE = "traced, it is not what Python runs: on random signals "


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("Branches", "a branch on a value"),
        ("TakesMath", NUMBER),
        ("FillsAnArray", NUMBER),
        ("Inverts", CURE),
        ("Solves", CURE),
        ("TakesModulo", "numpy.remainder"),
        ("Raises", "step(state, y, u) raised KeyError: 'floats only'"),
        ("LooksAtTypes", f"{DIFFERENCE}x2_rad_s is off by"),
        ("Counts", f"{DIFFERENCE}x2_rad_s is off by"),
        ("DrawsLots", "not twice the same"),
        ("Remembers", "remembers something outside of its state"),
        ("Grows", "made otherwise than the one of init"),
        ("HoldsADeque", "its state holds a deque"),
        ("HoldsTooMuch", "its state holds 1600 numbers; at most 1000 can be exported"),
        ("Blows", "cannot be compared on random signals: observer Blows returned"),
        ("BeginsAtInfinity", "its state holds inf (least) at sample 0, where the C stops: hold numbers"),
    ],
)
def test_an_observer_that_c_would_not_have(name: str, words: str, tmp_path: Path) -> None:
    complaint = refusal(controller(f"tests.features.export.own:{name}"), own, name, tmp_path)
    assert complaint.startswith(f"tests.features.export.own:{name} cannot be exported: ")
    assert words in complaint


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("Branches", "a branch on a value"),
        ("LooksAtTypes", f"{DIFFERENCE}u_rad_s is off by"),
        ("BeginsAtInfinity", "its state holds inf (least) at sample 0, where the C stops"),
        ("Blows", "cannot be compared on random signals: law Blows returned"),
        ("Derives", "its integrator x_e is no number in its state"),
    ],
)
def test_a_law_that_c_would_not_have(name: str, words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("cmg_mj.features.export.check.TICKS", 100)
    subject = controller("linear", f"controller.kind=tests.features.export.own_laws:{name}")
    complaint = refusal(subject, own_laws, name, tmp_path)
    assert complaint.startswith(f"law {name}: cannot be exported: ")
    assert words in complaint


def refusal(subject: Controller, module: Any, name: str, folder: Path) -> str:
    """The complaint, which names the line that the class marks; and nothing is left."""
    with pytest.raises(InputError) as info:
        export(subject, folder / "export")
    complaint = str(info.value)
    assert "\n" not in complaint
    assert not (folder / "export").exists()
    lines, first = inspect.getsourcelines(getattr(module, name))
    for line, text in enumerate(lines, first):
        if text.rstrip().endswith("# here"):
            file = f"{module.__name__.rpartition('.')[2]}.py"
            assert f"{file}, line {line}: {text.strip()})" in complaint
    return complaint


class Derived(AxisControl):
    """What it does otherwise, C would not have."""

    def measure(self, delivered: Delivered, known: Known | None = None) -> Measurement:
        y = super().measure(delivered, known)
        return Measurement(2.0 * y.y1, y.y2, y.acceleration)


def test_a_control_of_another_class_is_refused() -> None:
    plain = control("linear")
    with pytest.raises(InputError, match=DIFFERENCE):
        generate_code(Derived(**vars(replace(plain))), "double")


@pytest.mark.parametrize(("field", "value"), [("feedback", "fog"), ("feedback", "truth"), ("notch_hz", "20.0")])
def test_a_setting_that_c_does_not_have_is_refused_by_name(field: str, value: str) -> None:
    with pytest.raises(InputError, match=rf"^controller\.{field}\b.* set controller\.{field}="):
        generate_code(control("linear", f"controller.{field}={value}"), "double")


class Hum:
    """A stage without C."""

    def init(self, u: Any) -> Any:
        return ()

    def step(self, memory: Any, u: Any) -> Any:
        return memory, u


def test_a_stage_that_c_does_not_have_is_refused_by_name() -> None:
    with pytest.raises(InputError, match=r"^Hum: "):
        generate_code(replace(control("linear"), commands=(Hum(),)), "double")


@pytest.mark.usefixtures("elsewhere")
@pytest.mark.parametrize(("rate", "refused"), [(10.0, True), (12.5, False)])
def test_a_rate_at_which_the_loop_is_unstable_is_refused(rate: float, refused: bool) -> None:
    """See `test_a_period_at_which_the_loop_is_unstable`: the border lies between."""
    outcome = cmg_mj("export", "linear", "--set", f"controller.rate_hz={rate}", "--out", "x")
    assert outcome.status == (2 if refused else 0)
    assert ("more than 10.2 Hz are needed" in outcome.err) is refused
    assert Path("x").exists() is not refused
