"""Figs 2 and 3: ten motions of the pendulum robot, followed by both observers."""

from __future__ import annotations

from cmg_mj.papers.claim import Claim, OnShare
from cmg_mj.papers.dao2023 import figure_2, figure_3
from cmg_mj.papers.dao2023.study import study


def claims(on_share: OnShare) -> list[Claim]:
    """Judge Fig. 2, then Fig. 3."""
    results = study(on_share=on_share)
    return [*figure_2.claims(results), *figure_3.claims(results)]
