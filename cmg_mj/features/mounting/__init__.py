"""Mounting of scissored pairs on a user's own robot: MJCF in, a plant out."""

from cmg_mj.features.mounting.mount import mount
from cmg_mj.features.mounting.mounted import MountedRobot

__all__ = ["MountedRobot", "mount"]
