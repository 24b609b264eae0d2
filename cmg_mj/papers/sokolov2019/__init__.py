"""sokolov2019: one gimbal on a locked thrust bearing, and three velocity estimators."""

from __future__ import annotations

from cmg_mj.papers import plvcc
from cmg_mj.papers.claim import Claim, OnShare, Section
from cmg_mj.papers.sokolov2019 import (
    bearing,
    single_gimbal_lag,
    single_gimbal_loop,
    single_gimbal_push,
    single_gimbal_theory,
)


def _proposition(on_share: OnShare) -> list[Claim]:
    return [plvcc.claim("sokolov2019")]


def _loops(on_share: OnShare) -> list[Claim]:
    """Figs 4 to 6 need the lags: what oscillates by itself is told there, without noise."""
    lags = single_gimbal_lag.lags(lambda share: on_share(0.3 * share))
    found = single_gimbal_loop.loops(lambda share: on_share(0.3 + 0.7 * share))
    return [*single_gimbal_loop.figures_4_to_6(found, lags), single_gimbal_lag.claim(lags)]


def _bearing(on_share: OnShare) -> list[Claim]:
    return [bearing.claim(bearing.study(on_share))]


SECTIONS: list[Section] = [
    Section("the equations", 5.0, single_gimbal_theory.run),
    Section("Proposition 1", 3.0, _proposition),
    Section("Fig. 3", 3.0, single_gimbal_push.figure_3),
    Section("Figs 4 to 6, and the lag", 24.0, _loops),
    Section("the thrust bearing", 5.0, _bearing),
]
