"""Pairs mounted on a user's own robot: any MJCF in, a rig out."""

from cmg_mj.plant.mounting.mount import mount
from cmg_mj.plant.mounting.mounted import MountedRobot

__all__ = ["MountedRobot", "mount"]
