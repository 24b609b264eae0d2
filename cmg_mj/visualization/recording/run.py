"""A run to record, and its torques, phases and poses in time."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field

import numpy as np

from cmg_mj.plant.plant import Plant
from cmg_mj.results.result import Outcome
from cmg_mj.results.trajectory import Trajectory
from cmg_mj.scenario.schema import MetricsSettings
from cmg_mj.stages.push import Push
from cmg_mj.stages.swing import Swing
from cmg_mj.visualization.plots.readability import Summary, figures_by_observer, observers_to_draw, section

POSE_RATE_HZ = 100.0
"""Largest rate at which poses are recorded; the eye needs no more."""

BALANCING, PUSH, RECOVERING, SETTLED = "balancing", "push", "recovering", "settled"
ENDINGS = {"fell": "fallen", "stopped": "stopped", "interrupted": "interrupted"}
"""Kind of the outcome of a run that did not reach its end -> the run's last phase."""


@dataclass(frozen=True)
class RecordingHeader:
    """The experiment of a recording's runs, known before the first tick.

    Attributes:
        plant: The plant of all runs.
        title: The experiment's title.
        pushes: Torques from outside, the same in all runs.
        swings: Sinusoidal torques from outside, the same in all runs.
        settings: The settle band.
        rate_limit_rad_s: Largest gimbal rate; None to leave its bounds away [rad/s].
        scenario_toml: The resolved scenario.
    """

    plant: Plant
    title: str = ""
    pushes: Sequence[Push] = ()
    swings: Sequence[Swing] = ()
    settings: MetricsSettings = field(default_factory=MetricsSettings)
    rate_limit_rad_s: float | None = None
    scenario_toml: str = ""


@dataclass(frozen=True)
class Run:
    """A run to record.

    Attributes:
        name: Name of the run's branch in the recording, usually the observer in the loop.
        trajectory: One world's ticks, columns (n_ticks,).
        summary: The run's numbers, by the names that `--json` prints.
        outcome: The outcome.
        axis: The axis of trajectory and numbers, if the plant has several.
    """

    name: str
    trajectory: Trajectory
    summary: Summary
    outcome: Outcome
    axis: str | None = None

    @property
    def observers(self) -> dict[str, Summary]:
        """The observer in the loop, then the open-loop observers, each with its numbers."""
        return figures_by_observer(self.trajectory.observers, self.summary)

    @property
    def ranking(self) -> Summary:
        """The numbers that rank the run: a run that did not reach its end ranks last."""
        return {**self.summary, "fell": self.outcome.kind in ENDINGS}

    @property
    def references(self) -> dict[str, Summary]:
        """The baselines, each with its numbers."""
        references = section(self.summary, "references")
        return {name: section(references, name) for name in references}

    @property
    def open_loop_observers(self) -> tuple[str, ...]:
        """The open-loop observers."""
        return self.trajectory.observers[1:]


def best_observers(run: Run, names: Collection[str] | None = None) -> list[str]:
    """Choose the observer in the loop and the best open-loop observers; only from `names`, unless it is None."""
    summaries = {name: summary for name, summary in run.observers.items() if names is None or name in names}
    return observers_to_draw(summaries, always=[name for name in run.trajectory.observers[:1] if name in summaries])


def torque_steps(pushes: Sequence[Push], end_s: float) -> list[tuple[float, float]]:
    """Add pushes up to the steps of one torque.

    Args:
        pushes: The pushes, which may overlap.
        end_s: End of the run; later steps are discarded [s].

    Returns:
        (time [s], torque from then on [N m]), in order of time.
    """
    edges = sorted({time for push in pushes for time in (push.start_s, push.end_s) if time < end_s})
    return [(t, sum(p.torque_n_m for p in pushes if p.start_s <= t < p.end_s)) for t in edges]


def largest_torque(pushes: Sequence[Push]) -> float:
    """Return the largest torque that ever acts, the scale of the arrows [N m]."""
    return max((abs(torque) for _, torque in torque_steps(pushes, math.inf)), default=0.0)


def phases(run: Run, pushes: Sequence[Push], settings: MetricsSettings) -> list[tuple[float, str]]:
    """Divide a run into phases.

    Before the first push the phase is `balancing`. After a push (or from the start, if there is no push) the phase is
    `recovering` until the tilt stays inside the settle band up to the next push or the end. Then it is `settled`.

    Args:
        run: The run.
        pushes: Torques from outside.
        settings: The settle band.

    Returns:
        (time [s], name of the phase from then on), in order of time.
    """
    end = run.outcome.time_s
    steps = [(0.0, BALANCING)] if pushes and min(p.start_s for p in pushes) > 0.0 else []
    starts = sorted(push.start_s for push in pushes)
    steps += [(start, PUSH) for start in starts]
    for push_end in sorted({push.end_s for push in pushes}) if pushes else [0.0]:
        if any(p.start_s <= push_end < p.end_s for p in pushes):
            continue  # another push is still on
        next_push = min((start for start in starts if start >= push_end), default=end)
        steps += _recovery(run.trajectory, push_end, min(next_push, end), math.radians(settings.settle_band_deg))
    steps = sorted((time, name) for time, name in steps if time < end)
    steps = [step for i, step in enumerate(steps) if i == 0 or step[1] != steps[i - 1][1]]
    if run.outcome.kind in ENDINGS:
        steps.append((end, ENDINGS[run.outcome.kind]))
    return steps


def _recovery(trajectory: Trajectory, start: float, end: float, band: float) -> list[tuple[float, str]]:
    """Return the steps `recovering` and `settled` between two pushes."""
    time = trajectory["time_s"]
    window = (time >= start - 1e-9) & (time < end - 1e-9)
    if not window.any():
        return [(start, RECOVERING)]
    times = time[window]
    excursions = np.flatnonzero(np.abs(trajectory["x1_rad"][window]) > band)
    settle_index = int(excursions[-1]) + 1 if excursions.size else 0
    steps = [(start, RECOVERING)] if settle_index > 0 else []
    if settle_index < len(times):
        steps.append((max(start, float(times[settle_index])), SETTLED))
    return steps


def pose_stride(dt: float) -> int:
    """Return the number of ticks, dt [s] apart, from one recorded pose to the next."""
    return max(1, round(1.0 / (POSE_RATE_HZ * dt)))


def pose_ticks(trajectory: Trajectory) -> np.ndarray:
    """Choose the ticks at which poses are recorded, (n_poses,); none, if there is no tick."""
    n = len(trajectory)
    if n == 0:
        return np.zeros(0, dtype=int)
    time = trajectory.rows(slice(2))["time_s"]
    return np.union1d(np.arange(0, n, pose_stride(time[1] - time[0]) if n > 1 else 1), n - 1)


def poses_at(plant: Plant, trajectory: Trajectory, ticks: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the poses at some ticks; the initial pose, if the run has no tick.

    Args:
        plant: The plant.
        trajectory: The run's trajectory.
        ticks: The ticks, (n_poses,).

    Returns:
        Times, (n_poses,) [s], and joint angles, (n_poses, n_joints) [rad].
    """
    if len(trajectory) == 0:
        return np.zeros(1), plant.new_data().qpos[None].copy()
    return trajectory["time_s"][ticks], trajectory.qpos(ticks)
