"""Section V after Fig. 3, and Section VI: all that rests on the loops over seeds and on the lags."""

from __future__ import annotations

from cmg_mj.papers.claim import Claim, OnShare
from cmg_mj.papers.sokolov2019 import comparison, lag
from cmg_mj.papers.sokolov2019.figures_4_to_6 import figure_4, figure_5, figure_6
from cmg_mj.papers.sokolov2019.loops import loops


def claims(on_share: OnShare) -> list[Claim]:
    """Figs 4 to 6 need the lags: what oscillates by itself is told there, without noise."""
    lags = lag.lags(lambda share: on_share(0.3 * share))
    found = loops(lambda share: on_share(0.3 + 0.7 * share))
    figures = [figure(found, lags) for figure in (figure_4, figure_5, figure_6)]
    return [*figures, comparison.best(found), comparison.model_based(found), lag.claim(lags)]
