"""Parameters tuned on logs, beside the given ones, in the closed loop of a scenario."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from cmg_mj.core.errors import InputError
from cmg_mj.features.replay.log import Log
from cmg_mj.features.tuning.parameters import ParameterValues, plain
from cmg_mj.results.intervals import CONFIDENCE, Interval, PairedVerdict, paired_verdict, ratio_interval
from cmg_mj.runs.experiment import prepare
from cmg_mj.runs.side_by_side import run_of, run_side_by_side
from cmg_mj.scenario.loading import load_scenario, parse_scenario
from cmg_mj.scenario.schema import ObserverSettings, Scenario
from cmg_mj.stages.push import push_windows

SCENARIO = "push_recovery"
"""The scenario by default."""
NO_LOOP = "none"
"""Name of no scenario: nothing is simulated."""
WORLDS = 16
USUAL_S = 5.0
"""The loop runs for so long, or until the scenario ends [s]; longer only if the second after a push ends later."""
RELEVANT = 1.01
"""A smaller ratio of two errors is no difference."""


def judged(ratio: Interval) -> PairedVerdict:
    """Judge a ratio, above 1 for the better: it must differ by more than 1 %, and beyond chance.

    Args:
        ratio: With its 95 % interval.
    """
    if 1.0 / RELEVANT <= ratio.mean <= RELEVANT:
        return "tie"
    return paired_verdict(Interval(*(value - 1.0 for value in ratio)))


@dataclass(frozen=True)
class LoopComparison:
    """A loop closed on the observer with the given parameters, and with the tuned ones.

    Attributes:
        scenario: Its title.
        duration_s: Simulated time [s].
        worlds: Number of worlds, the same noise in both loops.
        stood: Number of worlds that stood to the end, with the given and with the tuned parameters.
        stood_alone: Number of those that fell with the other parameters.
        ratio: RMS of the tilt, given by tuned, over the worlds that stood with both; None of fewer than two.
        refused: Why an observer could not be in this loop; empty if it could.
    """

    scenario: str
    duration_s: float
    worlds: int
    stood: tuple[int, int] = (0, 0)
    stood_alone: tuple[int, int] = (0, 0)
    ratio: Interval | None = None
    refused: str = ""

    @property
    def verdict(self) -> PairedVerdict | None:
        """Compare the tuned parameters with the given ones: by falls if these are beyond chance, else by the tilt."""
        if self.refused:
            return None
        given, tuned = self.stood_alone
        if _beyond_chance(given, tuned):
            return "better" if tuned > given else "worse"
        return "tie" if self.ratio is None else judged(self.ratio)

    @property
    def remark(self) -> str:
        """Describe the comparison in one line."""
        loop = f"In the closed loop of {self.scenario} ({self.worlds} worlds of {self.duration_s:g} s, its rig, sensors"
        loop += " and control rate)"
        if self.refused:
            return f"{loop} the parameters cannot be compared: {self.refused}."
        given, tuned = self.stood
        given_alone, tuned_alone = self.stood_alone
        line = f"{loop} the tuned parameters stand {tuned} times ({tuned_alone} where the given ones fall), "
        line += f"the given ones {given} ({given_alone} where the tuned ones fall)"
        if self.ratio is not None:
            line += "; RMS of the tilt, given / tuned, {:.3f} ({:.3f} to {:.3f})".format(*self.ratio)
        words = {"better": "better there", "worse": "WORSE there", "tie": "not different there beyond chance"}
        return f"{line}: the tuned ones are {words[self.verdict or 'tie']}."


def _beyond_chance(one: int, other: int) -> bool:
    """Return whether worlds that stood with one set alone and with the other alone differ by the sign test, 5 %."""
    n, fewer = one + other, min(one, other)
    return 2.0 * sum(math.comb(n, k) for k in range(fewer + 1)) / 2.0**n < 1.0 - CONFIDENCE


def loop_scenario(name: str | None, log: Log) -> Scenario | None:
    """Return the scenario whose loop is closed.

    Args:
        name: A bundled scenario or a file; None for the scenario of a run's own recording, else `SCENARIO`.
        log: The log.

    Returns:
        The scenario; None if it is `NO_LOOP`.

    Raises:
        InputError: There is no such scenario, or it is wrong.
    """
    if name == NO_LOOP:
        return None
    if name is None and log.scenario is not None:
        return parse_scenario(dict(log.scenario), log.name)
    try:
        return load_scenario(name or SCENARIO, [])
    except InputError as error:
        raise InputError(f"--closed-loop: {error}") from None


def compare_in_loop(
    scenario: Scenario, kind: str, given: ParameterValues, tuned: ParameterValues, *, worlds: int = WORLDS
) -> LoopComparison:
    """Close the loop of a scenario on an observer with two sets of parameters, on the same worlds.

    Args:
        scenario: The scenario, which is cut short.
        kind: The observer.
        given: The parameters before.
        tuned: The parameters after.
        worlds: Number of worlds.

    Returns:
        The comparison.
    """
    calm = max((end for _, end in push_windows(scenario.push)), default=0.0)  # a second after the last push
    duration = min(scenario.duration_s, max(USUAL_S, float(math.ceil(calm))))
    loop = scenario.model_copy(
        update={
            "duration_s": duration,
            "open_loop_observers": [],
            "controller": scenario.controller.model_copy(update={"feedback": "observer", "bias_trim_s": 0.0}),
        }
    )
    title = scenario.title or "the scenario"
    try:
        experiments = [
            prepare(loop.model_copy(update={"observer": ObserverSettings(kind=kind, **parameters)}))
            for parameters in (plain(given), plain(tuned))
        ]
        for experiment in experiments:
            experiment.require_single_axis("tune-log")
    except InputError as error:
        return LoopComparison(title, duration, worlds, refused=str(error))
    results = run_side_by_side([run_of(experiment, worlds) for experiment in experiments], keep_trajectory=False)
    if any(outcome.kind == "interrupted" for result in results for outcome in result.outcomes):
        raise KeyboardInterrupt
    tilts = [result.values("tilt_rms_deg") for result in results]
    both = np.isfinite(tilts[0]) & np.isfinite(tilts[1])
    ratio = ratio_interval(tilts[0][both], tilts[1][both]) if both.sum() >= 2 else None
    given_stood, tuned_stood = (result.stood for result in results)
    stood = int(given_stood.sum()), int(tuned_stood.sum())
    alone = int((given_stood & ~tuned_stood).sum()), int((tuned_stood & ~given_stood).sum())
    return LoopComparison(title, duration, worlds, stood, alone, ratio)
