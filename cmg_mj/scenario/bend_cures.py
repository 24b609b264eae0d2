"""Margins of a loop around a frame that bends, and which settings cure a loop that the bend makes swing."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from cmg_mj.controllers.laws import LAWS
from cmg_mj.controllers.laws.lqg import Lqg
from cmg_mj.observers import OBSERVERS
from cmg_mj.scenario.bend_loop import BentLoop, bent_loop
from cmg_mj.scenario.design import design
from cmg_mj.scenario.plant_parameters import PlantParameters
from cmg_mj.scenario.schema import LqrSettings, Scenario

NEAR = 0.4
"""A transfer that comes nearer to -1 has little margin: disturbances at that frequency grow by 2.5."""
BENDS_SHARE = 0.8
"""So much of the rigid loop's distance from -1 left, a small distance is the rigid loop's fault and not the bend's."""
CURED = 0.2
"""A loop that comes nearer to -1 is not cured: an eighth of a turn more of phase, or less gain, fells it."""
NOTCHES = (1.08, 1.0, 0.92)
"""Middles of the notches that are tried, over the mode's frequency."""
SOFTER = 10.0
"""So many times Table 2's weight of the command stands for a lower bandwidth."""


class Margins(NamedTuple):
    """Stability margins, by python-control.

    Attributes:
        rise: Factor by which the gain may rise; infinite if by any.
        fall: Factor to which it may fall; 0 if by any.
        phase_deg: The least phase margin [deg]; infinite if the transfer never has the size 1.
        at_hz: The frequency of that [Hz].
    """

    rise: float
    fall: float
    phase_deg: float
    at_hz: float

    @property
    def words(self) -> str:
        """The margins, for one line."""
        fall = f" or fall to {self.fall:.2f} times" if self.fall > 0.0 else ""
        rise = f"rise to {self.rise:.2f} times" if np.isfinite(self.rise) else "rise without limit"
        phase = f", phase margin {self.phase_deg:.0f} deg at {self.at_hz:.3g} Hz" if np.isfinite(self.phase_deg) else ""
        return f"its gain may {rise}{fall}{phase}"


class Trial(NamedTuple):
    """Settings that were tried, as `--set` takes them, and the loop that they make."""

    settings: tuple[str, ...]
    loop: BentLoop

    @property
    def words(self) -> str:
        """The verdict, for one line."""
        if not self.loop.is_stable:
            return "UNSTABLE"
        return f"stable, nearest to -1 {self.loop.distance:.2g}; {margins(self.loop).words}"


def margins(loop: BentLoop) -> Margins:
    """Compute a stable loop's margins; an unstable one's mean nothing."""
    import control

    data = control.frd(loop.transfer, 2.0 * np.pi * loop.frequencies_hz)
    gains, phases, _, _, crossings, _ = control.stability_margins(data, returnall=True)
    least = int(np.argmin(np.abs(phases))) if len(phases) else -1
    return Margins(
        min((float(gain) for gain in gains if gain > 1.0), default=np.inf),
        max((float(gain) for gain in gains if 0.0 < gain < 1.0), default=0.0),
        abs(float(phases[least])) if len(phases) else np.inf,
        float(crossings[least]) / (2.0 * np.pi) if len(phases) else np.nan,
    )


def can_be_tried(scenario: Scenario) -> bool:
    """Whether law and observer are this package's: code of a user's may hold to floats."""
    return scenario.controller.kind in LAWS and scenario.observer.kind in OBSERVERS


def loop_of(scenario: Scenario, rig: PlantParameters) -> BentLoop | None:
    """The loop of a scenario on a rig that bends; None of a rigid one, or of code of a user's."""
    if rig.bend is None or not can_be_tried(scenario):
        return None
    return bent_loop(design(scenario, rig), rig.bend)


def trials(scenario: Scenario, rig: PlantParameters) -> list[Trial]:
    """Try what may cure a loop that a bend makes swing, the fewest settings first; of notches the best is told."""
    result = []
    for alternatives in _candidates(scenario, rig):
        tried = []
        for changes in alternatives:
            controller = scenario.controller.model_copy(update=changes)
            loop = loop_of(scenario.model_copy(update={"controller": controller}), rig)
            settings = tuple(_setting(name, value) for name, value in changes.items() if value is not None)
            tried += [] if loop is None else [Trial(settings, loop)]
        if tried:
            result.append(max(tried, key=lambda trial: trial.loop.distance if trial.loop.is_stable else -1.0))
    return result


def cure_among(tried: list[Trial]) -> Trial | None:
    """The first trial that leaves a loop with some margin; None if nothing cures it."""
    return next((trial for trial in tried if trial.loop.is_stable and trial.loop.distance >= CURED), None)


def is_near(loop: BentLoop) -> bool:
    """Whether the mode is near the loop's bandwidth: it is unstable there, or has little margin."""
    return not loop.is_stable or loop.distance < min(NEAR, BENDS_SHARE * loop.rigid_distance)


Changes = dict[str, Any]
"""Fields of [controller] -> their values."""


def _candidates(scenario: Scenario, rig: PlantParameters) -> Iterator[list[Changes]]:
    assert rig.bend is not None
    controller = scenario.controller
    middles = [float(f"{share * rig.bend.frequency_hz:.3g}") for share in NOTCHES]
    middles = [] if controller.notch_hz else [hz for hz in middles if hz < 0.5 * controller.rate_hz]
    notches: list[Changes] = [{"notch_hz": hz} for hz in middles]
    others: list[Changes] = []
    takes_estimate = controller.feedback == "observer" and controller.kind != "lqg"
    if takes_estimate and controller.angle_source != "estimated":
        others.append({"angle_source": "estimated"})
    if controller.kind == "state_feedback":
        others.append({"gains": None, "lqr": LqrSettings(state_cost=Lqg.state_cost, input_cost=SOFTER)})
    yield notches
    yield from ([other] for other in others)
    yield from ([{**notch, **other} for notch in notches] for other in others)


def _setting(name: str, value: Any) -> str:
    if isinstance(value, LqrSettings):
        costs = ", ".join(f"{cost:g}" for cost in value.state_cost)
        return f"controller.lqr={{state_cost=[{costs}], input_cost={value.input_cost:g}}}"
    return f"controller.{name}={value:g}" if isinstance(value, float) else f"controller.{name}={value}"
