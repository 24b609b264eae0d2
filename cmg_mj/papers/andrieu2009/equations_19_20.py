"""Section 4.2, (19) and (20): a W for two dimensions with which both hold."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cmg_mj.papers.andrieu2009.bi_limit import BiLimitCorrection, largest_b
from cmg_mj.papers.andrieu2009.lyapunov import ANGLES, Decay, Lyapunov, decay, states
from cmg_mj.papers.claim import Claim

DEGREES = (0.0, 0.25, 0.5, 0.75, 0.9)
"""d_inf tried, of [0, 1)."""
SPREAD = 0.3
"""A1 and A2 of (17) are anywhere within so much of 1."""
L1 = (2.0, 4.0, 8.0, 16.0, 32.0, 64.0, 128.0, 256.0)
"""l1 tried, l2 being 1; the theorem says that some K and W do, so they may be sought."""
SIGMAS = (0.3, 1.0, 3.0, 10.0, 30.0)
FINE = np.geomspace(1e-8, 1e8, 641)
"""Scales on which what was found is tried again, forty a decade."""
MARGIN = 0.02
"""c1 and c2 must be at least so large, because the states tried leave some out."""


class SearchResult(NamedTuple):
    """The first pair with which both hold."""

    d_inf: float
    b: float
    l1: float
    sigma: float
    decay: Decay


def exponent_of_scaling(d_inf: float) -> float:
    """Return b, half of what (21) and (22) allow with v_2 = d_inf, and 1 at most."""
    return min(1.0, 0.5 * largest_b(2, d_inf, (d_inf,)))


def search(d_inf: float) -> SearchResult | None:
    """Look for K and W with d_W = 2 + d_inf."""
    b = exponent_of_scaling(d_inf)
    for l1 in L1:
        for sigma in SIGMAS:
            W = Lyapunov(BiLimitCorrection((l1, 1.0), d_inf), sigma, 2.0 + d_inf)
            if min(decay(W, b, SPREAD)) > MARGIN:
                return SearchResult(d_inf, b, l1, sigma, decay(W, b, SPREAD, states(FINE, ANGLES)))
    return None


def claim() -> Claim:
    """Judge (19) and (20)."""
    results = {d_inf: search(d_inf) for d_inf in DEGREES}
    pairs = [pair for pair in results.values() if pair is not None]
    return Claim(
        place="Section 4.2, (19) and (20)",
        statement="There are K and a proper W, homogeneous in the bi-limit, that satisfy (19) and (20) for all A(t) "
        "within (17) and the B of section 4.3.",
        is_general=True,
        holds=len(pairs) == len(results) and all(min(pair.decay) > 0.0 for pair in pairs),
        conditions="For two dimensions, by numbers; a d_inf near its limit asks for a larger l1.",
        otherwise="For some d_inf none was found, which does not say that there is none.",
        figures={
            "c1_by_d_inf": {str(pair.d_inf): pair.decay.c1 for pair in pairs},
            "c2_by_d_inf": {str(pair.d_inf): pair.decay.c2 for pair in pairs},
            "l1_by_d_inf": {str(pair.d_inf): pair.l1 for pair in pairs},
        },
    )
