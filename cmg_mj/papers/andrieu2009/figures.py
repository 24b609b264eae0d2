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
    """Judge section 3.1."""
    results = study(SEEDS)
    on_share(0.7)
    figure_claims = [figure_1(results), figure_2(results), bias(results), bias_of_constant_gain(results)]
    figure_claims += [bias_of_updated_gains(results), spread(results)]
    figure_claims.append(correction(results.run, results.nominal[HOMOGENEOUS]))
    on_share(0.95)
    return [*figure_claims, simple_copy(results)]
