"""The tuning experiment recorded: the loop closed on the gyro, and the part of it that is scored."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from cmg_mj.controllers.laws import law_class
from cmg_mj.controllers.laws.protocol import needs
from cmg_mj.errors import InputError
from cmg_mj.observers import Observer
from cmg_mj.replay import replay
from cmg_mj.results.result import Result
from cmg_mj.results.trajectory import Trajectory
from cmg_mj.scenario.disturbances import Window, inside, push_windows
from cmg_mj.scenario.schema import ObserverSettings, Scenario
from cmg_mj.scenario.time_grid import common_period
from cmg_mj.simulation.batched_observers import BatchJob, run_side_by_side
from cmg_mj.simulation.experiment import Experiment, prepare

WARM_UP_S = 2.0
"""So much of the recording before the window is replayed as well, for the observer to settle [s]."""


def windows_of(scenario: Scenario) -> list[Window]:
    """What is scored: from each push to one second after its end, as in a summary; the whole run if there is no push.

    Over a whole run with a push the best differentiator would be none at all: outside that second the rig hardly
    moves, and an estimate of zero has the smallest error.
    """
    end = scenario.duration_s
    windows = push_windows(scenario.push) or [(0.0, end)]
    return [(start, min(stop, end)) for start, stop in windows if start < end] or windows


def window_of(scenario: Scenario) -> Window:
    """From the start of the first of the windows to the end of the last [s]."""
    windows = windows_of(scenario)
    return windows[0][0], windows[-1][1]


@dataclass(frozen=True)
class Recorded:
    """What was measured and commanded in some worlds, all of which stood.

    Attributes:
        trajectory: From the warm-up to the window's end.
        window: What is scored, from its start to its end [s].
        fell: How many more worlds there were, which fell.
        windows: The parts of it that are scored, if not all of it is [s].
    """

    trajectory: Trajectory
    window: Window
    fell: int = 0
    windows: Sequence[Window] = ()

    @property
    def worlds(self) -> int:
        """How many."""
        return self.trajectory["y1_rad"].shape[1]

    @property
    def largest_acceleration(self) -> float:
        """Of the tilt, by differences of its true rate, which a differentiator has to follow [rad/s^2]."""
        steps = np.diff(self.trajectory["x2_rad_s"], axis=0) / np.diff(self.trajectory["time_s"])[:, None]
        return float(np.abs(steps).max())

    @property
    def zero_rms(self) -> float:
        """The error of an estimate of zero: the RMS of the gyro's rate over the window, mean of the worlds [rad/s]."""
        return float(np.sqrt(np.mean(self.trajectory["fog_rad_s"][self._scored] ** 2, axis=0)).mean())

    @property
    def _scored(self) -> np.ndarray:
        """Which rows are scored, (n_ticks,)."""
        return inside(self.trajectory["time_s"], self.windows or [self.window])

    def errors(self, observer: Observer) -> np.ndarray:
        """RMS over the window of the estimated rate less the gyro's, (n_worlds,) [rad/s]; NaN where it is lost."""
        scored = self._scored
        with np.errstate(all="ignore"):
            difference = replay(observer, self.trajectory).x2[scored] - self.trajectory["fog_rad_s"][scored]
            return np.sqrt(np.mean(difference**2, axis=0))


def tuning_scenario(scenario: Scenario, noise_ug_rthz: float | None = None) -> Scenario:
    """The scenario as the observers are tuned in it: the law fed by the gyro and the measured angles.

    No observer takes part in that loop, so one recording serves them all; it ends with the window.

    Args:
        scenario: The experiment.
        noise_ug_rthz: Another noise density of the accelerometers [ug/sqrt(Hz)].

    Returns:
        The scenario to record.
    """
    sensors = scenario.sensors
    if noise_ug_rthz is not None:
        accelerometer = dataclasses.replace(sensors.accelerometer, noise_density_ug_rthz=noise_ug_rthz)
        sensors = dataclasses.replace(sensors, accelerometer=accelerometer)
    period = scenario.plant.timestep_s or common_period(scenario)
    duration = math.ceil(window_of(scenario)[1] / period - 1e-9) * period
    feedback = scenario.controller.feedback
    if feedback == "observer" and needs(law_class(scenario.controller.kind)):
        feedback = "fog"
    loop = {"feedback": feedback, "bias_trim_s": 0.0}
    return scenario.model_copy(
        update={
            "duration_s": duration,
            "controller": scenario.controller.model_copy(update=loop),
            "observer": ObserverSettings(kind="finite_difference"),  # its angles are the measured ones
            "open_loop_observers": [],
            "sensors": sensors,
        }
    )


Wanted = tuple[Scenario, Sequence[int], float | None]
"""A scenario, the worlds' numbers, and another noise density of the accelerometers [ug/sqrt(Hz)]."""


def record_all(
    wanted: Sequence[Wanted], *, warm_up_s: float = WARM_UP_S, on_share: Callable[[float], None] | None = None
) -> list[Recorded]:
    """Run tuning experiments, those that can in one batch.

    Args:
        wanted: The scenarios, whose noise depends on (seed, world's number) alone; `tuning_scenario` says what is
            changed in them.
        warm_up_s: How much of the time before the window is kept [s].
        on_share: Called now and then with the share done.

    Returns:
        The worlds that stood, of each.

    Raises:
        InputError: Fewer than two did.
        KeyboardInterrupt: The user interrupted.
    """
    experiments = [prepare(tuning_scenario(scenario, noise)) for scenario, _, noise in wanted]
    runs = [BatchJob([each] * len(worlds), worlds) for each, (_, worlds, _) in zip(experiments, wanted, strict=True)]
    duration = max(each.scenario.duration_s for each in experiments)
    results = run_side_by_side(runs, on_progress=on_share and (lambda time: on_share(min(time / duration, 1.0))))
    return [_kept(*each, warm_up_s) for each in zip(wanted, experiments, results, strict=True)]


def _kept(wanted: Wanted, experiment: Experiment, result: Result, warm_up_s: float) -> Recorded:
    scenario, duration = wanted[0], experiment.scenario.duration_s
    if any(outcome.kind == "interrupted" for outcome in result.outcomes):
        raise KeyboardInterrupt
    stood = np.array([outcome.kind == "done" for outcome in result.outcomes])
    if stood.sum() < 2:
        raise InputError(
            f"{scenario.title or 'the scenario'}: with the law fed by the {experiment.scenario.controller.feedback}, "
            f"{len(stood) - stood.sum()} of {len(stood)} worlds fell before {duration:g} s: there is nothing to tune on"
        )
    window = window_of(scenario)
    assert result.trajectory is not None
    kept = result.trajectory.of_worlds(stood).between(window[0] - warm_up_s, window[1])
    return Recorded(kept, window, int((~stood).sum()), windows_of(scenario))


def record(
    scenario: Scenario,
    worlds: Sequence[int],
    *,
    noise_ug_rthz: float | None = None,
    warm_up_s: float = WARM_UP_S,
    on_share: Callable[[float], None] | None = None,
) -> Recorded:
    """The same for one experiment."""
    return record_all([(scenario, worlds, noise_ug_rthz)], warm_up_s=warm_up_s, on_share=on_share)[0]


def recorder(wanted: Sequence[Wanted], *, warm_up_s: float = WARM_UP_S) -> Callable[..., Recorded]:
    """Recordings made once, all that several calls of `tune` will ask for: it takes this as `recorded`.

    Args:
        wanted: The recordings; the observer takes no part in them.
        warm_up_s: How much of the time before the window is kept [s].

    Returns:
        What hands them out.
    """
    once = list({_key(*each): each for each in wanted}.values())
    kept = {_key(*each): made for each, made in zip(once, record_all(once, warm_up_s=warm_up_s), strict=True)}

    def recorded(scenario: Scenario, worlds: Sequence[int], *, noise_ug_rthz: float, warm_up_s: float) -> Recorded:
        return kept[_key(scenario, worlds, noise_ug_rthz)]

    return recorded


def halves(scenario: Scenario, worlds: int, noise_ug_rthz: Sequence[float]) -> list[Wanted]:
    """What `tune` records: worlds that are fitted and as many that are held out, at every noise."""
    spans = range(worlds), range(worlds, 2 * worlds)
    return [(scenario, span, density) for density in noise_ug_rthz for span in spans]


def _key(scenario: Scenario, worlds: Sequence[int], noise_ug_rthz: float | None) -> tuple:
    """What a recording depends on: the scenario that is recorded, whole, and the worlds."""
    return tuple(worlds), repr(tuning_scenario(scenario, noise_ug_rthz))
