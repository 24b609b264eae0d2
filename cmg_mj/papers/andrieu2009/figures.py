"""Section 3.1: the bioreactor simulated, three observers that follow it, Figs 1 and 2, and what the text says."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy.ndimage import uniform_filter1d
from scipy.signal import detrend
from scipy.stats import spearmanr

from cmg_mj.papers.andrieu2009.bioreactor import (
    HBAR,
    HBAR_OF_OBSERVERS,
    L1,
    L2,
    NOISE,
    PHI1,
    PHI2,
    PHI3,
    B,
    Bioreactor,
    P,
    dilution,
)
from cmg_mj.papers.andrieu2009.observer import BiLimitCorrection, Signals, UpdatedHighGain, largest_b
from cmg_mj.papers.claim import Array, Claim
from cmg_mj.papers.recorded import rms, runge_kutta
from cmg_mj.view.plots.figure import Line, Panel, Picture

NOISE_PERIOD = 0.01
DURATION = 50.0
LOUD = 0.0986
"""10 % of the domain of eta1, which the paper takes for 0.05."""

CONSTANT, UPDATED, HOMOGENEOUS = "constant gain", "updated gain", "updated gain, homogeneous"
KINDS = (CONSTANT, UPDATED, HOMOGENEOUS)
TIME = "time [normalised]"
WINDOWS = ((5.0, 10.0), (15.0, 20.0), (28.0, 35.0), (42.0, 50.0))
"""The later part of each of the four inputs."""

ASSUMED = {
    "initial values": "drawn from M_eta for each seed",
    "noise": "a new value every 10 ms, straight in between",
}
"""Data of Figs 1 and 2 that the paper does not give."""


class Run(NamedTuple):
    """The plant with hbar = 1 and what is measured of it, one column a seed."""

    t: Array
    """Time, (n,)."""
    u: Array
    """Input held from each sample on, (n, 1)."""
    eta: Array
    """State, (2, n, seeds)."""
    y: Array
    """Measured eta_1, (n, seeds)."""
    start: Array
    """State from which the observers start, (2, seeds)."""


class Replay(NamedTuple):
    """An observer's estimates along a run, each (n, seeds)."""

    eta2_error: Array
    """eta_2 less its estimate."""
    rate: Array
    """The estimate of the local incremental rate that its gain uses."""
    L: Array
    """The gain."""
    argument: Array
    """|l1 (x1_hat - y)/L^b|, what q1 is taken of."""


Replays = dict[str, Replay]
"""Observer -> its replay."""


def run_plant(seeds: Sequence[int], noise: float | Sequence[float] = NOISE, dt: float = NOISE_PERIOD) -> Run:
    """Simulate the bioreactor. The paper gives no initial values: they are drawn from M_eta, as the observers' are.

    Args:
        seeds: One run each.
        noise: Standard deviation of the Gaussian measurement disturbance, one for all or one a run; drawn every 10 ms,
            straight in between.
        dt: Sample period; it divides 10 ms.

    Returns:
        The run.
    """
    plant = Bioreactor(HBAR)
    n = round(DURATION / dt)
    coarse = round(DURATION / NOISE_PERIOD)
    t = np.arange(n + 1) * dt
    u = np.array([dilution(time) for time in t])[:, None]
    starts, disturbances = [], []
    for seed in seeds:
        rng = np.random.default_rng(seed)
        room = 1.0 - plant.eps1 - plant.eps2
        starts.append([np.array([plant.eps1, plant.eps2]) + room * rng.dirichlet((1.0, 1.0, 1.0))[:2] for _ in "ab"])
        disturbances.append(np.interp(t, np.arange(coarse + 1) * NOISE_PERIOD, rng.normal(size=coarse + 1)))
    start, estimate = np.moveaxis(np.array(starts), 0, -1)
    eta = integrate(plant, start, u, dt)
    return Run(t, u, eta, eta[0] + noise * np.array(disturbances).T, estimate)


def integrate(model: Bioreactor, start: Array, u: Array, dt: float) -> Array:
    """Integrate (14) from a start (2, runs) by classical steps with inputs held, (2, n, runs)."""
    eta = np.empty((2, len(u), start.shape[1]))
    eta[:, 0] = state = start

    for k, u_k in enumerate(u[:-1]):
        eta[:, k + 1] = state = runge_kutta(lambda _, z, u_k=u_k: np.array(model.slope(z[0], z[1], u_k)), state, dt)
    return eta


def replay(kind: str, run: Run, model: Bioreactor, *, p: float = P, b: float = B) -> Replay:
    """Let one of the three observers, with the paper's parameters, estimate a run.

    Args:
        kind: CONSTANT, UPDATED or HOMOGENEOUS.
        run: The run.
        model: The bioreactor as the observer knows it.
        p: d_inf of the homogeneous one; with 0 its correction is linear, while its gain keeps Omega_2.
        b: Exponent of its scaling.

    Returns:
        Its estimates.
    """

    def saturate(y: Signals, x: Signals) -> tuple[Signals, Signals]:
        x1, x2 = model.limit(y[0], x[0])
        return (x1,), (x2,)

    def Omega(u: Any, y: Signals, x: Signals) -> Any:
        if kind == CONSTANT:
            return 0.0 * y[0]
        if kind == UPDATED:
            return model.Omega1(u, y[0], x[0])
        return model.Omega2(u, y[0], x[0], P)

    f = (lambda u, y, x: -u * y[0], lambda u, y, x: model.f2(u, y[0], x[0]))
    phi = PHI1, PHI2, PHI3
    if kind == CONSTANT:  # L stays at the gain to which (8) tends with df2_max for Omega
        phi = 1.0, PHI2 + PHI3 / PHI1 * model.df2_max, 1.0
    if kind != HOMOGENEOUS:
        p, b = 0.0, 1.0  # a linear correction
    observer = UpdatedHighGain(run.t[1], f, BiLimitCorrection((L1, L2), p), Omega, b, *phi, saturate)
    _, x2 = model.limit(run.start[0], model.to_x2(*run.start))
    x, L = observer.follow((run.y,), (run.y[0], x2), run.u[:, 0].tolist())
    eta2_error = run.eta[1] - model.to_eta2(*model.limit(*x))
    rate = np.full_like(run.y, model.df2_max) if kind == CONSTANT else Omega(run.u, *saturate((run.y,), (x[1],)))
    return Replay(eta2_error, rate, L, np.abs(L1 * (x[0] - run.y)) / L**b)


def replays(run: Run, model: Bioreactor) -> Replays:
    """Replay all three observers on one run."""
    return {kind: replay(kind, run, model) for kind in KINDS}


def windows_of(run: Run, values: Array) -> list[Array]:
    """Return the samples in each window, (samples, seeds)."""
    return [values[(run.t >= start) & (run.t < end)] for start, end in WINDOWS]


def window_means(run: Run, values: Array) -> Array:
    """Return the mean over each window and all seeds, (4,)."""
    return np.array([part.mean(axis=0) for part in windows_of(run, values)]).mean(axis=1)


def rms_late(run: Run, values: Array) -> Array:
    """Return the RMS after 5, one number a seed."""
    return rms(values[run.t > 5.0])


class Study(NamedTuple):
    """All simulations of the bioreactor: columns are seeds."""

    run: Run
    nominal: Replays
    """Runs with the paper's noise and error of hbar."""
    loud: Replays
    """Runs with noise of 10 % of the domain."""
    quiet: Replays
    """Replays without noise, of one run."""
    exact: Replays
    """Runs with noise, without error of hbar."""
    rate: Array
    """df2/dx2 of the f2 that the observers bound, at the true state, (n, seeds)."""


def study(seeds: int, seed: int = 0) -> Study:
    """Simulate. All noise levels are columns of the same arrays, which costs no time."""
    t, u, *whole_run = run_plant([*range(seed, seed + seeds)] * 2 + [seed], [NOISE] * seeds + [LOUD] * seeds + [0.0])
    model = Bioreactor(HBAR_OF_OBSERVERS)
    whole_replays = replays(Run(t, u, *whole_run), model)

    def columns(part: slice) -> Replays:
        return {kind: Replay(*(a[..., part] for a in whole)) for kind, whole in whole_replays.items()}

    nominal, loud, quiet = columns(slice(seeds)), columns(slice(seeds, 2 * seeds)), columns(slice(2 * seeds, None))
    run = Run(t, u, *(a[..., :seeds] for a in whole_run))
    rate = model.f2_slope(u, *model.limit(run.eta[0], Bioreactor(HBAR).to_x2(*run.eta)))
    return Study(run, nominal, loud, quiet, replays(run, Bioreactor(HBAR)), rate)


def rms_by_kind(run: Run, by_kind: Replays) -> Array:
    """Return the RMS error of eta2 after t = 5, (3 observers, seeds)."""
    return np.array([rms_late(run, by_kind[kind].eta2_error) for kind in KINDS])


SEEDS = 20
SEEN_NOISE = 0.05
"""An observer feels the noise if that changes its estimate by so much of its error."""
RATES = ("df2_max", "Omega_1", "Omega_2", "df2/dx2")
MIN_SEEDS = 0.95
"""Share of the seeds in which an order must hold."""
WINDOW_NAMES = [f"t = {start:g} to {end:g}" for start, end in WINDOWS]
HALF = 0.5
"""A bias is due to the error in hbar if less than this share is left without that error."""
STRONG = 0.7
"""A rank correlation above this is called strong."""


def claims() -> list[Claim]:
    """Judge section 3.1."""
    results = study(SEEDS)
    parts = [figure_1, figure_2, bias, bias_of_constant_gain, bias_of_updated_gains, spread, correction, simple_copy]
    return [part(results) for part in parts]


# --- Fig. 1: the local incremental rate of f2 and its three estimates ---


def by_window(study: Study, replays: Replays, field: str) -> Array:
    """Return the mean of a field of `Replay`, (3 observers, 4 windows)."""
    return np.array([window_means(study.run, getattr(replays[kind], field)) for kind in KINDS])


def ordered_rates(study: Study) -> tuple[Array, Array]:
    """Return the means of `RATES` over windows and seeds, (4 rates, 4 windows), and the windows in order."""
    means = np.vstack([by_window(study, study.nominal, "rate"), window_means(study.run, study.rate)])
    return means, np.all(np.diff(means, axis=0) <= 0.0, axis=0)


def figure_1(study: Study) -> Claim:
    """Judge the estimates of the local incremental rate."""
    means, in_order = ordered_rates(study)
    gains = by_window(study, study.nominal, "L")[1:]
    curves = [*(study.nominal[kind].rate[:, 0] for kind in KINDS), study.rate[:, 0]]
    middles = [(start + end) / 2.0 for start, end in WINDOWS]

    def lines(*indices: int) -> list[Line]:
        rates = [Line(study.run.t, curves[i], RATES[i], color=i, width=0.8 if i in (1, 2) else 1.6) for i in indices]
        return rates + [Line(middles, means[i], "", "ko", width=0.0) for i in indices]

    panels = [
        Panel("[1/normalised time]", lines(0, 1, 2), "(a) the bounds", TIME, y_scale="log"),
        Panel("[1/normalised time]", lines(1, 2, 3), "(b) without df2_max", TIME, y_range=(-4.0, 6.0)),
    ]
    return Claim(
        "Fig. 1",
        "With noise, too, the means come as df2_max >= Omega_1 >= Omega_2 >= df2/dx2.",
        assumes=ASSUMED,
        holds=in_order.all(),
        figures={f"{name}_mean_per_time": row for name, row in zip(RATES, means, strict=True)}
        | {"L_over_tracked_ratio": gains / (PHI2 + PHI3 / PHI1 * means[1:3])},
        picture=Picture(
            "andrieu2009-fig-1",
            "andrieu2009, Fig. 1: local incremental rate of f2 and its estimates (dots: means over seeds)",
            panels,
        ),
    )


# --- Fig. 2: the error of eta2 that each observer leaves, its bias and its spread ---


def share_in_order(rms: Array) -> float:
    """Return the share of the seeds in which constant > updated > updated and homogeneous."""
    return (np.diff(rms, axis=0) < 0.0).all(axis=0).mean()


def figure_2(study: Study) -> Claim:
    """Judge the estimation errors."""
    rms, loud = (rms_by_kind(study.run, replays) for replays in (study.nominal, study.loud))
    share, t = share_in_order(rms), study.run.t

    def by_kind(values: Array) -> dict[str, float]:
        return dict(zip(KINDS, values, strict=True))

    curves = [study.nominal[kind].eta2_error[:, 0] for kind in KINDS]
    mean_of_first = uniform_filter1d(curves[0], round(1.0 / float(t[1] - t[0])), mode="nearest")
    lines = [[Line(t, curve, KINDS[i], color=i, width=0.8 if i else 0.25)] for i, curve in enumerate(curves)]
    lines[0].append(Line(t, mean_of_first, "mean over 1", "k-"))
    panels = [
        Panel("eta2 error [-]", part, f"({letter})", TIME, y_range=(-0.3, 0.8))
        for letter, part in zip("abc", lines, strict=True)
    ]
    return Claim(
        "Fig. 2",
        "The observer with Omega_2 and homogeneity gives the best estimate of eta2, the updated gain with "
        "Omega_1 the second, the constant gain the worst.",
        assumes=ASSUMED,
        holds=share >= MIN_SEEDS,
        conditions="Initial values are not given: the plant's and the observers' are drawn from M_eta for each seed, "
        "and the error is counted from t = 5. The noise is a new value every 10 ms, running straight in between. The "
        "third is best because of Omega_2, not of the homogeneous correction (see the claim on the correction).",
        figures={
            "rms_error_eta2": by_kind(rms.mean(axis=1)),
            "rms_error_eta2_standard_deviation": by_kind(rms.std(axis=1, ddof=1)),
            "share_of_seeds_in_order": share,
            "rms_error_eta2_with_10_percent_noise": by_kind(loud.mean(axis=1)),
            "share_of_seeds_in_order_with_10_percent_noise": share_in_order(loud),
        },
        picture=Picture(
            "andrieu2009-fig-2",
            "andrieu2009, Fig. 2: error of eta2 given by each observer (one seed; black in (a): running mean over 1)",
            panels,
        ),
    )


def bias(study: Study) -> Claim:
    """Judge the order of the biases in Fig. 2."""
    noisy, quiet = (by_window(study, replays, "eta2_error") for replays in (study.nominal, study.quiet))
    return Claim(
        "Section 3.1, bias in Fig. 2",
        "The larger an observer's estimate of the rate, the larger the bias of its error.",
        assumes=ASSUMED,
        holds=np.all(np.diff([noisy, quiet], axis=1) <= 0.0),
        figures={"bias_eta2": noisy, "bias_eta2_without_noise": quiet},
    )


def bias_left(study: Study) -> Array:
    """Return the share of the bias that is left where the observers know hbar, (3 observers, 4 windows)."""
    exact, nominal = (by_window(study, replays, "eta2_error") for replays in (study.exact, study.nominal))
    return np.abs(exact / nominal)


def bias_of_constant_gain(study: Study) -> Claim:
    """Judge the cause of the constant gain's bias."""
    shares_left = bias_left(study)[0]
    return Claim(
        "Section 3.1, bias of the constant gain",
        "The bias of the observer with constant gain in Fig. 2 is due to the error in hbar.",
        assumes={**ASSUMED, "threshold": "due to it if less than half is left"},
        holds=dict(zip(WINDOW_NAMES, shares_left < HALF, strict=True)),
        otherwise="It is made by the noise, which sends the estimate from end to end of the domain, where the limits "
        "cut off one side more than the other. Noise renewed every 1 ms, 0.1 or 1 makes it as well, but for t = 15 to "
        "20 with the last two. Without noise all of it is due to hbar, but Fig. 2 has noise.",
        figures={"share_left_with_exact_hbar": shares_left},
    )


def bias_of_updated_gains(study: Study) -> Claim:
    """Judge the cause of the biases of the two observers with updated gain."""
    shares_left = bias_left(study)[1:]
    return Claim(
        "Section 3.1, bias of the updated gains",
        "The biases of the observers with updated gain in Fig. 2 are due to the error in hbar.",
        assumes={**ASSUMED, "threshold": "due to it if less than half is left"},
        holds=dict(zip(WINDOW_NAMES, np.all(shares_left < HALF, axis=0), strict=True)),
        otherwise="Half of it or more remains for one of them where it fails; there the bias itself is small. So it is "
        "with noise renewed every 1 ms; every 0.1 or 1, more remains. Without noise nearly all of it is due to hbar, "
        "but Fig. 2 has noise.",
        figures={"share_left_with_exact_hbar": dict(zip(KINDS[1:], shares_left, strict=True))},
    )


def spread(study: Study) -> Claim:
    """Judge the thickness of the curves in Fig. 2: the standard deviation of the errors beside the estimates used."""
    # About a straight line through each window, mean over the seeds.
    windows = [windows_of(study.run, study.nominal[kind].eta2_error) for kind in KINDS]
    spreads = np.array([[detrend(part, axis=0).std(axis=0).mean() for part in parts] for parts in windows])
    rates = by_window(study, study.nominal, "rate")

    def correlation(columns: slice) -> float:
        a, b = rates[:, columns].ravel().round(6), spreads[:, columns].ravel()
        return float(np.asarray(spearmanr(a, b)[0]))

    overall, in_window = correlation(slice(None)), min(correlation(slice(i, i + 1)) for i in range(len(WINDOWS)))
    ratio = spreads[:, [0, 2]].mean() / spreads[:, [1, 3]].mean()
    remark = (
        "Across the observers of one window. Across windows the input matters as much: at large u the spread is "
        f"{ratio:.0f} times that at small u, since eta2 follows more steeply from x2 there."
    )
    return Claim(
        "Section 3.1, standard deviation in Fig. 2",
        "The larger an observer's estimate of the rate, the more its error scatters.",
        assumes=ASSUMED,
        holds=in_window >= STRONG and overall > 0.0,
        conditions="" if overall >= STRONG else remark,
        otherwise=remark,
        figures={
            "error_standard_deviation_eta2": spreads,
            "estimate_mean_per_time": rates,
            "rank_correlation_over_all": overall,
            "least_rank_correlation_in_a_window": in_window,
        },
    )


# --- Section 3.1: what the homogeneous correction has to do with Fig. 2, and a copy of the plant without any ---


def correction(study: Study) -> Claim:
    """Judge the part of the homogeneous terms in the example."""
    run, nominal, model = study.run, study.nominal[HOMOGENEOUS], Bioreactor(HBAR_OF_OBSERVERS)
    linear = replay(HOMOGENEOUS, run, model, p=0.0)
    b_inside = 0.5 * largest_b(2, P, (P,))
    bounded = replay(HOMOGENEOUS, run, model, b=b_inside)
    late = run.t > 5.0
    largest = nominal.argument[late].max()
    rms, rms_linear, rms_inside = (rms_late(run, part.eta2_error).mean() for part in (nominal, linear, bounded))
    difference = np.abs(nominal.eta2_error - linear.eta2_error)[late].max()
    return Claim(
        "Section 3.1, the homogeneous correction",
        "In Fig. 2 the homogeneous correction is linear for all that matters: the third observer is the best "
        "because of Omega_2.",
        assumes=ASSUMED,
        holds=difference < 0.01 * rms,
        conditions="With the parameters of section 3.1. Homogeneity gives the right to use Omega_2. The correction "
        "matters for large errors, as in Theorem 1 on system (1).",
        is_ours=True,
        figures={
            "largest_argument": largest,
            "q1_power_term_ratio": largest ** (1.0 / (1.0 - P) - 1.0),
            "q2_power_term_ratio": (largest * 0.01) ** P,
            "rms_error_eta2": rms,
            "rms_error_eta2_linear_correction": rms_linear,
            "rms_error_eta2_b_inside_conditions": rms_inside,
            "largest_difference_eta2": difference,
            "b_of_the_paper": B,
            "b_inside_conditions": b_inside,
        },
    )


def simple_copy(study: Study) -> Claim:
    """Judge Footnote 1."""
    run = study.run
    errors = run.eta - integrate(Bioreactor(HBAR_OF_OBSERVERS), run.start, run.u, run.t[1])
    best_rms = rms_by_kind(run, study.nominal)[2].mean()
    # What the noise does: the same seed with noise and without.
    by_noise = {
        kind: rms_late(run, part.eta2_error[:, 0] - study.quiet[kind].eta2_error[:, 0])
        for kind, part in study.nominal.items()
    }
    # (eta1 + eta2)' = u (1 - eta1 - eta2) whatever hbar is.
    start, end = np.searchsorted(run.t, (10.0, 20.0))
    total = np.abs(errors.sum(axis=0))
    share_left = np.median(total[end] / total[start])
    return Claim(
        "Footnote 1",
        "A model of the plant that just runs along feels no noise, but how fast its error fades is not ours to choose.",
        holds=abs(share_left - np.exp(-0.02 * 10.0)) < 0.01 and min(by_noise.values()) > SEEN_NOISE * best_rms,
        figures={
            "rms_change_by_noise_eta2": by_noise,
            "share_left_after_slow_input": share_left,
            "rms_error_eta2_copy": rms_late(run, errors[1]).mean(),
            "rms_error_eta2_best_observer": best_rms,
        },
    )
