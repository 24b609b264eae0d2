"""Fig. 1: the local incremental rate of f2 and its three estimates."""

from __future__ import annotations

import numpy as np

from cmg_mj.papers.andrieu2009.paper import PHI1, PHI2, PHI3
from cmg_mj.papers.andrieu2009.simulation import HOMOGENEOUS, KINDS, TIME, UPDATED, WINDOWS, window_means
from cmg_mj.papers.andrieu2009.study import ASSUMED, Study
from cmg_mj.papers.claim import Claim
from cmg_mj.view.plots.figure import Line, Panel, Picture

RATES = ("df2_max", "Omega_1", "Omega_2", "df2/dx2")


def ordered_rates(study: Study) -> tuple[np.ndarray, np.ndarray]:
    """Return the means of `RATES` over windows and seeds, (4 rates, 4 windows), and the windows in order."""
    rates = [study.nominal[kind].rate for kind in KINDS]
    means = np.array([window_means(study.run, rate).mean(axis=1) for rate in (*rates, study.rate)])
    return means, np.asarray(np.all(np.diff(means, axis=0) <= 0.0, axis=0))


def figure_1(study: Study) -> Claim:
    """Judge the estimates of the local incremental rate."""
    means, in_order = ordered_rates(study)
    gains = {kind: window_means(study.run, study.nominal[kind].L).mean(axis=1) for kind in (UPDATED, HOMOGENEOUS)}
    ratios = [gains[kind] / (PHI2 + PHI3 / PHI1 * means[i]) for i, kind in enumerate((UPDATED, HOMOGENEOUS), start=1)]

    return Claim(
        place="Fig. 1",
        statement="With noise, too, the means come as df2_max >= Omega_1 >= Omega_2 >= df2/dx2.",
        assumes=ASSUMED,
        holds=bool(in_order.all()),
        otherwise="The means are not in order in every window.",
        figures={f"{name}_mean_per_time": row.tolist() for name, row in zip(RATES, means, strict=True)}
        | {"L_over_tracked_ratio": [row.tolist() for row in ratios]},
        pictures=[_picture(study, means)],
    )


def _picture(study: Study, means: np.ndarray) -> Picture:
    t = study.run.t
    curves = [study.nominal[kind].rate[:, 0] for kind in KINDS] + [study.rate[:, 0]]
    middles = [(start + end) / 2.0 for start, end in WINDOWS]

    def lines(indices: tuple[int, ...]) -> list[Line]:
        rate_lines = [Line(t, curves[i], RATES[i], color=i, width=0.8 if i in (1, 2) else 1.6) for i in indices]
        return rate_lines + [Line(middles, means[i], "", "ko", width=0.0) for i in indices]

    return Picture(
        "andrieu2009-fig-1",
        "andrieu2009, Fig. 1: local incremental rate of f2 and its estimates (dots: means over seeds)",
        [
            Panel("[1/normalised time]", lines((0, 1, 2)), "(a) the bounds", TIME, y_scale="log"),
            Panel("[1/normalised time]", lines((1, 2, 3)), "(b) without df2_max", TIME, y_range=(-4.0, 6.0)),
        ],
    )
