"""Control laws, one a file."""

from cmg_mj.controllers.laws.registry import LAW_CLASSES, LAWS, make_law
from cmg_mj.controllers.laws.state_feedback import TABLE_2_GAINS, StateFeedback, lqr_gains, scaled_gains
from cmg_mj.core.types import FeedbackState, Law

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
