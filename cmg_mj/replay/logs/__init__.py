"""A user's own log, CSV or Parquet, read into evenly sampled signals in SI and radians."""

from cmg_mj.replay.logs.log import Log, ReadOptions
from cmg_mj.replay.logs.reading import read_log

__all__ = ["Log", "ReadOptions", "read_log"]
