"""dao2023: the adaptive disturbance observer, on the pendulum robot and on the rig."""

from cmg_mj.reproduce.dao2023.claims import STEPS

__all__ = ["STEPS"]
