"""The trade of the linear differentiator (9): lag against noise."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cmg_mj.observers import make_observer
from cmg_mj.papers.aranovskiy2020.paper import printed_model
from cmg_mj.papers.aranovskiy2020.rig import DT, replay_at_rest
from cmg_mj.papers.claim import Claim
from cmg_mj.view.plots.figure import Line, Panel, Picture

SEED = 76_000
TAUS_S = (0.01, 0.015, 0.02, 0.03, 0.05, 0.08)


class Trade(NamedTuple):
    """Lag and noise gain of (9) with one time constant."""

    lag_s: float
    """Delay of the estimate of a steadily rising rate [s]."""
    noise_gain_1_s: float
    """RMS of the estimate by that of a white noise measured [1/s]."""


def trade(tau: float, seed: int = SEED) -> Trade:
    """Replay (9) on a steadily accelerated tilt, and on noise."""
    time, settling_ticks = np.arange(2000) * DT, 400
    acceleration = 0.3
    noise = np.random.default_rng(seed).normal(0.0, 1.0, (len(time), 8))
    y1 = np.column_stack([acceleration * time**2 / 2.0, noise])
    x2 = replay_at_rest(make_observer("linear", DT, printed_model(), tau=tau), y1).x2
    late = time[-1] - x2[-1, 0] / acceleration
    return Trade(late, np.sqrt(np.mean(x2[settling_ticks:, 1:] ** 2)))


def predict_trade(tau: float) -> Trade:
    """Predict the trade by G = s/(tau s + 1)^2, whose phase falls with the slope 2 tau.

    A sample of noise is a triangle in time, two samples wide: the weights are the impulse response's means over it. For
    samples short beside tau their squares add up to dt/(4 tau^3).
    """
    fine = 50
    time = np.arange(fine * (round(30.0 * tau / DT) + 1)) * DT / fine
    response = (1.0 - time / tau) * np.exp(-time / tau) / tau**2
    triangle = 1.0 - np.abs(np.arange(-fine, fine + 1)) / fine
    weights = np.convolve(response, triangle)[fine::fine] * DT / fine
    weights[0] -= response[0] / 2.0 * DT / fine  # trapezoidal rule at the response's jump
    return Trade(2.0 * tau, np.sqrt(np.sum(weights**2)))


def lag(seed: int = SEED) -> Claim:
    """Judge a longer tau: less noise, more lag."""
    lags, gains = zip(*(trade(tau, seed) for tau in TAUS_S), strict=True)
    lags_foreseen, gains_foreseen = np.array([predict_trade(tau) for tau in TAUS_S]).T
    fine = np.geomspace(TAUS_S[0], TAUS_S[-1], 50)
    fine_lags, fine_gains = np.array([predict_trade(tau) for tau in fine]).T
    lag_lines = [
        Line(TAUS_S, 1e3 * np.array(lags), "measured", "o", color=1),
        Line(fine, 1e3 * fine_lags, "2 tau", color=7),
    ]
    noise_lines = [
        Line(TAUS_S, gains, "measured", "o", color=1),
        Line(fine, fine_gains, "of the transfer function", color=7),
    ]
    x = "tau [s]"
    return Claim(
        place="(9), lag and noise",
        statement="A filter with the differentiator reduces noise, but lag distorts the estimate: tau trades them.",
        holds=np.abs(lags / lags_foreseen - 1.0).max() < 0.01
        and np.abs(gains / gains_foreseen - 1.0).max() < 0.05
        and sorted(gains, reverse=True) == list(gains),
        figures={"tau_s": TAUS_S, "lag_s": lags, "noise_gain_1_s": gains},
        pictures=[
            Picture(
                "aranovskiy2020-eq-9",
                "aranovskiy2020, (9): the lag of the linear differentiator against its noise",
                [
                    Panel("lag [ms]", lag_lines, "", x, "log", "log"),
                    Panel("noise gain [1/s]", noise_lines, "", x, "log", "log"),
                ],
            )
        ],
    )
