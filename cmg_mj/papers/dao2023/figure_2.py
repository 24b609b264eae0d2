"""Fig. 2: the state's error with the conventional and with the proposed observer, at Sigma = 10."""

from __future__ import annotations

import numpy as np
from scipy.linalg import expm

from cmg_mj.papers.claim import Claim
from cmg_mj.papers.dao2023 import paper
from cmg_mj.papers.dao2023.pendulum_robot import Errors, settle_times
from cmg_mj.papers.dao2023.study import ASSUMED, SETTLED, UNSTATED, Study, finite_times
from cmg_mj.view.plots.figure import Line, Panel, Picture

QUICK = 10.0
"""Quick: at most this many times as slow as an observer that knows the parameters."""


def claims(study: Study) -> list[Claim]:
    """Judge (a), (b), and how fast (b) is."""
    return [conventional(study), proposed(study), speed_claim(study)]


def conventional(study: Study) -> Claim:
    """Judge (a)."""
    rms = study.conventional.tail_rms()[0]
    return Claim(
        place="Fig. 2(a)",
        statement="With the conventional observer, which knows of no disturbance, the error of the state goes on "
        "oscillating.",
        assumes=ASSUMED,
        holds=rms.min() > 0.2,
        conditions=UNSTATED,
        otherwise=UNSTATED,
        figures={"conventional_state_rms_160_200_s": rms.tolist()},
        pictures=[_picture(study)],
    )


def _picture(study: Study) -> Picture:
    def panel(title: str, errors: Errors, every: int) -> Panel:
        lines = [
            Line(errors.t[::every], errors.state[::every, 0, 0, i], label, color=i, width=0.8)
            for i, label in enumerate(("$q$ [rad]", "$\\dot q$ [rad/s]"))
        ]
        return Panel("estimate less truth", lines, title, y_range=(-2.0, 2.0))

    return Picture(
        "dao2023-fig-2",
        "dao2023, Fig. 2: state error at Sigma = 10, one of ten motions (the first seconds leave the axes)",
        (
            panel("(a) conventional adaptive observer", study.conventional, 10),
            panel("(b) adaptive disturbance observer", study.proposed, 20),
        ),
    )


def proposed(study: Study) -> Claim:
    """Judge (b)."""
    rms, plain = study.proposed.tail_rms()[0], study.conventional.tail_rms()[0]
    return Claim(
        place="Fig. 2(b)",
        statement="With the proposed observer the error of the state tends to zero.",
        assumes=ASSUMED,
        holds=rms.max() < 0.1 and bool((rms < plain).all()),
        conditions=UNSTATED,
        otherwise=UNSTATED,
        figures={"proposed_state_rms_160_200_s": rms.tolist(), "largest_angle_rad": study.largest_angle},
    )


def speed_claim(study: Study) -> Claim:
    """Judge (b), how fast."""
    learning_times, ideal_times = state_settle_times(study.proposed)
    middle, yardstick = float(np.median(learning_times)), float(np.median(ideal_times))
    meaning = (
        f"{UNSTATED} We call it soon if the median time until the error, as a vector, stays below {SETTLED} is at most "
        f"{QUICK:g} times that of a reference. The reference is an observer with the same L that knows the parameters "
        "and the disturbance."
    )
    return Claim(
        place="Fig. 2(b), how fast",
        statement="With the proposed observer the error of the state tends to zero soon.",
        assumes={**ASSUMED, "threshold": f"soon is at most {QUICK:g} times as slow as knowing all"},
        missing_data="The paper gives no time within which it counts as quick.",
        holds=middle <= QUICK * yardstick,
        conditions=meaning,
        otherwise=meaning,
        figures={
            "state_settles_below_0_1_s": finite_times(learning_times),
            "state_settles_below_0_1_if_all_is_known_s": ideal_times.tolist(),
        },
    )


def state_settle_times(errors: Errors) -> tuple[np.ndarray, np.ndarray]:
    """Find when the state's error, as a vector, stays below `SETTLED`, with the first of the weights.

    Args:
        errors: Errors of the observers along the motions.

    Returns:
        The times (n,) [s], infinite if they do not settle; and the same of an observer from the same start with the
        same L that knows all of xm, whose error obeys z' = (A + L C2) z: what L itself takes.
    """
    t = np.linspace(0.0, 40.0, 8001)
    onward, z = expm(t[1] * paper.error_matrix()), [errors.state[0, 0].T]
    for _ in t[1:]:
        z.append(onward @ z[-1])
    ideal_times = settle_times(np.linalg.norm(z, axis=1), t, SETTLED)
    return settle_times(np.linalg.norm(errors.state[:, 0], axis=-1), errors.t, SETTLED), ideal_times
