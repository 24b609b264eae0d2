"""The nine claims of the papers that are not reproduced, each in all readings that its row of docs/reproduced.md names.

    python docs/studies/claims_not_reproduced.py [--claim ID] (about six minutes)

A table a claim: a row is a reading of what the paper leaves open, with the figures that the claim compares.
"""

from __future__ import annotations

import argparse
import itertools
import json
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from cmg_mj.papers.andrieu2009 import bioreactor, figures
from cmg_mj.papers.aranovskiy2020 import riccati, section_5
from cmg_mj.papers.claim import Array, Claim
from cmg_mj.papers.dao2023 import figures as arm
from cmg_mj.papers.pair import DT, push_recovery
from cmg_mj.papers.sokolov2019 import backlash, figure_3
from cmg_mj.papers.sokolov2019 import section_5 as gimbal
from cmg_mj.papers.sokolov2019.rig import NO_NOISE
from cmg_mj.results.tables import markdown_table
from cmg_mj.runs.side_by_side import BatchJob, run_jobs


class Reading(NamedTuple):
    """One setting, the figures by heading, and whether the claim holds there."""

    setting: str
    figures: dict[str, Any]
    holds: bool


# --- aranovskiy2020 ---------------------------------------------------------------------------------------------


def cost() -> Iterator[Reading]:
    """Judge Remark 1 by the recorded instructions of an update."""
    board = json.loads(riccati.RECORDED.read_text(encoding="utf-8"))
    one_step, rk4 = (board[name] for name in riccati.PLAIN)
    compared = [(f"{name}, against (11)", board[name], board["homogeneous"]) for name in ("ltv", *riccati.PLAIN)]
    # A second step costs what the first does, of which an update by Euler, all in all, is more than the rest.
    compared.append(
        ("two Runge-Kutta 4 steps a sample, at least, against (11)", 2 * rk4 - one_step, board["homogeneous"])
    )
    compared.append(("ltv, against (9)", board["ltv"], board["linear"]))
    compared.append(("ltv, against the sample period", board["ltv"], round(1e6 * DT * riccati.CLOCK_MHZ)))
    for setting, own, other in compared:
        yield Reading(setting, {"instructions": own, "against": other, "quotient": own / other}, own > other)


PUSHES_N_M, BIASES_DEG, NOISES = (0.05, 0.1, 0.25, 0.5, 1.0), (0.0, 0.5), (100.0, 400.0, 1600.0)
TILT = "tilt_rms_deg"


def tilt_order() -> Iterator[Reading]:
    """Judge Section V's order by the tilt, over pushes, biases and noises; ten worlds each."""
    settings = list(itertools.product(NOISES, PUSHES_N_M, BIASES_DEG))
    fields = ("sensors.accelerometer.noise_density_ug_rthz", "push.0.torque_n_m", "equilibrium_bias_deg")
    varied = {field: np.repeat(values, 10) for field, values in zip(fields, zip(*settings, strict=True), strict=True)}
    names = [f"{noise:g} ug/rtHz, {push:g} N m, e = {e:g} deg" for noise, push, e in settings]
    numbers: dict[str, Any] = {angles: {name: {} for name in names} for angles in section_5.ANGLES}
    for angles, observer in itertools.product(numbers, section_5.OBSERVERS):
        loop = push_recovery(observer, section_5.SEED, [f"controller.angle_source={angles}"]).with_varied(varied)
        jobs = [BatchJob(loop[i : i + 10], range(10)) for i in range(0, len(loop), 10)]
        for name, result in zip(names, run_jobs(jobs, keep_trajectory=False), strict=True):
            numbers[angles][name][observer] = result.values(TILT)
    claim = section_5.order(TILT, numbers)
    for name in names:
        shown = {
            key.replace("_", " ").replace(" angles tilt rms deg", " [deg]"): of[name]
            for key, of in claim.figures.items()
        }
        yield Reading(name, shown, claim.measures[name])


# --- sokolov2019 ------------------------------------------------------------------------------------------------


def y2() -> Iterator[Reading]:
    """Judge whether (9) misses the push because it ignores y2."""
    for quiet, push, e in itertools.product((False, True), (0.1, 0.25, 0.5, 1.0), (-0.25, 0.0, 0.5, 1.0)):
        settings = [f"push.0.torque_n_m={push}", f"plant.equilibrium_bias_deg={e}", *NO_NOISE * quiet]
        tuning = figure_3.tuning_experiment(10, settings=settings)
        without, with_y2 = (tuning.relative_errors[name].mean for name in ("luenberger", figure_3.WITH_Y2))
        compared = {"error without y2": without, "with y2": with_y2, "taken away": 1.0 - with_y2 / without}
        holds = all(figure_3.ignores_y2(tuning, tuning.relative_errors).measures.values())
        yield Reading(f"{push:g} N m, e = {e:g} deg" + ", no noise" * quiet, compared, holds)


def oscillation() -> Iterator[Reading]:
    """Judge whether the linearisation makes (9) oscillate."""
    gap, late = "plant.gimbal_backlash_arcmin", "sensors.accelerometer.latency_s"
    settings: dict[str, dict[str, float]] = {f"gap of {of:g} arcmin": {gap: of} for of in (0.0, 5.0, 10.0, 20.0, 40.0)}
    settings |= {f"gap of 20 arcmin, e = {e:g} deg": {"plant.equilibrium_bias_deg": e} for e in (0.1, 0.25)}
    settings |= {
        "gap of 20 arcmin, let go 2 deg off": {"plant.initial_tilt_deg": 2.0, "duration_s": 36.0},
        "y1 50 ms late": {gap: 0.0, late: 0.05},
    }
    nine = {"k1": figure_3.L1, "k2": figure_3.stiffness(gimbal.experiment().plant.reduced), "alpha": 1.0}
    both = backlash.make_release("luenberger"), backlash.make_release("homogeneous", **nine)
    cycles = backlash.find_cycles([release.with_settings(of) for of in settings.values() for release in both])
    for setting, without, with_y2 in zip(settings, cycles[::2], cycles[1::2], strict=True):
        ends = backlash.Cycles({"luenberger": without, figure_3.WITH_Y2: with_y2}, {})
        compared = {"tilt of (9) [deg]": without.amplitude_deg, "with all terms [deg]": with_y2.amplitude_deg}
        goes_on = {"(9) oscillates": without.sustained}
        yield Reading(setting, compared | goes_on, bool(gimbal.cause_of_figure_5(ends).holds))


# --- dao2023 ----------------------------------------------------------------------------------------------------

SIGMAS = (0.1, 10.0, 100.0, 300.0, 1000.0, 3000.0, 10_000.0)


def gain() -> Iterator[Reading]:
    """Judge whether a larger Sigma settles sooner: median times of ten motions [s]."""
    for rate in (400, 800):
        t = np.arange(200 * rate + 1) / rate
        errors = arm.follow(arm.make_proposed(1.0 / rate, *SIGMAS), t, arm.motion(arm.starts(0, 10), t))
        sizes = {"theta and d": errors.exogenous, "the state": errors.state}
        for (of, error), band in itertools.product(sizes.items(), (0.01, 0.1, 1.0)):
            medians = np.median(arm.settle_times(np.linalg.norm(error, axis=-1), t, band), axis=-1)
            compared = {
                f"Sigma = {sigma:g}" + " [s]" * (sigma < 1.0): time for sigma, time in zip(SIGMAS, medians, strict=True)
            }
            yield Reading(f"{of} into {band:g}, {rate} Hz", compared, bool((medians[1:] <= medians[:-1]).all()))


# --- andrieu2009 ------------------------------------------------------------------------------------------------


def bounds() -> Iterator[Reading]:
    """Judge Omega_2 <= Omega_1 over hbar."""
    for hbar in (0.6, 0.7, 0.8, 0.9, 1.0, 1.2, 1.5):
        found = bioreactor.increments_over_domain(hbar)
        shown = {"largest Omega_2/Omega_1 - 1": found["Omega2_over_Omega1_ratio"] - 1.0}
        shown["share of points above 1"] = found["share_Omega2_above_Omega1_ratio"]
        yield Reading(f"hbar = {hbar:g}", shown, found["Omega2_over_Omega1_ratio"] <= 1.0 + bioreactor.ROUNDING)


SEEDS = range(figures.SEEDS)


def noise() -> Iterator[Reading]:
    """Judge the noise, said to be a tenth of a range, and Fig. 2's order with each."""
    visited = figures.run_plant(SEEDS)
    tenth_visited = 0.1 * float(np.ptp(visited.eta[0][visited.t > 5.0], axis=0).mean())
    tenths = {"of the domain of eta1": figures.LOUD, "of the range that it visits after t = 5": tenth_visited}
    for setting, level in tenths.items():
        run = figures.run_plant(SEEDS, level)
        by_kind = figures.replays(run, bioreactor.Bioreactor(bioreactor.HBAR_OF_OBSERVERS))
        share = figures.share_in_order(figures.rms_by_kind(run, by_kind))
        shown = {"a tenth": level, "noise printed": bioreactor.NOISE, "seeds in Fig. 2's order": share}
        yield Reading(setting, shown, abs(level - bioreactor.NOISE) < 0.005)


@cache
def bias_study(period: float) -> figures.Study:
    """Replay the observers with the wrong and the true hbar, the noise renewed after a period; 0 for none."""
    run = figures.run_plant(SEEDS, 0.0, min(period or 1.0, figures.NOISE_PERIOD))
    if period:
        drawn = round(figures.DURATION / period) + 1
        for seed, y in zip(SEEDS, run.y.T, strict=True):
            rng = np.random.default_rng(seed)
            rng.dirichlet((1.0, 1.0, 1.0), 2)  # the starts, as `run_plant` draws them
            y += bioreactor.NOISE * np.interp(run.t, np.arange(drawn) * period, rng.normal(size=drawn))
    wrong, true = (
        figures.replays(run, bioreactor.Bioreactor(hbar)) for hbar in (bioreactor.HBAR_OF_OBSERVERS, bioreactor.HBAR)
    )
    return figures.Study(run, wrong, {}, {}, true, run.y)


def biases(judge: Callable[[figures.Study], Claim], kinds: slice) -> Iterator[Reading]:
    """Judge whether the error of hbar makes the bias, in the four windows."""
    for period in (1e-3, 0.01, 0.1, 1.0, 0.0):
        study = bias_study(period)
        whole = figures.by_window(study, study.nominal, "eta2_error")[kinds], figures.bias_left(study)[kinds]
        shown: dict[str, Array] = {}
        for kind, bias, left in zip(figures.KINDS[kinds], *whole, strict=True):
            shown |= {f"bias, {kind}": bias, f"share left, {kind}": left}
        setting = f"noise renewed every {period:g}" if period else "no noise"
        yield Reading(setting, shown, bool(judge(study).holds))


# --- all of them ------------------------------------------------------------------------------------------------

CLAIMS: dict[str, Callable[[], Iterator[Reading]]] = {
    "aranovskiy2020-cost": cost,
    "aranovskiy2020-tilt-order": tilt_order,
    "sokolov2019-y2": y2,
    "sokolov2019-oscillation": oscillation,
    "dao2023-gain": gain,
    "andrieu2009-bounds": bounds,
    "andrieu2009-noise": noise,
    "andrieu2009-bias-constant": lambda: biases(figures.bias_of_constant_gain, slice(1)),
    "andrieu2009-bias-updated": lambda: biases(figures.bias_of_updated_gains, slice(1, 3)),
}


def cell(value: Any) -> str:
    """Write a figure to four digits, or several."""
    if isinstance(value, (Sequence, np.ndarray)):
        return ", ".join(map(cell, value))
    return str(value) if isinstance(value, int | bool | np.bool_) else f"{value:.4g}"


def main() -> None:
    """Print a table a claim."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--claim", choices=CLAIMS, help="only this one")
    only = parser.parse_args().claim
    for name, readings in CLAIMS.items():
        if only in (None, name):
            found = list(readings())
            rows = [(of.setting, *map(cell, of.figures.values()), "holds" if of.holds else "fails") for of in found]
            print(f"## {name}\n\n{markdown_table(('reading', *found[0].figures, 'claim'), rows)}\n", flush=True)


if __name__ == "__main__":
    main()
