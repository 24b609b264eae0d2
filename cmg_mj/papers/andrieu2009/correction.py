"""Section 3.1: what the homogeneous correction has to do with Fig. 2, and a copy of the plant without any."""

from __future__ import annotations

import numpy as np

from cmg_mj.papers.andrieu2009.bi_limit import largest_b
from cmg_mj.papers.andrieu2009.bioreactor import Bioreactor
from cmg_mj.papers.andrieu2009.paper import HBAR_OF_OBSERVERS, B, P
from cmg_mj.papers.andrieu2009.simulation import HOMOGENEOUS, Replay, Run, copy_errors, replay, rms_late
from cmg_mj.papers.andrieu2009.study import ASSUMED, Study, rms_by_kind
from cmg_mj.papers.claim import Claim

SEEN_NOISE = 0.05
"""An observer feels the noise if that changes its estimate by so much of its error."""


def correction(run: Run, nominal: Replay) -> Claim:
    """Judge the part of the homogeneous terms in the example."""
    model = Bioreactor(HBAR_OF_OBSERVERS)
    linear = replay(HOMOGENEOUS, run, model, p=0.0)
    b_inside = 0.5 * largest_b(2, P, (P,))
    bounded = replay(HOMOGENEOUS, run, model, b=b_inside)
    late = run.t > 5.0
    largest = float(nominal.argument[late].max())
    after_q1 = largest * 0.01
    share_q1, share_q2 = largest ** (1.0 / (1.0 - P) - 1.0), after_q1**P
    rms, rms_linear, rms_inside = (float(rms_late(run, part.eta2_error).mean()) for part in (nominal, linear, bounded))
    difference = float(np.abs(nominal.eta2_error - linear.eta2_error)[late].max())
    return Claim(
        place="Section 3.1, the homogeneous correction",
        statement="In Fig. 2 the homogeneous correction is linear for all that matters: the third observer is the best "
        "because of Omega_2.",
        assumes=ASSUMED,
        holds=difference < 0.01 * rms,
        conditions="With the parameters of section 3.1. Homogeneity gives the right to use Omega_2. The correction "
        "matters for large errors, as in Theorem 1 on system (1).",
        otherwise="The correction has its part in it.",
        is_ours=True,
        figures={
            "largest_argument": largest,
            "q1_power_term_ratio": share_q1,
            "q2_power_term_ratio": share_q2,
            "rms_error_eta2": rms,
            "rms_error_eta2_linear_correction": rms_linear,
            "rms_error_eta2_b_inside_conditions": rms_inside,
            "largest_difference_eta2": difference,
            "b_of_the_paper": B,
            "b_inside_conditions": b_inside,
        },
    )


def simple_copy(study: Study) -> Claim:
    """Judge Footnote 1."""
    errors = copy_errors(study.run, Bioreactor(HBAR_OF_OBSERVERS))
    copy = errors[1]
    error = float(rms_late(study.run, copy).mean())
    best_rms = float(rms_by_kind(study.run, study.nominal)[2].mean())
    # What the noise does: the same seed with noise and without.
    late = study.run.t > 5.0
    by_noise = {
        kind: float(np.sqrt(np.mean((part.eta2_error[late, 0] - study.quiet[kind].eta2_error[late, 0]) ** 2)))
        for kind, part in study.nominal.items()
    }
    least = min(by_noise.values())
    # (eta1 + eta2)' = u (1 - eta1 - eta2) whatever hbar is.
    start, end = np.searchsorted(study.run.t, (10.0, 20.0))
    total = np.abs(errors.sum(axis=0))
    share_left = float(np.median(total[end] / total[start]))
    expected_share = float(np.exp(-0.02 * 10.0))
    return Claim(
        place="Footnote 1",
        statement="A model of the plant that just runs along feels no noise, but how fast its error fades is not ours "
        "to choose.",
        holds=abs(share_left - expected_share) < 0.01 and least > SEEN_NOISE * best_rms,
        otherwise="The copy is not as the footnote says.",
        figures={
            "rms_change_by_noise_eta2": by_noise,
            "share_left_after_slow_input": share_left,
            "rms_error_eta2_copy": error,
            "rms_error_eta2_best_observer": best_rms,
        },
    )
