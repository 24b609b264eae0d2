"""Velocity observers, one a file."""

from cmg_mj.observers.protocol import NEEDS, Estimate, Measurement, Observer, needs
from cmg_mj.observers.registry import BENCH_PARAMETERS, OBSERVERS, check_names, make_observer, observer_class

__all__ = [
    "BENCH_PARAMETERS",
    "NEEDS",
    "OBSERVERS",
    "Estimate",
    "Measurement",
    "Observer",
    "check_names",
    "make_observer",
    "needs",
    "observer_class",
]
