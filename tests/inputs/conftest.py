"""In an empty folder, in which nobody leaves anything behind that is not asked for."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest


@pytest.fixture(autouse=True)
def _no_litter(elsewhere: None, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> Iterator[None]:
    """MuJoCo must neither print nor write its log, and no temporary file may stay."""
    yield
    assert capfd.readouterr() == ("", "")
    litter = [path for path in tmp_path.rglob("*") if path.name == "MUJOCO_LOG.TXT" or path.name.endswith(".partial")]
    assert not litter


@pytest.fixture
def quick() -> str:
    """A short scenario."""
    Path("quick.toml").write_text("duration_s = 0.3")
    return "quick.toml"
