"""Figs 1 and 2, what the text says of them, and what the correction contributes to them."""

from __future__ import annotations

from cmg_mj.papers.andrieu2009.correction import correction, simple_copy
from cmg_mj.papers.andrieu2009.figure_1 import figure_1
from cmg_mj.papers.andrieu2009.figure_2 import bias, bias_of_constant_gain, bias_of_updated_gains, figure_2, spread
from cmg_mj.papers.andrieu2009.simulation import HOMOGENEOUS
from cmg_mj.papers.andrieu2009.study import study
from cmg_mj.papers.claim import Claim, OnShare

SEEDS = 20


def claims(on_share: OnShare) -> list[Claim]:
    """Section 3.1."""
    done = study(SEEDS)
    on_share(0.7)
    found = [figure_1(done), figure_2(done), bias(done), bias_of_constant_gain(done)]
    found += [bias_of_updated_gains(done), spread(done)]
    found.append(correction(done.run, done.found[HOMOGENEOUS]))
    on_share(0.95)
    return [*found, simple_copy(done)]
