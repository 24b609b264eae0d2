"""The verdict on a loop around a frame that bends: everything that `check` and a run's hints say of the bend."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

from cmg_mj.core.errors import InputError
from cmg_mj.laws import LAWS
from cmg_mj.linear.loop import ClosedLoop
from cmg_mj.linear.march import MOTION_WORDS, Motion, march
from cmg_mj.linear.plant import linearise
from cmg_mj.linear.verdict import Verdict, judge, margins
from cmg_mj.observers import OBSERVERS
from cmg_mj.plant.plant import Plant
from cmg_mj.scenario.design import Design
from cmg_mj.scenario.plant_settings import BendBeyond

NEAR = 0.4
"""A transfer that comes nearer to -1 has little margin: disturbances at that frequency grow by 2.5."""
BENDS_SHARE = 0.8
"""Share of the rigid loop's distance from -1. Above it a small distance is the rigid loop's fault, not the bend's."""
BEYOND: dict[BendBeyond, str] = {
    "sensors": "with the sensors; the modules, whose tilt and rate count as true, are before it",
    "modules": "with the modules, whose tilt and rate count as true; the sensors are before it",
    "both": "with the modules, whose tilt and rate count as true, and the sensors",
}


class BentVerdict(NamedTuple):
    """What is known of a loop around a frame that bends: its linear system's verdict, or how it moves in a march.

    Attributes:
        bending: With the bend.
        rigid: With a rigid frame.
    """

    bending: Verdict | Motion
    rigid: Verdict | Motion

    @property
    def is_stable(self) -> bool:
        """True if the loop is stable with the bend."""
        return _is_stable(self.bending)

    @property
    def is_stable_rigid(self) -> bool:
        """True if the loop is stable with a rigid frame."""
        return _is_stable(self.rigid)

    @property
    def distance(self) -> float | None:
        """The least distance of a stable loop's transfer from -1; None where it is not known."""
        return self.bending.distance if isinstance(self.bending, Verdict) and self.is_stable else None

    @property
    def words(self) -> str:
        """The verdict, for one line."""
        text = _words(self.bending)
        return text if self.is_stable_rigid else f"{text} (with a rigid frame: {_words(self.rigid)})"

    @property
    def fault(self) -> str:
        """What the bend does to a loop that is stable with a rigid frame; empty if it does no harm."""
        if self.is_stable_rigid and not self.is_stable:
            return "is not stable"
        if self.distance is None or not isinstance(self.rigid, Verdict) or not self.is_stable_rigid:
            return ""
        is_near = self.distance < min(NEAR, BENDS_SHARE * self.rigid.distance)
        return f"comes within {self.distance:.2f} of -1" if is_near else ""


def judge_bend(design: Design, plant: Plant) -> BentVerdict | None:
    """Judge the loop of a frame that bends; None for a rigid frame, and where only a march of a user's code could."""
    if not plant.settings.bends:
        return None
    bending, rigid = (linearise(plant, rigid=is_rigid) for is_rigid in (False, True))
    try:
        return BentVerdict(*(judge(ClosedLoop(design, each.minimal())) for each in (bending, rigid)))
    except InputError:
        controller, observer = design.scenario.controller.kind, design.scenario.observer.kind
        if controller not in LAWS or observer not in OBSERVERS:
            return None
        return BentVerdict(march(design, bending), march(design, rigid))


def _is_stable(verdict: Verdict | Motion) -> bool:
    return verdict.is_stable if isinstance(verdict, Verdict) else verdict == "decays"


def _words(verdict: Verdict | Motion) -> str:
    if not isinstance(verdict, Verdict):
        return MOTION_WORDS[verdict]
    words = verdict.words + (f", nearest to -1 {verdict.distance:.2g}" if verdict.is_stable else "")
    if verdict.transfer is None or verdict.omega is None:
        return words
    return f"{words}; {margins(verdict.transfer, verdict.omega).words}"


def bend_hints(plant: Plant, verdict: BentVerdict | None) -> list[str]:
    """Find the hints about a bend: settings without effect, or what it does to the loop."""
    settings = plant.settings
    if names := [f"plant.{name}" for name in settings.unused_bend_fields]:
        return [f"{', '.join(names)}: without effect while plant.bend_frequency_hz = 0, a rigid frame"]
    if verdict is None:
        return []
    if not verdict.is_stable_rigid:
        return ["controller, observer: the loop is not stable with a rigid frame either; `cmg-mj check` says more"]
    if not verdict.fault:
        return []
    return [
        f"plant.bend_frequency_hz = {settings.bend_frequency_hz:g}: with that bend the loop {verdict.fault}; a notch "
        "at that frequency, the estimated angle or less bandwidth may cure it"
    ]


def bend_rows(design: Design, plant: Plant, verdict: BentVerdict | None) -> Iterator[tuple[str, str]]:
    """Describe the mode of a frame that bends, and the loop around it, in rows of `cmg-mj check`."""
    settings = plant.settings
    if not settings.bends:
        return
    hz, ratio = settings.bend_frequency_hz, settings.bend_damping_ratio
    loss, numerical = -math.expm1(-4.0 * math.pi * ratio * hz), rk4_energy_loss(hz, plant.timestep)
    yield "bend", f"{hz:g} Hz, damping ratio {ratio:g}, beyond it {settings.bend_share:g} of the inertia"
    yield "", BEYOND[settings.bend_beyond]
    yield "", f"loses {100.0 * loss:.3g} % of its energy a second, and {100.0 * numerical:.2g} % to the physics steps"
    feedback = design.scenario.controller.feedback
    if verdict is None:
        yield "", "its loop is not computed for code of your own"
    else:
        yield "", f"the loop with it, feedback from the {feedback}: {verdict.words}"


def rk4_energy_loss(frequency_hz: float, step: float) -> float:
    """Compute the share of an undamped mode's energy that RK4 takes in a second.

    With z = omega h, |R(iz)|^2 = 1 - z^6/72 + z^8/576.

    Args:
        frequency_hz: The mode's frequency [Hz].
        step: The physics step h [s].
    """
    z = 2.0 * math.pi * frequency_hz * step
    return -math.expm1(math.log1p(-(z**6) / 72.0 + z**8 / 576.0) / step)
