"""Fig. 2: the error of eta2 that each observer leaves, its bias and its spread."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import uniform_filter1d
from scipy.stats import spearmanr

from cmg_mj.papers.andrieu2009.simulation import (
    CONSTANT,
    KINDS,
    TIME,
    WINDOWS,
    Replay,
    Run,
    window_means,
    window_spreads,
)
from cmg_mj.papers.andrieu2009.study import ASSUMED, Study, rms_by_kind
from cmg_mj.papers.claim import Claim
from cmg_mj.view.plots.figure import Line, Panel, Picture

LEAST_SEEDS = 0.95
"""Share of the seeds in which an order must hold."""
WINDOW_NAMES = [f"t = {start:g} to {end:g}" for start, end in WINDOWS]
HALF = 0.5
"""A bias is due to the error in hbar if less than this share is left without that error."""
STRONG = 0.7
"""A rank correlation above this is called strong."""


def share_in_order(rms: np.ndarray) -> float:
    """Return the share of the seeds in which constant > updated > updated and homogeneous."""
    return float((np.diff(rms, axis=0) < 0.0).all(axis=0).mean())


def figure_2(study: Study) -> Claim:
    """Judge the estimation errors."""
    rms, loud = rms_by_kind(study.run, study.nominal), rms_by_kind(study.run, study.loud)
    share, share_loud = share_in_order(rms), share_in_order(loud)
    means, loud_means = rms.mean(axis=1), loud.mean(axis=1)
    remark = (
        "Initial values are not given: the plant's and the observers' are drawn from M_eta for each seed, and the "
        "error is counted from t = 5. The noise is a new value every 10 ms, running straight in between. The "
        "third is best because of Omega_2, not of the homogeneous correction (see the claim on the correction)."
    )
    return Claim(
        place="Fig. 2",
        statement="The observer with Omega_2 and homogeneity gives the best estimate of eta2, the updated gain with "
        "Omega_1 the second, the constant gain the worst.",
        assumes=ASSUMED,
        holds=share >= LEAST_SEEDS,
        conditions=remark,
        otherwise=remark,
        figures={
            "rms_error_eta2": dict(zip(KINDS, means.tolist(), strict=True)),
            "rms_error_eta2_standard_deviation": dict(zip(KINDS, rms.std(axis=1, ddof=1).tolist(), strict=True)),
            "share_of_seeds_in_order": share,
            "rms_error_eta2_with_10_percent_noise": dict(zip(KINDS, loud_means.tolist(), strict=True)),
            "share_of_seeds_in_order_with_10_percent_noise": share_loud,
        },
        pictures=[_picture(study)],
    )


def _picture(study: Study) -> Picture:
    mean_of_first = running_mean(study.run.t, study.nominal[CONSTANT].eta2_error[:, 0])
    return Picture(
        "andrieu2009-fig-2",
        "andrieu2009, Fig. 2: error of eta2 given by each observer (one seed; black in (a): running mean over 1)",
        [
            Panel(
                "eta2 error [-]",
                [
                    Line(study.run.t, study.nominal[kind].eta2_error[:, 0], kind, color=i, width=0.8 if i else 0.25),
                    *([] if i else [Line(study.run.t, mean_of_first, "mean over 1", "k-")]),
                ],
                f"({'abc'[i]})",
                TIME,
                y_range=(-0.3, 0.8),
            )
            for i, kind in enumerate(KINDS)
        ],
    )


def running_mean(t: np.ndarray, values: np.ndarray, span: float = 1.0) -> np.ndarray:
    """Return the mean over a span of time about each sample, (n,)."""
    return uniform_filter1d(values, max(1, round(span / float(t[1] - t[0]))), mode="nearest")


def biases(run: Run, replays: dict[str, Replay]) -> np.ndarray:
    """Return the mean error of eta2, (3 observers, 4 windows)."""
    return np.array([window_means(run, replays[kind].eta2_error).mean(axis=1) for kind in KINDS])


def bias(study: Study) -> Claim:
    """Judge the order of the biases in Fig. 2."""
    noisy, quiet = biases(study.run, study.nominal), biases(study.quiet_run, study.quiet)
    in_order = [(np.diff(values, axis=0) <= 0.0).all(axis=0) for values in (noisy, quiet)]
    return Claim(
        place="Section 3.1, bias in Fig. 2",
        statement="The larger an observer's estimate of the rate, the larger the bias of its error.",
        assumes=ASSUMED,
        holds=bool(np.all(in_order)),
        otherwise="The means are not in order in every window.",
        figures={"bias_eta2": noisy.tolist(), "bias_eta2_without_noise": quiet.tolist()},
    )


def bias_left(study: Study) -> np.ndarray:
    """Return the share of the bias that is left where the observers know hbar, (3 observers, 4 windows)."""
    return np.abs(biases(study.run, study.exact) / biases(study.run, study.nominal))


def bias_of_constant_gain(study: Study) -> Claim:
    """Judge the cause of the constant gain's bias."""
    shares_left = bias_left(study)[0]
    return Claim(
        place="Section 3.1, bias of the constant gain",
        statement="The bias of the observer with constant gain in Fig. 2 is due to the error in hbar.",
        assumes={**ASSUMED, "threshold": "due to it if less than half is left"},
        holds=dict(zip(WINDOW_NAMES, (shares_left < HALF).tolist(), strict=True)),
        otherwise="It is made by the noise, which sends the estimate from end to end of the domain, where the limits "
        "cut off one side more than the other.",
        figures={"share_left_with_exact_hbar": shares_left.tolist()},
    )


def bias_of_updated_gains(study: Study) -> Claim:
    """Judge the cause of the biases of the two observers with updated gain."""
    shares_left = bias_left(study)[1:]
    due = np.all(shares_left < HALF, axis=0).tolist()
    windows = [name for name, is_due in zip(WINDOW_NAMES, due, strict=True) if is_due]
    other_windows = [name for name, is_due in zip(WINDOW_NAMES, due, strict=True) if not is_due]
    return Claim(
        place="Section 3.1, bias of the updated gains",
        statement="The biases of the observers with updated gain in Fig. 2 are due to the error in hbar.",
        assumes={**ASSUMED, "threshold": "due to it if less than half is left"},
        holds=dict(zip(WINDOW_NAMES, due, strict=True)),
        otherwise=f"Less than half remains for both in {', '.join(windows)}; not in {', '.join(other_windows)}, where "
        "the bias itself is small."
        if windows
        else "Half of it or more remains in every window.",
        figures={"share_left_with_exact_hbar": dict(zip(KINDS[1:], shares_left.tolist(), strict=True))},
    )


def spread_correlation(study: Study) -> tuple[np.ndarray, np.ndarray, float, float]:
    """Return the standard deviation of the errors beside the estimates used.

    Returns:
        Spreads (3 observers, 4 windows), rates (3, 4), the rank correlation over all twelve, the least over the three
        observers of one window.
    """
    spreads = np.array([window_spreads(study.run, study.nominal[kind].eta2_error).mean(axis=1) for kind in KINDS])
    rates = np.array([window_means(study.run, study.nominal[kind].rate).mean(axis=1) for kind in KINDS])

    def correlation(a: np.ndarray, b: np.ndarray) -> float:
        return float(np.asarray(spearmanr(a.round(6), b)[0]))

    least_in_a_window = min(correlation(rates[:, i], spreads[:, i]) for i in range(len(WINDOWS)))
    return spreads, rates, correlation(rates.ravel(), spreads.ravel()), least_in_a_window


def spread(study: Study) -> Claim:
    """Judge the thickness of the curves in Fig. 2."""
    spreads, rates, overall, in_window = spread_correlation(study)
    ratio = spreads[:, [0, 2]].mean() / spreads[:, [1, 3]].mean()
    remark = (
        "Across the observers of one window. Across windows the input matters as much: at large u the spread is "
        f"{ratio:.0f} times that at small u, since eta2 follows more steeply from x2 there."
    )
    return Claim(
        place="Section 3.1, standard deviation in Fig. 2",
        statement="The larger an observer's estimate of the rate, the more its error scatters.",
        assumes=ASSUMED,
        holds=in_window >= STRONG and overall > 0.0,
        conditions="" if overall >= STRONG else remark,
        otherwise=remark,
        figures={
            "error_standard_deviation_eta2": spreads.tolist(),
            "estimate_mean_per_time": rates.tolist(),
            "rank_correlation_over_all": overall,
            "least_rank_correlation_in_a_window": in_window,
        },
    )
