"""A user's own log, CSV or Parquet -> evenly sampled signals in SI and radians, with a word on all that was done."""

from cmg_mj.replay.logs.log import Log
from cmg_mj.replay.logs.reading import read_log

__all__ = ["Log", "read_log"]
