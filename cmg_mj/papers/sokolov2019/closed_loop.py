"""Section V after Fig. 3, and Section VI: all that rests on the loops over seeds, on the lags and on the backlash."""

from __future__ import annotations

from cmg_mj.papers.claim import Claim, OnShare
from cmg_mj.papers.scales import on_common_scales
from cmg_mj.papers.sokolov2019 import comparison, lag
from cmg_mj.papers.sokolov2019.cycles import cycles
from cmg_mj.papers.sokolov2019.figures_4_to_6 import cause_of_figure_5, figure_4, figure_5, figure_6, figure_6_at_rest
from cmg_mj.papers.sokolov2019.loops import loops


def claims(on_share: OnShare) -> list[Claim]:
    """Judge the loops; Figs 4 to 6 need the lags and the cycles, which show what oscillates without noise."""
    lags = lag.lags(lambda share: on_share(0.2 * share))
    ends = cycles()
    results = loops(lambda share: on_share(0.3 + 0.7 * share))
    four, five, six = on_common_scales(
        [figure_4(results, lags, ends), figure_5(results, lags, ends), figure_6(results, ends)]
    )
    return [
        four,
        five,
        cause_of_figure_5(lags, ends),
        six,
        figure_6_at_rest(lags, ends),
        *comparison.best_claims(results),
        *comparison.model_based_claims(results),
        lag.claim(lags),
    ]
