"""Pairs mounted on a user's own robot: any MJCF in, a rig out."""

from cmg_mj.mounting.mount import Mounted, mount

__all__ = ["Mounted", "mount"]
