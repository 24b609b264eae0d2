"""Writing and reading run folders in tests."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path

from rerun.chunk import RrdReader

from cmg_mj.results.folder import MARKER
from cmg_mj.results.trajectory import Trajectory

FILES = ["recording.rrd", "scenario.toml", "summary.json", "trajectory.parquet"]


def write(text: str, path: str = "my.toml") -> str:
    """Write a file, and the folders above it; its path."""
    Path(path).parent.mkdir(parents=True, exist_ok=True)
    Path(path).write_text(text)
    return path


def names(place: str) -> list[str]:
    """List the contents of a folder, but for the marker."""
    return sorted(path.name for path in Path(place).iterdir() if path.name != MARKER)


def assert_whole(place: str) -> Trajectory:
    """Every file of a run folder can be read to its end, and there is no other."""
    assert names(place) == FILES
    json.loads((Path(place) / "summary.json").read_text())
    tomllib.loads((Path(place) / "scenario.toml").read_text())
    assert list(RrdReader(Path(place) / "recording.rrd").stream().to_chunks())
    return Trajectory.load(Path(place) / "trajectory.parquet")
