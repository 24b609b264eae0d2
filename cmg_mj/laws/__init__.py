"""Control laws, one a file."""

from cmg_mj.core.types import FeedbackState, Law
from cmg_mj.laws.registry import LAW_CLASSES, LAWS, make_law
from cmg_mj.laws.state_feedback import TABLE_2_GAINS, StateFeedback, lqr_gains, scaled_gains

__all__ = [
    "LAWS",
    "LAW_CLASSES",
    "TABLE_2_GAINS",
    "FeedbackState",
    "Law",
    "StateFeedback",
    "lqr_gains",
    "make_law",
    "scaled_gains",
]
