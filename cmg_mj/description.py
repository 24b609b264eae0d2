"""What a scenario amounts to, in words."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from cmg_mj.design import Design
from cmg_mj.grid import physics_step
from cmg_mj.known_rigs import RigFacts
from cmg_mj.law import closed_loop_poles
from cmg_mj.resolved import resolved
from cmg_mj.schema import Scenario
from cmg_mj.stability import MARGIN, is_hurwitz


def description(name: str, scenario: Scenario, design: Design, rig: RigFacts) -> str:
    """What `cmg-mj check` prints: what a scenario amounts to.

    Args:
        name: What the user called it.
        scenario: The scenario.
        design: The law and the observers.
        rig: What they were made for.

    Returns:
        Lines of text.
    """
    law = design.law
    settings = scenario.plant
    timestep = physics_step(scenario, rig.largest_step)
    fields = resolved(scenario, design, rig.path, timestep)
    steps = f"{round(scenario.duration_s / timestep)} physics steps of {timestep:g} s"
    poles = closed_loop_poles(rig.reduced, law.gains)
    slowest = float(np.max(np.real(poles)))
    stability = "stable" if is_hurwitz(poles) else "MARGINAL" if slowest < MARGIN else "UNSTABLE"
    observer = {key: value for key, value in fields["observer"].items() if key != "kind"}
    rates = {kind: getattr(scenario.sensors, kind).rate_hz for kind in ("accelerometer", "encoder", "fog")}
    rows = [
        ("run", f"{scenario.duration_s:g} s, {steps} ({settings.integrator}), seed {scenario.seed}"),
        ("plant", f"{fields['plant']['model']}, cubes: {', '.join(rig.cubes)}"),
        ("", f"equilibrium bias {settings.equilibrium_bias_deg:g} deg, initial tilt {settings.initial_tilt_deg:g} deg"),
        ("law", f"K_e = {number(law.gains)} at {scenario.controller.rate_hz:g} Hz, at most {law.rate_limit:g} rad/s"),
        ("", f"tilt rate from the {scenario.controller.feedback}, {scenario.controller.angles} angles"),
        ("", f"{stability} with the reduced model and its true state, slowest pole {slowest:.3g} 1/s"),
        ("observer", f"{scenario.observer.kind}  {assignments(observer)}".rstrip()),
        *(
            [("", "your own code, which was imported and tried on two samples")]
            if ":" in scenario.observer.kind
            else []
        ),
        ("companions", ", ".join(scenario.companion_names()) or "none"),
        ("sensors", ", ".join(f"{kind} {rate:g} Hz" for kind, rate in rates.items())),
        *(("push", f"{p.torque_n_m:g} N m from {p.start_s:g} s to {p.end_s:g} s") for p in scenario.push),
    ]
    return "\n".join([f"{name}: valid", *(f"  {label:10}  {text}" for label, text in rows)])


def assignments(values: Mapping[str, Any]) -> str:
    """Parameters and their values, as `--set` takes them."""
    return "  ".join(f"{name}={number(value)}" for name, value in values.items())


def number(value: Any) -> str:
    """A value as TOML writes it, to six digits."""
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(number(item) for item in value)}]"
    if isinstance(value, bool):
        return "true" if value else "false"
    return f"{value:.6g}" if isinstance(value, float) else str(value)
