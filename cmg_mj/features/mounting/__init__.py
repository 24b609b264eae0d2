"""Mounting of scissored pairs on a user's own robot: MJCF in, a plant out."""

from cmg_mj.features.mounting.mount import MountedRobot, mount

__all__ = ["MountedRobot", "mount"]
