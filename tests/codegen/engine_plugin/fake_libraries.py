"""Libraries that are installed and never opened, for tests that compile none."""

from __future__ import annotations

import warnings
from pathlib import Path

from cmg_mj.codegen.engine_plugin.load import load


def make_library(tmp_path: Path, name: str = "balance", content: str = "code") -> Path:
    path = tmp_path / f"libcmg_mj_{name}.so"
    path.write_text(content, encoding="utf-8")
    return path


def load_warnings() -> list[str]:
    with warnings.catch_warnings(record=True) as records:
        warnings.simplefilter("always")
        load()
    assert all(warning.category is RuntimeWarning for warning in records)
    return [str(warning.message) for warning in records]


def files_in(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def library_in(path: Path) -> Path:
    return next(path.glob("balance-*.so"))
