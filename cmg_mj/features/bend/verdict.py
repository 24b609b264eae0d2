"""The verdict on a loop around a frame that bends: everything that `check` and a run's hints say of the bend."""

from __future__ import annotations

import math
from typing import NamedTuple

from cmg_mj.core.errors import InputError
from cmg_mj.features.bend import Bend, BendBeyond
from cmg_mj.inputs.features import Judgement
from cmg_mj.laws import LAWS
from cmg_mj.linear.loop import ClosedLoop
from cmg_mj.linear.march import MOTION_WORDS, Motion, march
from cmg_mj.linear.plant import linearise
from cmg_mj.linear.verdict import Verdict, judge, margins
from cmg_mj.observers import OBSERVERS
from cmg_mj.plant.plant import Plant
from cmg_mj.scenario.design import Design

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
    if not plant.bends:
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


def describe_bend(design: Design, plant: Plant) -> Judgement:
    """Describe the mode of a frame that bends and the loop around it, and what the bend does to the loop."""
    bend: Bend = design.scenario.section("bend")
    if not plant.bends:
        unused = [
            f"bend.{name}"
            for name in ("damping_ratio", "share", "beyond")
            if getattr(bend, name) != getattr(Bend(), name)
        ]
        return Judgement(
            hints=[f"{', '.join(unused)}: without effect while bend.frequency_hz = 0, a rigid frame"] if unused else []
        )
    verdict, hz = judge_bend(design, plant), bend.frequency_hz
    loss, numerical = -math.expm1(-4.0 * math.pi * bend.damping_ratio * hz), rk4_energy_loss(hz, plant.timestep)
    rows = [
        ("bend", f"{hz:g} Hz, damping ratio {bend.damping_ratio:g}, beyond it {bend.share:g} of the inertia"),
        ("", BEYOND[bend.beyond]),
        ("", f"loses {100.0 * loss:.3g} % of its energy a second, and {100.0 * numerical:.2g} % to the physics steps"),
    ]
    if verdict is None:
        return Judgement([*rows, ("", "its loop is not computed for code of your own")])
    feedback = design.scenario.controller.feedback
    rows.append(("", f"the whole loop with it, feedback from the {feedback}: {verdict.words}"))
    if not verdict.is_stable_rigid:
        hint = "controller, observer: the loop is not stable with a rigid frame either; `cmg-mj check` says more"
        return Judgement(rows, [hint])
    if not verdict.fault:
        return Judgement(rows)
    hint = (
        f"bend.frequency_hz = {hz:g}: with that bend the loop {verdict.fault}; a notch at that frequency, the "
        "estimated angle or less bandwidth may cure it"
    )
    return Judgement(rows, [hint])


def rk4_energy_loss(frequency_hz: float, step: float) -> float:
    """Compute the share of an undamped mode's energy that RK4 takes in a second.

    With z = omega h, |R(iz)|^2 = 1 - z^6/72 + z^8/576.

    Args:
        frequency_hz: The mode's frequency [Hz].
        step: The physics step h [s].
    """
    z = 2.0 * math.pi * frequency_hz * step
    return -math.expm1(math.log1p(-(z**6) / 72.0 + z**8 / 576.0) / step)
