"""Velocity observers, one a file."""

from cmg_mj.observers.protocol import Estimate, Measurement, Observer
from cmg_mj.observers.registry import OBSERVERS, make_observer, observer_class

__all__ = ["OBSERVERS", "Estimate", "Measurement", "Observer", "make_observer", "observer_class"]
