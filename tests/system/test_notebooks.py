"""The notebooks of examples/: every cell runs."""

from __future__ import annotations

import time
import warnings
from pathlib import Path
from typing import Any

import pytest

from tests.command import ROOT

NOTEBOOKS = sorted((ROOT / "examples").glob("*.ipynb"))
MAX_TIME_S = 60.0
"""A notebook says that it runs in less than a minute."""


def executed(path: Path, folder: Path) -> Any:
    """Run a notebook in a kernel of its own, which starts in a folder."""
    with warnings.catch_warnings():  # of Jupyter's own, on Pythons newer than they know
        warnings.simplefilter("ignore", DeprecationWarning)
        import nbformat
        from nbclient import NotebookClient

        cells = nbformat.read(path, as_version=4)
        NotebookClient(cells, timeout=300, kernel_name="python3", resources={"metadata": {"path": folder}}).execute()
    return cells


@pytest.mark.slow
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_every_cell_runs(path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("IPYTHONDIR", str(tmp_path / "ipython"))
    monkeypatch.setenv("JUPYTER_RUNTIME_DIR", str(tmp_path / "runtime"))
    (tmp_path / "cwd").mkdir()
    start = time.process_time()
    cells = executed(path, tmp_path / "cwd")
    assert time.process_time() - start < MAX_TIME_S
    outputs = [output for cell in cells.cells for output in cell.get("outputs", [])]
    assert not [output for output in outputs if output.get("name") == "stderr"]
    data = [output["data"] for output in outputs if "data" in output]
    assert sum("image/png" in each for each in data) == 1
    assert sum("text/html" in each for each in data) >= 1  # a frame
    try:
        import rerun_notebook  # noqa: F401  # type: ignore[import-not-found]
    except ImportError:
        printed = "".join(output.get("text", "") for output in outputs)
        assert "show_recording: rerun's notebook viewer is not installed" in printed
    else:
        assert "application/vnd.jupyter.widget-view+json" in data[-1]
    assert list((tmp_path / "cwd").iterdir()) == []
