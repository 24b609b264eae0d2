"""Velocity observers, one a file."""

from cmg_mj.core.types import NEEDS, Estimate, Measurement, Observer, needs
from cmg_mj.observers.registry import OBSERVER_CLASSES, OBSERVERS, make_observer

__all__ = ["NEEDS", "OBSERVERS", "OBSERVER_CLASSES", "Estimate", "Measurement", "Observer", "make_observer", "needs"]
