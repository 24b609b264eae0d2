"""Control laws, one a file."""

from cmg_mj.controllers.laws.protocol import FeedbackState, Law
from cmg_mj.controllers.laws.registry import LAWS, law_class, make_law
from cmg_mj.controllers.laws.scaled_gains import scaled_gains
from cmg_mj.controllers.laws.state_feedback import TABLE_2_GAINS, StateFeedback, lqr_gains

__all__ = [
    "LAWS",
    "TABLE_2_GAINS",
    "FeedbackState",
    "Law",
    "StateFeedback",
    "law_class",
    "lqr_gains",
    "make_law",
    "scaled_gains",
]
