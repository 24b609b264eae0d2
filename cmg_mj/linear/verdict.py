"""Judges closed loops: stability and margins of a linear one, and what a user is told of the gains."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from cmg_mj.core.errors import InputError, shown
from cmg_mj.core.reduced_model import MARGIN, ReducedModel, hold_matrices, is_hurwitz
from cmg_mj.core.types import Law
from cmg_mj.inputs.features import FEATURES
from cmg_mj.laws.state_feedback import StateFeedback, closed_loop_poles
from cmg_mj.linear.ceiling import ceiling
from cmg_mj.linear.loop import ClosedLoop, sensors_used
from cmg_mj.linear.plant import linear_reduced, linearise
from cmg_mj.plant.plant import Plant
from cmg_mj.scenario.design import Design
from cmg_mj.scenario.schema import Scenario

POOR_DAMPING = 0.4
"""A mode with a smaller damping ratio overshoots by more than a quarter."""
POOR_DISTANCE = 0.7
"""The loop transfer's least distance from -1 of a robust loop: a maximum sensitivity of at most 1.4."""
FREQUENCIES = 2000
"""Frequencies of a transfer, fewer of a loop over several control periods; more about poorly damped poles."""


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


class Verdict(NamedTuple):
    """What a closed loop's linear system says of it.

    Attributes:
        poles: Its poles, as of a continuous loop, (n,) complex [1/s].
        damping: The least damping ratio of its modes, but for those that have faded within the loop's own lag.
        distance: The least distance from -1 of the loop transfer, opened at the command; 0 of an unstable loop.
        transfer: The loop transfer L of a stable loop whose sensors are not slower than the controller.
        omega: Its frequencies [rad/s].
    """

    poles: np.ndarray
    damping: float
    distance: float
    transfer: np.ndarray | None = None
    omega: np.ndarray | None = None

    @property
    def slowest(self) -> float:
        """Real part of the slowest pole [1/s]."""
        return float(np.max(np.real(self.poles)))

    @property
    def is_stable(self) -> bool:
        """True if every pole fades."""
        return self.slowest < -MARGIN

    @property
    def words(self) -> str:
        """`stable`, `MARGINAL` or `UNSTABLE`."""
        return "stable" if self.is_stable else "MARGINAL" if self.slowest < MARGIN else "UNSTABLE"


def judge(loop: ClosedLoop, lag: float = 0.0) -> Verdict:
    """Judge a closed loop by its poles and by L = -H/(1 + H), H from a gimbal rate beside the command to the command.

    Args:
        loop: The loop.
        lag: Modes that fade within this time do not count for the damping [s].
    """
    from scipy.linalg import get_lapack_funcs, schur

    A, B, C, D, _, outputs = loop.matrices()
    ticks = loop.ticks
    rates = range(len(loop.inputs) - ticks, len(loop.inputs))
    commands = [i for i, name in enumerate(outputs) if name.startswith("u_rad_s")]
    triangle, basis = schur(A, output="complex")[:2]
    shown, driven = C[commands] @ basis, basis.conj().T @ B[:, rates]
    z = np.diag(triangle)
    poles = _continuous(loop, A, C[commands], z)
    swinging = poles[(-np.real(poles) * lag < 1.0) & (np.abs(poles) > MARGIN)]
    damping = float(np.min(-np.real(swinging) / np.abs(swinging), initial=1.0))
    verdict = Verdict(poles, damping, 0.0)
    if verdict.slowest >= MARGIN:
        return verdict
    near = [abs(np.angle(pole)) + abs(1.0 - abs(pole)) * np.linspace(-3.0, 3.0, 31) for pole in z if abs(pole) > 0.5]
    angles = np.concatenate([np.geomspace(1e-4, math.pi, FREQUENCIES // ticks + 50), *near])
    angles = np.unique(np.round(angles, 9))
    angles = angles[(angles >= 1e-4) & (angles <= math.pi)]
    unit = np.eye(len(z))
    solve = get_lapack_funcs(["trtrs"], (triangle,))[0]  # `solve_triangular` checks its arguments for thrice as long
    H = [shown @ solve(point * unit - triangle, driven)[0] for point in np.exp(1j * angles)]
    sensitivity = np.eye(ticks) + np.array(H) + D[np.ix_(commands, rates)]  # 1 + H = 1/(1 + L)
    distance = 1.0 / float(np.linalg.norm(sensitivity, 2, axis=(1, 2)).max())
    transfer = 1.0 / sensitivity[:, 0, 0] - 1.0 if ticks == 1 else None
    return verdict._replace(distance=distance, transfer=transfer, omega=angles / loop.period)


def _continuous(loop: ClosedLoop, A: np.ndarray, C: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Return poles as of a continuous loop; over several ticks the commands show how often a mode has turned."""
    turned = np.angle(z)
    if loop.ticks > 1:
        z, modes = np.linalg.eig(A)
        shown = np.vstack([C @ modes, z * (C[0] @ modes)])
        with np.errstate(all="ignore"):
            whole = np.nan_to_num(np.angle(shown[1:] / shown[:-1])).sum(axis=0)
        turned = np.angle(z) + 2.0 * math.pi * np.round((whole - np.angle(z)) / (2.0 * math.pi))
    return (np.log(np.maximum(np.abs(z), np.finfo(float).tiny)) + 1j * turned) / loop.period


def margins(transfer: np.ndarray, omega: np.ndarray) -> Margins:
    """Compute a stable loop's margins from its transfer at frequencies [rad/s]."""
    import control

    gains, phases, _, _, crossings, _ = control.stability_margins(control.frd(transfer, omega), returnall=True)
    phase, at = min(zip(np.abs(phases), crossings, strict=True), default=(np.inf, np.nan))
    largest = min((gain for gain in gains if gain > 1.0), default=np.inf)
    return Margins(largest, max((gain for gain in gains if 0.0 < gain < 1.0), default=0.0), phase, at / (2.0 * np.pi))


class GainsVerdict(NamedTuple):
    """The loop of the gains with the reduced model's true state, as late and as seldom as the sensors show it.

    Attributes:
        loop: The verdict.
        hint: The fault of the gains, if they have one.
    """

    loop: Verdict
    hint: str | None


def judge_gains(design: Design) -> GainsVerdict:
    """Judge a scenario's gains on the reduced model.

    Args:
        design: The law, a `StateFeedback`.

    Raises:
        InputError: In one sample a tilt grows beyond all numbers.
    """
    scenario, law, model = design.scenario, design.law, design.rig.reduced
    controller = scenario.controller
    assert isinstance(law, StateFeedback)
    used = [getattr(scenario.sensors, name) for name in sensors_used(design)]
    period = max(law.dt, *(1.0 / sensor.rate_hz for sensor in used))
    delay = max(sensor.latency_s for sensor in used)
    try:
        with np.errstate(all="ignore"):
            loop = judge(ClosedLoop(design, linear_reduced(model), true_state=True), period + delay)
    except InputError:  # a sensor's time does not fit the physics step
        raise
    except (np.linalg.LinAlgError, ValueError, OverflowError) as error:
        raise InputError(
            f"plant.model = {shown(scenario.plant.model)}: its reduced model runs beyond all numbers within a sample "
            f"of {law.dt:g} s; gravity, masses, lengths and speeds must be of sizes that go together"
        ) from error
    if law.gains[3] == 0.0:  # an integrator that nothing reads is no state of the loop, and its pole stays at 0
        loop = loop._replace(poles=np.append(loop.poles, 0.0))
    up = 1j * np.geomspace(1e-3, 1e4, FREQUENCIES)
    states = np.linalg.solve(up[:, None, None] * np.eye(4) - model.A_e, np.broadcast_to(model.B_e, (len(up), 4, 1)))
    ideal = np.min(np.abs(1.0 + np.array(law.gains) @ states[:, :, 0].T))
    remedy, notch_hz = 'controller.gains = "scaled" or [controller.lqr] finds gains that suit', controller.notch_hz
    if ideal >= POOR_DISTANCE and is_hurwitz(closed_loop_poles(model, law.gains)):  # without sampling, delay and notch
        other = f", or a notch above {notch_hz:g} Hz" if notch_hz else ""
        remedy = f"a higher rate or less latency{other} is needed"
    if loop.slowest >= MARGIN:
        fault, figure = "is unstable", f"pole at {loop.slowest:.3g} 1/s"
    elif loop.damping < POOR_DAMPING:
        fault, figure = "is poorly damped", f"damping ratio {loop.damping:.2f}, good is {POOR_DAMPING:g} or more"
    elif loop.distance < POOR_DISTANCE:
        fault = "has little margin"
        figure = f"its transfer comes within {loop.distance:.2f} of -1, good is {POOR_DISTANCE:g} or more"
    else:
        return GainsVerdict(loop, None)
    where = f"on this rig's reduced model, sampled every {period:g} s" + (f", {delay:g} s late" if delay else "")
    return GainsVerdict(loop, f"controller: the closed loop {fault} {where} ({figure}); {remedy}")


def hints(design: Design, plant: Plant) -> list[str]:
    """Find settings that are no mistake and yet likely to make a plant fall, but for the bend's.

    Args:
        design: The law and the observers.
        plant: The plant.

    Returns:
        Clauses.
    """
    scenario, law = design.scenario, design.law
    gains = judge_gains(design) if isinstance(law, StateFeedback) else None
    # Margin that a notch against a bend takes is no fault.
    is_for_bend = plant.bends and scenario.controller.notch_hz > 0.0
    fault = None if gains is None or (is_for_bend and gains.loop.is_stable) else gains.hint
    others = *_ceiling_hints(design, plant.axis.name), fault, _sliding_hint(scenario, law, plant)
    return [*(f"{plant.path}: {hint}" for hint in plant.hints), *(hint for hint in others if hint)]


def _ceiling_hints(design: Design, axis: str) -> Iterator[str]:
    """Write clauses for a first tilt and for pushes about the axis from which no controller recovers."""
    limit = ceiling(design.rig.reduced, design.law.rate_limit)
    start, most = design.scenario.plant.initial_tilt_deg, math.degrees(limit.tilt)
    sizes = [("plant.initial_tilt_deg", start, most, "deg")]
    for i, push in enumerate(design.scenario.push):
        if push.axis not in (None, axis):
            continue
        most = limit.push_impulse(push.duration_s) / push.duration_s
        sizes.append((f"push.{i}.torque_n_m", push.torque_n_m, most, "N m"))
    for field, value, most, unit in sizes:
        if abs(value) > most:
            yield (
                f"{field} = {value:g}: no controller recovers from more than {most:.3g} {unit} on this plant; a larger "
                "pair or a lighter plant does"
            )


STANDS_STILL = 1e-6
"""A mode of the sampled loop that is so near 1 is the place of what slides, which nothing holds or moves."""
IN_THE_MODEL = "the inertia that is left, and the pivot's acceleration in what the sensors show"
NOT_IN_THE_MODEL = "friction, damping, springs and ends of what it slides on, and that the inertia grows with the tilt"
_FED = "with that angle and the true rate"
_UNKNOWN = "and what it slides on is damped or sprung so much that the mass centre does not stay where it is"


class SlidingPoles(NamedTuple):
    """Slowest pole of the loop fed with the true rate and the tilt taken about a point of the radial line [1/s].

    Attributes:
        about_centre: About the common mass centre.
        about_pivot: About the pivot.
    """

    about_centre: float
    about_pivot: float


def sliding_poles(law: object, plant: Plant) -> SlidingPoles | None:
    """Find the slowest poles of the loop of a plant whose pivot slides; None for a pivot at rest, or another law.

    The law is fed y1 and the true rate, by sensors without noise and delay; a pole is infinite where a sample's growth
    is beyond all numbers.
    """
    arm = plant.reduced.pivot_arm
    if not arm or not isinstance(law, StateFeedback):
        return None
    poles, (k1, k2, k3, k4) = [], law.gains
    for height in (arm, 0.0):
        linear = linearise(plant, rigid=True, height=height)
        _, rate, y2, y1, _, _ = linear.C
        F, G = linear.hold(law.dt)
        closed = np.eye(len(F) + 1)
        closed[:-1, :-1], closed[:-1, -1] = F - np.outer(G[:, 0], k1 * y1 + k2 * rate + k3 * y2), -k4 * G[:, 0]
        closed[-1, :-1] = -law.dt * y2
        poles.append(_slowest(closed, law.dt))
    return SlidingPoles(*poles)


def sliding_words(plant: Plant) -> str:
    """Say what the tilt is taken about, for one line; empty for a pivot at rest."""
    arm = plant.reduced.pivot_arm
    if not arm:
        return ""
    if plant.pair_tilt.height:
        return f"slides; the tilt is taken about the common mass centre, {arm:.3g} m above it, which stays where it is"
    return f"slides, and the tilt is taken about it: {measured_words(plant)}"


def measured_words(plant: Plant) -> str:
    """Say what y1 shows if the tilt is taken about the pivot."""
    c1, d = plant.reduced.measured_tilt(0.0, plant.gravity)
    return f"y1 shows {c1:.3g} x1 + ({d:.3g} s) u"


def loop_words(pole: float) -> str:
    """Say whether a loop with this slowest pole [1/s] is stable."""
    return f"{'stable' if pole < -MARGIN else 'UNSTABLE'} (pole at {pole:.3g} 1/s)"


def _sliding_hint(scenario: Scenario, law: object, plant: Plant) -> str | None:
    """Clause for a pivot that slides where the tilt is taken about it, or the loop is unstable anyway."""
    if not plant.reduced.pivot_arm:
        return None
    measured = scenario.controller.angle_source == "measured"
    poles = sliding_poles(law, plant) if measured else None
    if plant.pair_tilt.height:
        if poles is None or poles.about_centre < -MARGIN:
            return None
        return f"the pivot slides, {_UNKNOWN}: the loop is {loop_words(poles.about_centre)} {_FED}"
    loop = "" if poles is None else f"; the loop is {loop_words(poles.about_pivot)} {_FED}"
    return (
        f"plant.pivot_slides = false: the pivot slides, and {measured_words(plant)}{loop}; with "
        "plant.pivot_slides=true the tilt is taken about the common mass centre"
    )


SIMULATED = (
    "plant.accelerometer_inner_misplaced_mm",
    "plant.accelerometer_outer_misplaced_mm",
    *(name for name, feature in FEATURES.items() if feature.edit),
)
"""The properties that the plant's MuJoCo model itself has, whoever steps it."""


def omissions(scenario: Scenario) -> dict[str, str]:
    """Find what the reduced model, the loop of its true state, the ceiling and the floor of y1 know nothing of.

    The whole loop, `ClosedLoop`, knows means and places of the accelerometers.

    Args:
        scenario: The scenario of one axis.

    Returns:
        Field -> what it is, in words.
    """
    accelerometer, plant = scenario.sensors.accelerometer, scenario.plant
    inner, outer = plant.accelerometer_inner_misplaced_mm, plant.accelerometer_outer_misplaced_mm
    clauses = [(name, part.unmodelled) for name, parts in scenario.feature_sections.items() for part in parts]
    clauses += [
        ("sensors.accelerometer.averaged", accelerometer.averaged and "the accelerometers' means"),
        ("sensors.accelerometer.vibration_mg", accelerometer.vibration_mg and "the accelerometers' vibration"),
        (
            "sensors.accelerometer.wheel_harmonics_mg",
            any(accelerometer.wheel_harmonics_mg) and "the flywheels' tones in the accelerometers",
        ),
        ("plant.accelerometer_inner_misplaced_mm", inner and "the inner accelerometer's misplacement"),
        ("plant.accelerometer_outer_misplaced_mm", outer and "the outer accelerometer's misplacement"),
    ]
    return {field: clause for field, clause in clauses if clause}


def require_stable_period(law: Law, model: ReducedModel) -> None:
    """Refuse a control period so long that the loop is unstable, where a shorter one would do.

    Gains that suit no period are not its business: `hints` names them.

    Args:
        law: The law, fed by the true state without delay; one that is no `StateFeedback` is not judged.
        model: The plant's reduced model.

    Raises:
        InputError: The loop sampled so seldom is unstable; the message has the lowest stable rate.
    """
    if not isinstance(law, StateFeedback):
        return
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
    """Return the slowest pole of the loop sampled so often [1/s]."""
    A, B = hold_matrices(model.A_e, model.B_e, period)[:2]
    return _slowest(A - B @ np.array([law.gains]), period)


def _slowest(closed: np.ndarray, period: float) -> float:
    """Return a sampled loop's slowest pole as of a continuous one, but for those so near 1 [1/s].

    It is infinite where a sample's growth is beyond all numbers.
    """
    if not np.all(np.isfinite(closed)):
        return math.inf
    z = np.linalg.eigvals(closed)
    size = np.max(np.abs(z[np.abs(z - 1.0) >= STANDS_STILL]), initial=np.finfo(float).tiny)
    return math.log(size) / period
