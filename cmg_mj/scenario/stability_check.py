"""Checks the gains against the plant: the law on its reduced model, sampled and delayed as the scenario says."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from cmg_mj.controllers.laws.state_feedback import StateFeedback, closed_loop_poles
from cmg_mj.errors import InputError, shown
from cmg_mj.observers.reduced_model import MARGIN, ReducedModel, is_hurwitz
from cmg_mj.scenario.bend_cures import Trial, try_loop
from cmg_mj.scenario.design import Design
from cmg_mj.scenario.plant_parameters import PlantParameters
from cmg_mj.scenario.plant_settings import PlantSettings
from cmg_mj.scenario.schema import Scenario
from cmg_mj.scenario.sliding_pivot import sliding_hint
from cmg_mj.stages.notch import Notch

POOR_DAMPING = 0.4
"""A mode with a smaller damping ratio overshoots by more than a quarter."""
POOR_DISTANCE = 0.7
"""The loop transfer's least distance from -1 of a robust loop: a maximum sensitivity of at most 1.4."""
MOST_PERIODS_LATE = 200  # a loop with a longer delay is unstable long before


class Loop(NamedTuple):
    """The closed loop on the reduced model's linearisation (6), with the true state as its input.

    Attributes:
        poles: Of the sampled loop, as poles of a continuous one, a notch's two among them [1/s].
        damping: The least damping ratio of its modes, but for those that have faded within the loop's own lag.
        distance: The least distance of the loop transfer from -1; 1 or a little less for every LQR.
        period: Of the slowest of the control and the sensors that it uses [s].
        delay: The longest latency of these sensors [s].
        suited: Whether the gains would do without sampling, delay and notch.
        notch_hz: The middle of the notch in the loop; 0 without one, or if these samples cannot show it [Hz].
    """

    poles: np.ndarray
    damping: float
    distance: float
    period: float
    delay: float
    suited: bool
    notch_hz: float = 0.0

    @property
    def slowest(self) -> float:
        """Real part of the slowest pole [1/s]."""
        return float(np.max(np.real(self.poles)))

    @property
    def words(self) -> str:
        """`stable`, `MARGINAL` or `UNSTABLE`."""
        return "stable" if self.slowest < -MARGIN else "MARGINAL" if self.slowest < MARGIN else "UNSTABLE"

    @property
    def hint(self) -> str | None:
        """The fault of the gains, if they have one."""
        remedy = 'controller.gains = "scaled" or [controller.lqr] finds gains that suit'
        if self.suited:
            other = f", or a notch above {self.notch_hz:g} Hz" if self.notch_hz else ""
            remedy = f"a higher rate or less latency{other} is needed"
        late = f", {self.delay:g} s late" if self.delay else ""
        where = f"on this rig's reduced model, sampled every {self.period:g} s{late}"
        if self.slowest >= MARGIN:
            return f"controller: the closed loop is unstable {where} (pole at {self.slowest:.3g} 1/s); {remedy}"
        if self.damping < POOR_DAMPING:
            return (
                f"controller: the closed loop is poorly damped {where} (damping ratio {self.damping:.2f}, good is "
                f"{POOR_DAMPING:g} or more); {remedy}"
            )
        if self.distance < POOR_DISTANCE:
            return (
                f"controller: the closed loop has little margin {where} (its transfer comes within {self.distance:.2f} "
                f"of -1, good is {POOR_DISTANCE:g} or more); {remedy}"
            )
        return None


def closed_loop(scenario: Scenario, law: StateFeedback, model: ReducedModel) -> Loop:
    """Compute the loop that a scenario's gains make.

    Args:
        scenario: The scenario: its rates, its latencies and which signals the law uses.
        law: The law.
        model: The plant's reduced model.

    Returns:
        The loop.

    Raises:
        InputError: In one sample a tilt grows beyond all numbers.
    """
    try:
        with np.errstate(all="ignore"):
            return _closed_loop(scenario, law, model)
    except (np.linalg.LinAlgError, ValueError, OverflowError) as error:
        raise InputError(
            f"plant.model = {shown(scenario.plant.model)}: its reduced model runs beyond all numbers within a sample "
            f"of {law.dt:g} s; gravity, masses, lengths and speeds must be of sizes that go together"
        ) from error


def _closed_loop(scenario: Scenario, law: StateFeedback, model: ReducedModel) -> Loop:
    """See `closed_loop`."""
    sensors = scenario.sensors
    used = [sensors.accelerometer, sensors.encoder, *([sensors.fog] if scenario.controller.feedback == "fog" else [])]
    period = max(law.dt, *(1.0 / sensor.rate_hz for sensor in used))
    delay = max(sensor.latency_s for sensor in used)
    K = np.array([law.gains])
    late = min(math.floor(delay / period + 1e-9), MOST_PERIODS_LATE)  # whole periods, and the rest of one
    rest = max(delay - late * period, 0.0) if late < MOST_PERIODS_LATE else 0.0
    before, after = _hold(model, rest), _hold(model, period - rest)
    A = after[0] @ before[0]
    newer, older = after[1], after[0] @ before[1]  # what u of `late` periods ago does, and the one before it
    n, waiting = len(A), late + 1
    notch_hz = scenario.controller.notch_hz if scenario.controller.notch_hz * period < 0.5 else 0.0
    notch = Notch(notch_hz, period, math.inf) if notch_hz else None
    size = n + waiting
    F = np.zeros((size + 2, size + 2) if notch else (size, size))
    F[:n, :n] = A
    F[n, :n] = -K
    if notch:
        (b0, *b), (_, *a) = notch.numerator, notch.denominator
        F[n, :n], F[n, size] = -b0 * K, 1.0
        F[size:, :n] = -np.outer(b, K)
        F[size:, size:] = [[0.0, 1.0], [0.0, 0.0]]
        F[size:] -= np.outer(a, F[n])
    F[n + 1 : size, n : size - 1] = np.eye(waiting - 1)
    F[:n, n + late] += older[:, 0]
    if late:
        F[:n, n + late - 1] += newer[:, 0]
    else:
        F[:n] += newer @ F[n : n + 1]
    z = np.linalg.eigvals(F)
    poles = np.log(np.where(z == 0.0, np.finfo(float).tiny, z).astype(complex)) / period
    around = np.exp(1j * np.geomspace(1e-4, math.pi, 2000))
    delayed = around**-late
    if notch:
        delayed = delayed * np.polyval(notch.numerator, around) / np.polyval(notch.denominator, around)
    distance = _distance(K, A, newer + older / around[:, None, None], around, delayed)
    swinging = poles[(-poles.real * (period + delay) < 1.0) & (np.abs(poles) > MARGIN)]
    damping = float(np.min(-swinging.real / np.abs(swinging), initial=1.0))
    up = 1j * np.geomspace(1e-3, 1e4, 2000)
    ideal = _distance(K, model.A_e, model.B_e, up, 1.0)
    suited = ideal >= POOR_DISTANCE and is_hurwitz(closed_loop_poles(model, law.gains))
    return Loop(poles, damping, distance, period, delay, suited, notch_hz)


def _distance(K: np.ndarray, A: np.ndarray, B: np.ndarray, along: np.ndarray, delayed: Any) -> float:
    """Return the least distance from -1 of K (s - A)^-1 B, for values of s or z along the border of stability."""
    transfer = K @ np.linalg.solve(
        along[:, None, None] * np.eye(len(A)) - A, np.broadcast_to(B, (len(along), len(A), 1))
    )
    return float(np.min(np.abs(1.0 + transfer[:, 0, 0] * delayed)))


def hints(scenario: Scenario, design: Design, rig: PlantParameters) -> list[str]:
    """Find settings that are no mistake and yet likely to make a plant fall.

    Args:
        scenario: The scenario.
        design: The law and the observers.
        rig: The parameters of the plant.

    Returns:
        Clauses.
    """
    return [*plant_hints(scenario, design, rig), *bend_hint(rig, try_loop(scenario, rig))]


def plant_hints(scenario: Scenario, design: Design, rig: PlantParameters) -> list[str]:
    """Find the `hints` that have nothing to do with a bend."""
    law = design.law
    loop = _loop_hint(scenario, law, rig) if isinstance(law, StateFeedback) else None
    others = loop, sliding_hint(scenario, law, rig), _unused_hint(scenario.plant)
    return [*(f"{rig.path}: {hint}" for hint in rig.hints), *(hint for hint in others if hint)]


def _loop_hint(scenario: Scenario, law: StateFeedback, rig: PlantParameters) -> str | None:
    """Return the fault of the loop on the reduced model. Margin that a notch against a bend takes is no fault."""
    loop = closed_loop(scenario, law, rig.reduced)
    is_for_bend = rig.bend is not None and scenario.controller.notch_hz > 0.0
    return None if is_for_bend and loop.slowest < -MARGIN else loop.hint


def _unused_hint(plant: PlantSettings) -> str | None:
    """Name the settings of a bend that a rigid frame does not use."""
    names = [f"plant.{name}" for name in plant.unused_bend_fields]
    return f"{', '.join(names)}: without effect while plant.bend_frequency_hz = 0, a rigid frame" if names else None


def bend_hint(rig: PlantParameters, trial: Trial | None) -> list[str]:
    """Find the hint about the loop with a bend, if there is one."""
    if rig.bend is None or trial is None:
        return []
    if not trial.is_stable_rigid:
        return ["controller, observer: the loop is not stable with a rigid frame either; `cmg-mj check` says more"]
    if not trial.is_near:
        return []
    fault = f"comes within {trial.distance:.2f} of -1" if trial.is_stable else "is not stable"
    return [
        f"plant.bend_frequency_hz = {rig.bend.frequency_hz:g}: with that bend the loop {fault}; `cmg-mj check` "
        "tries settings that may cure it"
    ]


def require_stable_period(law: StateFeedback, model: ReducedModel) -> None:
    """Refuse a control period so long that the loop is unstable, where a shorter one would do.

    Gains that suit no period are not its business: `hints` names them.

    Args:
        law: The law, fed by the true state without delay.
        model: The plant's reduced model.

    Raises:
        InputError: The loop sampled so seldom is unstable; the message has the lowest stable rate.
    """
    pole = _sampled_pole(law, model, law.dt)
    if pole < MARGIN or not is_hurwitz(closed_loop_poles(model, law.gains)):
        return
    stable, unstable = law.dt, law.dt
    while _sampled_pole(law, model, stable) >= MARGIN:
        stable, unstable = 0.5 * stable, stable
    for _ in range(20):
        middle = math.sqrt(stable * unstable)
        stable, unstable = (middle, unstable) if _sampled_pole(law, model, middle) < MARGIN else (stable, middle)
    raise InputError(
        f"controller.rate_hz = {1.0 / law.dt:g}: the closed loop is unstable on this rig's reduced model, sampled "
        f"every {law.dt:g} s (pole at {pole:.3g} 1/s); more than {1.0 / stable:.3g} Hz are needed"
    )


def _sampled_pole(law: StateFeedback, model: ReducedModel, period: float) -> float:
    """Return the slowest pole of the loop sampled so often, as a continuous one's [1/s]."""
    A, B = _hold(model, period)
    closed = A - B @ np.array([law.gains])
    if not np.all(np.isfinite(closed)):
        return math.inf
    return math.log(max(float(np.abs(np.linalg.eigvals(closed)).max()), np.finfo(float).tiny)) / period


def _hold(model: ReducedModel, time: float) -> tuple[np.ndarray, np.ndarray]:
    """Return A and B of x+ = A x + B u: the linearisation (6) with the integrator, u held for a time."""
    from scipy.linalg import expm

    n = len(model.A_e)
    whole = np.zeros((n + 1, n + 1))
    whole[:n, :n], whole[:n, n:] = model.A_e, model.B_e
    whole = expm(whole * time)
    return whole[:n, :n], whole[:n, n:]
