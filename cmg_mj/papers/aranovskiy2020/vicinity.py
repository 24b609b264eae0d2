"""The homogeneous differentiator (11) of aranovskiy2020: where its error converges to."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from cmg_mj.observers import make_observer
from cmg_mj.papers.aranovskiy2020.finite_time import rates_at_rest
from cmg_mj.papers.aranovskiy2020.paper import TABLE_2, printed_model
from cmg_mj.papers.aranovskiy2020.rig import DT, replay_at_rest
from cmg_mj.papers.claim import Claim, OnShare
from cmg_mj.papers.recorded import rms
from cmg_mj.view.plots.figure import Line, Panel, Picture

SEED = 77_000
ALPHAS = (0.55, 0.7, 0.85, 1.0)
SETTLING = ALPHAS[1:]
"""The exponents without much chatter."""
BIASES_DEG = (0.125, 0.25, 0.5, 1.0, 2.0)
NOISES_RAD = (0.0005, 0.001, 0.002, 0.004, 0.008)
TICKS = 2000
VANISHED = 1e-3
"""Share of the rate's first error that counts as none."""
SEEN_RAD_S = 0.01
"""Biases of the rate above this one are compared with the closed form by their ratio, those below by the difference."""


def remaining_error(alpha: float, dt: float = DT, first_rad_s: float = -1.0, span_s: float = 3.0) -> float:
    """Return what is left of a wrong rate without bias, noise or motion, by its first size: the last 0.5 s' largest."""
    rates = rates_at_rest(alpha, dt, span_s, x1=0.05, x2=first_rad_s)
    return float(rates[-round(0.5 / dt) :].max() / abs(first_rad_s))


def errors_at_rest(alpha: float, y1: np.ndarray) -> np.ndarray:
    """Return the RMS of the rate estimated at rest, (n_worlds,) [rad/s], from y1, (n_ticks, n_worlds) [rad]."""
    observer = make_observer("homogeneous", DT, printed_model(), alpha=alpha)
    return rms(replay_at_rest(observer, y1).x2[len(y1) // 2 :])


def bias_bound(alpha: float, e_rad: float) -> float:
    """k1 (M sin e/(J1 k2))^(alpha/(2 alpha - 1)), where (11) rests if y1 = -e [rad/s]."""
    model, (k1, k2, _) = printed_model(), TABLE_2["homogeneous"].values()
    pull = model.gravity_torque * math.sin(e_rad) / model.J1
    return k1 * (pull / k2) ** (alpha / (2.0 * alpha - 1.0))


def hurwitz(b: float, c: float) -> bool:
    """Return true if s^2 + b s + c is Hurwitz."""
    return bool(np.roots([1.0, b, c]).real.max() < 0.0)


class Vicinity(NamedTuple):
    """Distances from the true rate at which the estimate ends, at rest."""

    by_bias: dict[float, np.ndarray]
    """alpha -> error without noise, (n_biases,) [rad/s]."""
    bound: dict[float, np.ndarray]
    """alpha -> the same in closed form."""
    by_noise: dict[float, np.ndarray]
    """alpha -> RMS error without bias, (n_noises,) [rad/s]."""

    @property
    def relative_difference(self) -> float:
        """Largest miss of the closed form where it is above `SEEN_RAD_S`, relative."""
        return max(abs(x / b - 1.0) for x, b in self._pairs() if b > SEEN_RAD_S)

    @property
    def difference(self) -> float:
        """Largest miss where it is not [rad/s]."""
        return max(abs(x - b) for x, b in self._pairs() if b <= SEEN_RAD_S)

    @property
    def exponents(self) -> dict[float, float]:
        """Powers of the noise with which the error rises, by alpha."""
        sizes = np.log(NOISES_RAD)
        return {alpha: float(np.polyfit(sizes, np.log(error), 1)[0]) for alpha, error in self.by_noise.items()}

    def _pairs(self) -> list[tuple[float, float]]:
        return [(float(x), float(b)) for a in self.by_bias for x, b in zip(self.by_bias[a], self.bound[a], strict=True)]


def vicinity(rng: np.random.Generator) -> Vicinity:
    """Measure it over bias and noise."""
    biases = np.radians(BIASES_DEG)
    noise = rng.normal(0.0, 1.0, (TICKS, 16))
    biased, noisy = np.tile(-biases, (TICKS, 1)), np.hstack([sigma * noise for sigma in NOISES_RAD])
    return Vicinity(
        {alpha: errors_at_rest(alpha, biased) for alpha in SETTLING},
        {alpha: np.array([bias_bound(alpha, e) for e in biases]) for alpha in SETTLING},
        {alpha: errors_at_rest(alpha, noisy).reshape(len(NOISES_RAD), -1).mean(axis=1) for alpha in SETTLING},
    )


def vicinity_claim(seed: int = SEED) -> Claim:
    """Judge convergence to a vicinity of the origin, and how large it is."""
    rng = np.random.default_rng(seed)
    errors, fine_errors = ({alpha: remaining_error(alpha, dt) for alpha in ALPHAS} for dt in (DT, DT / 10.0))
    # Sampled, (11) chatters with an amplitude that falls as dt^(alpha/(1 - alpha)), by homogeneity.
    converges = all(errors[a] < VANISHED or fine_errors[a] < errors[a] / 10.0 for a in ALPHAS)
    measures = vicinity(rng)
    relative_difference, difference, slopes = measures.relative_difference, measures.difference, measures.exponents
    gains = rng.normal(0.0, 100.0, (500, 2))
    is_equivalent = all(hurwitz(k1, k2) == hurwitz(k2, k1) for k1, k2 in gains)
    return Claim(
        place="After (11), the vicinity",
        statement="For s^2 + k2 s + k1 Hurwitz and alpha in (1/2, 1] the error converges to a vicinity of the origin.",
        is_general=True,
        assumes={
            "e": f"{BIASES_DEG[0]:g} to {BIASES_DEG[-1]:g} deg",
            "noise": f"{NOISES_RAD[0]:g} to {NOISES_RAD[-1]:g} rad",
            "control rate": f"{1.0 / DT:g} Hz",
        },
        holds=converges and relative_difference < 0.01 and difference < 0.1 * SEEN_RAD_S and min(slopes.values()) > 0.5,
        conditions=(
            f"Tried with k1, k2 of Table 2 and alpha = {', '.join(f'{alpha:g}' for alpha in ALPHAS)}. "
            "With s^2 + k1 s + k2 Hurwitz; the printed s^2 + k2 s + k1 has k1 and k2 exchanged"
            + (
                ", without consequence: either is Hurwitz just when both gains are positive."
                if is_equivalent
                else ", and the two are not Hurwitz together."
            )
        ),
        otherwise="The error does not converge, or not to the vicinity foreseen.",
        figures={
            "error_left_share": _by_name(errors),
            "bias_deg": list(BIASES_DEG),
            "rate_error_by_bias_rad_s": _by_name(measures.by_bias),
            "error_left_share_2000_hz": _by_name(fine_errors),
            "closed_form_relative_difference": relative_difference,
            "closed_form_difference_where_small_rad_s": difference,
            "noise_rad": list(NOISES_RAD),
            "rate_error_by_noise_rad_s": _by_name(measures.by_noise),
            "exponent_of_noise": _by_name(slopes),
        },
        pictures=[_picture(measures)],
    )


def _by_name(by_alpha: Mapping[float, Any]) -> dict[str, Any]:
    return {str(alpha): np.asarray(value).tolist() for alpha, value in by_alpha.items()}


def _picture(measures: Vicinity) -> Picture:
    biased, noisy = [], []
    for i, alpha in enumerate(SETTLING):
        biased.append(Line(BIASES_DEG, measures.by_bias[alpha], f"alpha = {alpha:g}", "o", color=i + 1))
        biased.append(Line(BIASES_DEG, measures.bound[alpha], color=i + 1, width=0.8))
        noisy.append(Line(np.degrees(NOISES_RAD), measures.by_noise[alpha], f"alpha = {alpha:g}", "o-", color=i + 1))
    e, sigma = "equilibrium bias e [deg]", "standard deviation of y1's noise [deg]"
    return Picture(
        "aranovskiy2020-vicinity",
        "aranovskiy2020, (11): how far from the true rate its estimate rests, k1 and k2 of Table 2",
        [
            Panel("rate error [rad/s]", biased, "no noise; lines: closed form; above: chatter", e, "log", "log"),
            Panel("RMS rate error\n[rad/s]", noisy, "with noise, no bias", sigma, "log", "log"),
        ],
        share_x=False,
    )


def claims(on_share: OnShare) -> list[Claim]:
    """Judge the vicinity."""
    return [vicinity_claim()]
