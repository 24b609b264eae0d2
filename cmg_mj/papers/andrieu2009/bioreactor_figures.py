"""Figs 1 and 2 of andrieu2009, what its text says of them, and what the correction contributes to them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.ndimage import uniform_filter1d
from scipy.stats import spearmanr

from cmg_mj.papers.andrieu2009.bi_limit import largest_b
from cmg_mj.papers.andrieu2009.bioreactor import Bioreactor
from cmg_mj.papers.andrieu2009.bioreactor_study import (
    CONSTANT,
    HBAR,
    HBAR_OF_OBSERVERS,
    HOMOGENEOUS,
    NOISE,
    PHI1,
    PHI2,
    PHI3,
    UPDATED,
    WINDOWS,
    B,
    P,
    Replay,
    Run,
    copy_errors,
    incremental_rate,
    of_seeds,
    replay,
    replays,
    rms_late,
    run_plant,
    window_means,
    window_spreads,
)
from cmg_mj.papers.claim import Claim, OnShare
from cmg_mj.picture import Line, Panel, Picture

SEEDS = 20
LOUD = 0.0986
"""10 % of the domain of eta1, which the paper takes for 0.05."""
LEAST_SEEDS = 0.95
"""Share of the seeds in which an order must hold."""
STRONG = 0.7
"""A rank correlation above this is called strong."""
TIME = "time [normalised]"


class Study(NamedTuple):
    """All simulations of the bioreactor: columns are seeds."""

    run: Run
    found: dict[str, Replay]
    """With the paper's noise and error of hbar."""
    loud: dict[str, Replay]
    """With noise of 10 % of the domain."""
    quiet_run: Run
    quiet: dict[str, Replay]
    """Without noise, one run."""
    exact: dict[str, Replay]
    """With noise, without error of hbar."""
    rate: np.ndarray
    """df2/dx2, (n, seeds)."""


def study(seeds: int, seed: int = 0, dt: float = 0.01) -> Study:
    """Simulate. All noise levels are columns of the same arrays, which costs no time.

    Args:
        seeds: How many.
        seed: The first of them.
        dt: Sample period.

    Returns:
        The simulations.
    """
    numbers = [*range(seed, seed + seeds)] * 2 + [seed]
    noise = [NOISE] * seeds + [LOUD] * seeds + [0.0]
    everything = run_plant(numbers, noise, dt)
    model = Bioreactor(HBAR_OF_OBSERVERS)
    parts = replays(everything, model)
    first, second, last = slice(0, seeds), slice(seeds, 2 * seeds), slice(2 * seeds, None)
    run, quiet_run = of_seeds(everything, first), of_seeds(everything, last)

    def columns(which: slice) -> dict[str, Replay]:
        return {kind: of_seeds(part, which) for kind, part in parts.items()}

    exact = replays(run, Bioreactor(HBAR))
    return Study(run, columns(first), columns(second), quiet_run, columns(last), exact, incremental_rate(run, model))


def claims(on_share: OnShare) -> list[Claim]:
    """Figs 1 and 2."""
    done = study(SEEDS)
    on_share(0.7)
    found = [figure_1(done), figure_2(done), bias(done), spread(done)]
    found.append(correction(done.run, done.found[HOMOGENEOUS]))
    on_share(0.95)
    return [*found, simple_copy(done)]


def ordered_rates(done: Study) -> tuple[np.ndarray, np.ndarray]:
    """Means of df2_max, Omega_1, Omega_2, df2/dx2 over windows and seeds, (4 rates, 4 windows); whether in order."""
    rates = [done.found[kind].rate for kind in (CONSTANT, UPDATED, HOMOGENEOUS)]
    means = np.array([window_means(done.run, rate).mean(axis=1) for rate in (*rates, done.rate)])
    return means, np.asarray(np.all(np.diff(means, axis=0) <= 0.0, axis=0))


def figure_1(done: Study) -> Claim:
    """The estimates of the local incremental rate."""
    means, holds = ordered_rates(done)
    gains = {kind: window_means(done.run, done.found[kind].L).mean(axis=1) for kind in (UPDATED, HOMOGENEOUS)}
    tracked = [gains[kind] / (PHI2 + PHI3 / PHI1 * means[i]) for i, kind in enumerate((UPDATED, HOMOGENEOUS), start=1)]
    names = ("df2_max", "Omega_1", "Omega_2", "df2/dx2")
    t = done.run.t
    curves = [done.found[kind].rate[:, 0] for kind in (CONSTANT, UPDATED, HOMOGENEOUS)] + [done.rate[:, 0]]
    middles = [(start + end) / 2.0 for start, end in WINDOWS]

    def lines(which: tuple[int, ...]) -> list[Line]:
        thin = [Line(t, curves[i], names[i], color=i, width=0.8 if i in (1, 2) else 1.6) for i in which]
        return thin + [Line(middles, means[i], "", "ko", width=0.0) for i in which]

    picture = Picture(
        "andrieu2009-fig-1",
        "andrieu2009, Fig. 1: local incremental rate of f2 and its estimates (dots: means over seeds)",
        [
            Panel("[1/normalised time]", lines((0, 1, 2)), "(a) the bounds", TIME, y_scale="log"),
            Panel("[1/normalised time]", lines((1, 2, 3)), "(b) without df2_max", TIME, y_range=(-4.0, 6.0)),
        ],
    )

    def words(values: np.ndarray) -> str:
        return ", ".join(f"{value:.2f}" for value in values)

    return Claim(
        place="Fig. 1",
        says="With noise, too, the means come as df2_max >= Omega_1 >= Omega_2 >= df2/dx2.",
        found=f"Means over t = 5-10, 15-20, 28-35, 42-50 and {done.run.y.shape[1]} seeds: df2_max {words(means[0])}; "
        f"Omega_1 {words(means[1])}; Omega_2 {words(means[2])}; df2/dx2 {words(means[3])}: in order in {holds.sum()} "
        f"of 4 windows. L is {min(map(np.min, tracked)):.3f} to {max(map(np.max, tracked)):.3f} times phi2 + "
        "(phi3/phi1) Omega, as (13) says.",
        verdict=verdict(bool(holds.all())),
        why="" if holds.all() else "The means are not in order in every window.",
        figures={f"{name}_mean_per_time": row.tolist() for name, row in zip(names, means, strict=True)}
        | {"L_over_tracked_ratio": [row.tolist() for row in tracked]},
        pictures=[picture],
    )


def rms_by_kind(run: Run, found: dict[str, Replay]) -> np.ndarray:
    """RMS error of eta2 after t = 5, (3 observers, seeds)."""
    return np.array([rms_late(run, found[kind].eta2_error) for kind in (CONSTANT, UPDATED, HOMOGENEOUS)])


def share_in_order(rms: np.ndarray) -> float:
    """Share of the seeds in which constant > updated > updated and homogeneous."""
    return float((np.diff(rms, axis=0) < 0.0).all(axis=0).mean())


def running_mean(t: np.ndarray, values: np.ndarray, span: float = 1.0) -> np.ndarray:
    """Mean over a span of time about each sample, (n,)."""
    return uniform_filter1d(values, max(1, round(span / float(t[1] - t[0]))), mode="nearest")


def figure_2(done: Study) -> Claim:
    """The estimation errors."""
    rms, loud = rms_by_kind(done.run, done.found), rms_by_kind(done.run, done.loud)
    share, share_loud = share_in_order(rms), share_in_order(loud)
    n = rms.shape[1]
    means, loud_means = rms.mean(axis=1), loud.mean(axis=1)
    kinds = (CONSTANT, UPDATED, HOMOGENEOUS)
    why = (
        "Initial values are not given: the plant's and the observers' are drawn from M_eta for each seed, and the "
        "error is counted from t = 5. The noise is a new value every 10 ms, running straight in between. That the "
        "third is best is due to Omega_2, not to the homogeneous correction (see the claim on the correction)."
    )
    mean_of_first = running_mean(done.run.t, done.found[CONSTANT].eta2_error[:, 0])
    picture = Picture(
        "andrieu2009-fig-2",
        "andrieu2009, Fig. 2: error of eta2 given by each observer (one seed; black in (a): running mean over 1)",
        [
            Panel(
                "eta2 error [-]",
                [
                    Line(done.run.t, done.found[kind].eta2_error[:, 0], kind, color=i, width=0.8 if i else 0.25),
                    *([] if i else [Line(done.run.t, mean_of_first, "mean over 1", "k-")]),
                ],
                f"({'abc'[i]})",
                TIME,
                y_range=(-0.3, 0.8),
            )
            for i, kind in enumerate(kinds)
        ],
    )
    return Claim(
        place="Fig. 2",
        says="The observer with Omega_2 and homogeneity gives the best estimate of eta2, the updated gain with "
        "Omega_1 the second, the constant gain the worst.",
        found=f"RMS error of eta2 after t = 5, mean of {n} seeds: {means[0]:.3f}, {means[1]:.3f}, {means[2]:.3f} "
        f"(constant, updated, updated and homogeneous); in this order in {round(share * n)} of {n} seeds. With noise "
        f"of 10 % of the domain ({LOUD}): {loud_means[0]:.3f}, {loud_means[1]:.3f}, {loud_means[2]:.3f}; "
        f"{round(share_loud * n)} of {n}.",
        verdict=verdict(share >= LEAST_SEEDS, why),
        why=why,
        figures={
            "rms_error_eta2": dict(zip(kinds, means.tolist(), strict=True)),
            "rms_error_eta2_standard_deviation": dict(zip(kinds, rms.std(axis=1, ddof=1).tolist(), strict=True)),
            "share_of_seeds_in_order": share,
            "rms_error_eta2_with_10_percent_noise": dict(zip(kinds, loud_means.tolist(), strict=True)),
            "share_of_seeds_in_order_with_10_percent_noise": share_loud,
        },
        pictures=[picture],
    )


def biases(run: Run, found: dict[str, Replay]) -> np.ndarray:
    """Mean error of eta2, (3 observers, 4 windows)."""
    kinds = (CONSTANT, UPDATED, HOMOGENEOUS)
    return np.array([window_means(run, found[kind].eta2_error).mean(axis=1) for kind in kinds])


def bias(done: Study) -> Claim:
    """The bias of the errors in Fig. 2."""
    shown, quiet, exact = biases(done.run, done.found), biases(done.quiet_run, done.quiet), biases(done.run, done.exact)
    in_order = {
        name: (np.diff(values, axis=0) <= 0.0).all(axis=0) for name, values in (("shown", shown), ("quiet", quiet))
    }
    holds = bool(in_order["shown"].all() and in_order["quiet"].all())

    def words(values: np.ndarray) -> str:
        return "; ".join(", ".join(f"{value:.4f}" for value in row) for row in values)

    by_noise = exact / shown
    why = (
        "The error of hbar is not the main cause of the constant gain's bias: with hbar exact "
        f"{by_noise[0].min():.0%} to {by_noise[0].max():.0%} of it remain, made by the noise, which sends the "
        "estimate from end to end of the domain, where the limits cut off one side more than the other. For the "
        f"updated observers it is the main cause in the windows with large u ({by_noise[1:, [0, 2]].min():.0%} to "
        f"{by_noise[1:, [0, 2]].max():.0%} remain)."
    )
    return Claim(
        place="Section 3.1, bias in Fig. 2",
        says="The wrong hbar gives every observer's error a mean, and the larger its estimate of the rate, the larger "
        "that mean.",
        found="Mean error of eta2 in the four windows (constant; updated; updated and homogeneous). As in Fig. 2: "
        f"{words(shown)}. Without noise: {words(quiet)}. With noise and the exact hbar: {words(exact)}. A larger "
        f"estimate goes with a larger bias in {in_order['shown'].sum()} of 4 windows with noise, "
        f"{in_order['quiet'].sum()} of 4 without.",
        verdict=verdict(holds, why),
        why=why,
        figures={
            "bias_eta2": shown.tolist(),
            "bias_eta2_without_noise": quiet.tolist(),
            "bias_eta2_with_exact_hbar": exact.tolist(),
        },
    )


def spread_correlation(done: Study) -> tuple[np.ndarray, np.ndarray, float, float]:
    """Standard deviation of the errors beside the estimates used.

    Returns:
        Spreads (3 observers, 4 windows), rates (3, 4), the rank correlation over all twelve, the least over the three
        observers of one window.
    """
    kinds = (CONSTANT, UPDATED, HOMOGENEOUS)
    spreads = np.array([window_spreads(done.run, done.found[kind].eta2_error).mean(axis=1) for kind in kinds])
    rates = np.array([window_means(done.run, done.found[kind].rate).mean(axis=1) for kind in kinds])

    def correlation(a: np.ndarray, b: np.ndarray) -> float:
        return float(np.asarray(spearmanr(a.round(6), b)[0]))

    within = min(correlation(rates[:, i], spreads[:, i]) for i in range(len(WINDOWS)))
    return spreads, rates, correlation(rates.ravel(), spreads.ravel()), within


def spread(done: Study) -> Claim:
    """The thickness of the curves in Fig. 2."""
    spreads, rates, over_all, within = spread_correlation(done)
    ratio = spreads[:, [0, 2]].mean() / spreads[:, [1, 3]].mean()
    why = (
        "Across the observers of one window. Across windows the input matters as much: at large u the spread is "
        f"{ratio:.0f} times that at small u, since eta2 follows more steeply from x2 there."
    )
    return Claim(
        place="Section 3.1, standard deviation in Fig. 2",
        says="The larger an observer's estimate of the rate, the more its error scatters.",
        found="Standard deviation about a straight line in each window (constant; updated; updated and homogeneous): "
        + "; ".join(", ".join(f"{value:.4f}" for value in row) for row in spreads)
        + f". Rank correlation with the estimate: at least {within:.2f} over the observers of a window, {over_all:.2f} "
        "over all twelve.",
        verdict=verdict(within >= STRONG and over_all > 0.0, "" if over_all >= STRONG else why),
        why="" if within >= STRONG and over_all >= STRONG else why,
        figures={
            "error_standard_deviation_eta2": spreads.tolist(),
            "estimate_mean_per_time": rates.tolist(),
            "rank_correlation_over_all": over_all,
            "least_rank_correlation_in_a_window": within,
        },
    )


def correction(run: Run, found: Replay) -> Claim:
    """What the homogeneous terms do in the example."""
    model = Bioreactor(HBAR_OF_OBSERVERS)
    linear = replay(HOMOGENEOUS, run, model, p=0.0)
    allowed = 0.5 * largest_b(2, P, (P,))
    inside = replay(HOMOGENEOUS, run, model, b=allowed)
    late = run.t > 5.0
    largest = float(found.argument[late].max())
    after_q1 = largest * 0.01
    share_q1, share_q2 = largest ** (1.0 / (1.0 - P) - 1.0), after_q1**P
    rms, rms_linear, rms_inside = (float(rms_late(run, part.eta2_error).mean()) for part in (found, linear, inside))
    difference = float(np.abs(found.eta2_error - linear.eta2_error)[late].max())
    contributes = rms < 0.99 * rms_linear
    return Claim(
        place="Section 3.1, the homogeneous correction",
        says="The homogeneous correction has its part in the third observer's being the best (implied by the text of "
        "Fig. 2).",
        found=f"The argument of q1 is at most {largest:.1e} after t = 5: its power 1/(1-p) = 10 adds {share_q1:.0e} "
        f"of the linear term, and q2's power 1.9 adds {share_q2:.1e}. With a linear correction and the same Omega_2 "
        f"the RMS error is {rms_linear:.5f} against {rms:.5f}, and no error differs by more than {difference:.1e}. "
        f"With b = {allowed:.4f}, inside (21) and (22), it is {rms_inside:.5f}.",
        verdict=verdict(contributes),
        why=""
        if contributes
        else "With these parameters the correction is linear for all that matters. The whole gain over Omega_1 comes "
        "from Omega_2; what homogeneity gives is the right to use it. Where the correction matters is large errors: "
        "see Theorem 1 on system (1).",
        figures={
            "largest_argument": largest,
            "q1_power_term_ratio": share_q1,
            "q2_power_term_ratio": share_q2,
            "rms_error_eta2": rms,
            "rms_error_eta2_linear_correction": rms_linear,
            "rms_error_eta2_b_inside_conditions": rms_inside,
            "largest_difference_eta2": difference,
            "b_of_the_paper": B,
            "b_inside_conditions": allowed,
        },
    )


def simple_copy(done: Study) -> Claim:
    """Footnote 1."""
    errors = copy_errors(done.run, Bioreactor(HBAR_OF_OBSERVERS))
    copy = errors[1]
    error = float(rms_late(done.run, copy).mean())
    best = float(rms_by_kind(done.run, done.found)[2].mean())
    # What the noise does: the same seed with noise and without.
    late = done.run.t > 5.0
    quiet_copy = copy_errors(done.quiet_run, Bioreactor(HBAR_OF_OBSERVERS))[1]
    pairs = {kind: (part.eta2_error, done.quiet[kind].eta2_error) for kind, part in done.found.items()}
    pairs["copy"] = copy, quiet_copy
    by_noise = {
        name: float(np.sqrt(np.mean((noisy[late, 0] - quiet[late, 0]) ** 2))) for name, (noisy, quiet) in pairs.items()
    }
    least = min(value for name, value in by_noise.items() if name != "copy")
    # (eta1 + eta2)' = u (1 - eta1 - eta2) whatever hbar is.
    start, end = np.searchsorted(done.run.t, (10.0, 20.0))
    total = np.abs(errors.sum(axis=0))
    left = float(np.median(total[end] / total[start]))
    slow = float(np.exp(-0.02 * 10.0))
    holds = by_noise["copy"] == 0.0 and abs(left - slow) < 0.01
    return Claim(
        place="Footnote 1",
        says="A model of the plant that just runs along feels no noise, but how fast its error fades is not ours to "
        "choose.",
        found="A copy of (14) with hbar = 0.8 does not use the measurement: the noise changes its estimate by "
        f"{by_noise['copy']:.0f}, the observers' by {least:.4f} RMS and more. From t = 10 to 20, at u = 0.02, its "
        f"error of eta1 + eta2 keeps {left:.3f} of its size, as exp(-0.02 * 10) = {slow:.3f} demands, whatever one "
        f"would like. In this example it does no harm: after t = 5 the copy's RMS error is {error:.3f}, the best "
        f"observer's {best:.3f}.",
        verdict=verdict(bool(holds)),
        why="" if holds else "The copy is not as the footnote says.",
        figures={
            "rms_change_by_noise_eta2": by_noise,
            "share_left_after_slow_input": left,
            "rms_error_eta2_copy": error,
            "rms_error_eta2_best_observer": best,
        },
    )
