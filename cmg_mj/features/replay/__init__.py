"""Observers replayed open loop: on a run's recording, and on a user's log, where they are judged."""

from cmg_mj.runs.open_loop import replay

__all__ = ["replay"]
