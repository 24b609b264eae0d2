"""Stability and margins of a loop around a frame that bends, and settings that cure a loop that the bend fells."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from cmg_mj.controllers.laws import LAWS
from cmg_mj.controllers.laws.lqg import Lqg
from cmg_mj.observers import OBSERVERS
from cmg_mj.scenario.bend_decay import Decay, Motion, decay
from cmg_mj.scenario.bend_loop import BentLoop, bent_loop
from cmg_mj.scenario.design import design
from cmg_mj.scenario.plant_parameters import PlantParameters
from cmg_mj.scenario.schema import LqrSettings, Scenario

NEAR = 0.4
"""A transfer that comes nearer to -1 has little margin: disturbances at that frequency grow by 2.5."""
BENDS_SHARE = 0.8
"""Share of the rigid loop's distance from -1. Above it a small distance is the rigid loop's fault, not the bend's."""
CURED = 0.2
"""A loop that comes nearer to -1 is not cured: an eighth of a turn more of phase, or less gain, fells it."""
NOTCHES = (1.08, 1.0, 0.92)
"""Middles of the notches that are tried, over the mode's frequency."""
SOFT_INPUT_COST = 10.0
"""Weight of the command for a lower bandwidth; Table 2's gains have 1."""
MOTION_WORDS: dict[Motion, str] = {
    "decays": "stable",
    "decays if small": "stable for small motions, but NOT for its own initial tilt, bias and push",
    "swings": "UNSTABLE",
    "falls": "UNSTABLE",
}


Changes = dict[str, Any]
"""Fields of [controller] -> their values."""


class Margins(NamedTuple):
    """Stability margins, by python-control.

    Attributes:
        largest_gain: Factor to which the gain may rise; infinite if to any.
        least_gain: Factor to which the gain may fall; 0 if to any.
        phase_deg: The least phase margin [deg]; infinite if the transfer never has the size 1.
        phase_at_hz: The frequency of the phase margin [Hz].
    """

    largest_gain: float
    least_gain: float
    phase_deg: float
    phase_at_hz: float

    @property
    def words(self) -> str:
        """The margins, for one line."""
        least, largest, phase = self.least_gain, self.largest_gain, ""
        fall = f" or fall to {least:.2f} times" if least > 0.0 else ""
        rise = f"rise to {largest:.2f} times" if np.isfinite(largest) else "rise without limit"
        if np.isfinite(self.phase_deg):
            phase = f", phase margin {self.phase_deg:.0f} deg at {self.phase_at_hz:.3g} Hz"
        return f"its gain may {rise}{fall}{phase}"


class Trial(NamedTuple):
    """A loop that was tried.

    Attributes:
        settings: The settings that were changed for it, as `--set` takes them.
        decay: Whether its motions decay.
        loop: Its transfer; None where it has no margins: of an unstable loop, or at a very low control rate.
    """

    settings: tuple[str, ...]
    decay: Decay
    loop: BentLoop | None = None

    @property
    def is_stable(self) -> bool:
        """True if the loop is stable with the bend."""
        return self.decay.bending == "decays"

    @property
    def is_stable_rigid(self) -> bool:
        """True if the loop is stable with a rigid frame, as far as is known."""
        return self.decay.rigid in ("decays", None)

    @property
    def distance(self) -> float:
        """The least distance of the transfer from -1; 0 without a transfer."""
        return 0.0 if self.loop is None else self.loop.distance

    @property
    def is_cure(self) -> bool:
        """True if the loop is stable, bending and rigid, with some margin."""
        return self.is_stable and self.is_stable_rigid and self.distance >= CURED

    @property
    def is_near(self) -> bool:
        """True if the bend makes a stable loop unstable, or takes its margin."""
        if not self.is_stable_rigid:
            return False
        if not self.is_stable:
            return True
        return self.loop is not None and self.loop.distance < min(NEAR, BENDS_SHARE * self.loop.rigid_distance)

    @property
    def words(self) -> str:
        """The verdict, for one line."""
        text = MOTION_WORDS[self.decay.bending]
        if self.loop is not None:
            text += f", nearest to -1 {self.loop.distance:.2g}; {margins(self.loop).words}"
        rigid = self.decay.rigid
        return text if rigid in ("decays", None) else f"{text} (with a rigid frame: {MOTION_WORDS[rigid]})"


def margins(loop: BentLoop) -> Margins:
    """Compute a stable loop's margins."""
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
    """Return whether law and observer are this package's: code of a user's may take floats only."""
    return scenario.controller.kind in LAWS and scenario.observer.kind in OBSERVERS


def try_loop(scenario: Scenario, rig: PlantParameters, settings: tuple[str, ...] = ()) -> Trial | None:
    """Try the loop of a scenario.

    Args:
        scenario: The scenario of one axis.
        rig: The parameters of the plant.
        settings: The settings that were changed in it, as `--set` takes them. Then a fall with the bend says enough.

    Returns:
        The trial; None for a rigid frame, or code of a user's.
    """
    if rig.bend is None or not can_be_tried(scenario):
        return None
    parts = design(scenario, rig)
    motions = decay(parts, rig.bend, until_fall=bool(settings))
    has_margins = {*motions} <= {"decays", "decays if small"}
    return Trial(settings, motions, bent_loop(parts, rig.bend) if has_margins else None)


def trials(scenario: Scenario, rig: PlantParameters) -> list[Trial]:
    """Try settings that may cure a loop, the fewest first; of several notches return the best."""
    assert rig.bend is not None

    def best(alternatives: list[Changes]) -> list[tuple[Trial, Changes]]:
        loops = [(_changed(scenario, rig, changes), changes) for changes in alternatives]
        pairs = [(trial, changes) for trial, changes in loops if trial is not None]
        return [max(pairs, key=lambda pair: (pair[0].is_stable, pair[0].distance))] if pairs else []

    notches, others = _notches(scenario, rig.bend.frequency_hz), _other_changes(scenario)
    result = best(notches)
    if result and result[0][0].is_stable:
        notches = [result[0][1]]
    for other in others:
        result += best([other])
    for other in others:
        result += best([{**notch, **other} for notch in notches])
    return [trial for trial, _ in result]


def _changed(scenario: Scenario, rig: PlantParameters, changes: Changes) -> Trial | None:
    """Try a scenario with changes in its section [controller]."""
    controller = scenario.controller.model_copy(update=changes)
    settings = tuple(_setting(name, value) for name, value in changes.items() if value is not None)
    return try_loop(scenario.model_copy(update={"controller": controller}), rig, settings)


def cure_among(tried: list[Trial]) -> Trial | None:
    """Return a cure with the fewest settings: the first that has some margin, else the one that has most.

    Args:
        tried: The trials.

    Returns:
        The cure; None if there is none.
    """
    cures = [trial for trial in tried if trial.is_cure]
    fewest = min((len(trial.settings) for trial in cures), default=0)
    simplest = [trial for trial in cures if len(trial.settings) == fewest]
    ample = [trial for trial in simplest if trial.distance >= NEAR]
    return ample[0] if ample else max(simplest, key=lambda trial: trial.distance, default=None)


def _notches(scenario: Scenario, mode_hz: float) -> list[Changes]:
    """List notches near a mode, but for the one that the controller has."""
    controller = scenario.controller
    middles = [float(f"{share * mode_hz:.3g}") for share in NOTCHES]
    return [{"notch_hz": hz} for hz in middles if hz < 0.5 * controller.rate_hz and hz != controller.notch_hz]


def _other_changes(scenario: Scenario) -> list[Changes]:
    """List the other changes that the law takes: the estimated angle, a lower bandwidth."""
    controller = scenario.controller
    result: list[Changes] = []
    takes_estimate = controller.feedback == "observer" and controller.kind != "lqg"
    if takes_estimate and controller.angle_source != "estimated":
        result.append({"angle_source": "estimated"})
    if controller.kind == "state_feedback":
        result.append({"gains": None, "lqr": LqrSettings(state_cost=Lqg.state_cost, input_cost=SOFT_INPUT_COST)})
    return result


def _setting(name: str, value: Any) -> str:
    if isinstance(value, LqrSettings):
        costs = ", ".join(f"{cost:g}" for cost in value.state_cost)
        return f"controller.lqr={{state_cost=[{costs}], input_cost={value.input_cost:g}}}"
    return f"controller.{name}={value:g}" if isinstance(value, float) else f"controller.{name}={value}"
