"""The observers of aranovskiy2020 tuned again as its Section V does: fitted to the gyro, scored on other seeds."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from cmg_mj.features.tuning import NoiseLevelResult, Recorded, TuningResult, halves, recorder, tune
from cmg_mj.papers.aranovskiy2020.rig import push_recovery
from cmg_mj.papers.claim import OnShare
from cmg_mj.results.intervals import Interval, ratio_interval
from cmg_mj.runs.side_by_side import run_of, run_side_by_side
from cmg_mj.scenario.loading import load_scenario
from cmg_mj.scenario.schema import Scenario

SEED = 74_000
WORLDS = 12
DEFAULT_NOISE = 400.0
WARM_UP_S = 0.5
"""Replayed before the window [s]: many times the time constants of the three."""


@dataclass(frozen=True)
class Push:
    """One push on one rig, recorded at several sensor noises.

    Attributes:
        words: Its name in the report.
        settings: Settings `section.field=value` of the tuning experiment that differ.
        noise_ug_rthz: Noise densities [ug/sqrt(Hz)], the same for every observer.
        share: Share of the time that all take.
    """

    words: str
    settings: Sequence[str]
    noise_ug_rthz: Sequence[float]
    share: float


def _gentle(torque_n_m: float) -> list[str]:
    """Return a weaker push on a rig without bias, of which (11) has less to learn."""
    return [f"push.0.torque_n_m={torque_n_m}", "plant.equilibrium_bias_deg=0.0"]


STRONG = Push("1 N m, e = 0.5 deg", [], (100.0, 200.0, DEFAULT_NOISE, 3200.0), 0.45)
"""The push of Figs 5 to 7."""
PUSHES = (
    STRONG,
    Push("0.3 N m, e = 0", _gentle(0.3), (100.0, 200.0, DEFAULT_NOISE), 0.33),
    Push("0.1 N m, e = 0", _gentle(0.1), (25.0, 50.0), 0.22),
)


@dataclass(frozen=True)
class Tuning:
    """The parameters of an observer that are tuned.

    Attributes:
        observer: Its name.
        equation: Its number in the paper.
        parameters: Parameters that are tuned.
        table_line: Table 2's line.
        share: Share of the time that the three take.
    """

    observer: str
    equation: str
    parameters: Sequence[str]
    table_line: str
    share: float


LINEAR = Tuning("linear", "(9)", ["tau"], "tau = 0.02", 0.15)
LTV = Tuning("ltv", "(10)", ["Q[1]"], "Q = diag(1, 5e6, 1)", 0.4)
HOMOGENEOUS = Tuning("homogeneous", "(11)", ["k1", "k2", "alpha"], "[k1, k2, alpha] = [20, 150, 0.85]", 0.45)
CASES = (LINEAR, LTV, HOMOGENEOUS)

Studies = Mapping[str, Mapping[str, TuningResult]]
"""Words of the push -> observer -> its study."""


def _scenario(case: Tuning, push: Push, seed: int) -> Scenario:
    return load_scenario("observer_tuning", [f"seed={seed}", *push.settings], case.observer)


def tune_case(
    case: Tuning,
    push: Push,
    seed: int,
    worlds: int,
    recorded: Callable[..., Recorded] | None = None,
    on_share: OnShare | None = None,
) -> TuningResult:
    """Tune one observer on the recordings of one push, as many worlds fitted as held out."""
    return tune(
        _scenario(case, push, seed),
        worlds=worlds,
        parameters=case.parameters,
        noise_ug_rthz=push.noise_ug_rthz,
        warm_up_s=WARM_UP_S,
        starts=1,
        recorded=recorded,
        on_share=on_share,
    )


def all_studies(
    seed: int, worlds: int, on_share: OnShare, pushes: Sequence[Push] = PUSHES, cases: Sequence[Tuning] = CASES
) -> dict[str, dict[str, TuningResult]]:
    """Tune every observer on the same recordings of every push."""
    studies: dict[str, dict[str, TuningResult]] = {}
    recordings = [half for p in pushes for half in halves(_scenario(cases[0], p, seed), worlds, p.noise_ug_rthz)]
    recorded, share_done = recorder(recordings, warm_up_s=WARM_UP_S), 0.0
    for push in pushes:
        studies[push.words] = {}
        for case in cases:
            case_share = push.share * case.share

            def share(part: float, before: float = share_done, case_share: float = case_share) -> None:
                on_share(before + part * case_share)

            studies[push.words][case.observer] = tune_case(case, push, seed, worlds, recorded, share)
            share_done += case_share
    return studies


def level_at(study: TuningResult, noise_ug_rthz: float) -> NoiseLevelResult:
    """Return the level of one noise."""
    return next(level for level in study.levels if level.noise_ug_rthz == noise_ug_rthz)


def beats_zero(level: NoiseLevelResult) -> bool:
    """Return true if the tuned observer is closer to the gyro than an estimate of zero, on the held-out worlds."""
    return float(level.rms.mean()) < level.zero_rms


def loop_ratios(trials: Sequence[tuple[Tuning, NoiseLevelResult, Push]], worlds: int, seed: int) -> list[Interval]:
    """Velocity RMS error in the closed loop, Table 2's by the tuned, world by world, under that push and noise."""
    runs = []
    for case, level, push in trials:
        noise = f"sensors.accelerometer.noise_density_ug_rthz={level.noise_ug_rthz}"
        names = dict.fromkeys(name.partition("[")[0] for name in level.sizes)
        tuned_settings = [f"observer.{name}={json.dumps(level.parameters[name])}" for name in names]
        for settings in ([], tuned_settings):
            runs.append(run_of(push_recovery(case.observer, seed, [*push.settings, noise, *settings]), worlds))
    errors = [result.values("velocity_rms_error_rad_s") for result in run_side_by_side(runs, keep_trajectory=False)]
    return [ratio_interval(table, tuned) for table, tuned in zip(errors[::2], errors[1::2], strict=True)]
