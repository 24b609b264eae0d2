"""Exported code against Python, on the samples of a closed loop over 15 s: every observer, and every law."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from cmg_mj.laws import LAWS
from cmg_mj.observers import OBSERVERS
from tests.features.export.compiled import Compiled, needs_compiler, record

pytestmark = needs_compiler

OWN, OWN_LAW = "tests.features.export.own:", "controller.kind=tests.features.export.own_laws:"
SWITCHING = "super_twisting"
"""Makes so much of a last digit that single precision cannot follow it."""
CASES = [(kind, ()) for kind in (*OBSERVERS, f"{OWN}Plain", f"{OWN}Elaborate")]
CASES += [("kalman", (f"controller.kind={law}",)) for law in (*LAWS, "examples.own_law:Leaning")]
CASES += [("kalman", (f"{OWN_LAW}{name}",)) for name in ("Memoryless", "Elaborate", "InADict")]


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "settings"), CASES)
def test_double_precision_is_bit_for_bit(kind: str, settings: tuple[str, ...], tmp_path: Path) -> None:
    loop, export = record(kind, *settings), Compiled(kind, "double", tmp_path, *settings)
    np.testing.assert_array_equal(export.run(loop.samples), loop.results)
    assert export.output.splitlines()[-1] == "as in cmg_mj"


@pytest.mark.parametrize(
    ("kind", "settings"),
    [
        ("adaptive", ()),
        ("gyro_free", ("plant.accelerometer_inner_across_m=0.15", "plant.accelerometer_outer_angle_deg=90")),
        pytest.param("linear", (), marks=pytest.mark.slow),
        pytest.param("adaptive", (f"{OWN_LAW}Elaborate",), marks=pytest.mark.slow),
    ],
)
def test_a_second_is_bit_for_bit(
    kind: str, settings: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Besides, the export itself compares on few signals here."""
    monkeypatch.setattr("cmg_mj.features.export.check.TICKS", 40)
    settings = (*settings, "duration_s=1.0", "push.0.start_s=0.25")
    loop, compiled = record(kind, *settings), Compiled(kind, "double", tmp_path, *settings)
    np.testing.assert_array_equal(compiled.run(loop.samples), loop.results)


@pytest.mark.slow
@pytest.mark.parametrize("law", [(), (f"{OWN_LAW}Elaborate",)], ids=["(8)", "without a limit of its own"])
@pytest.mark.parametrize(
    "settings",
    [
        pytest.param(("controller.bias_trim_s=0.52",), id="trimmed"),
        pytest.param(("controller.angle_source=estimated", "controller.rate_hz=400"), id="estimated angles"),
        pytest.param(("controller.rate_limit_rad_s=0.6",), id="limited"),
        pytest.param(("observer.torque=true", "observer.bias=false", "observer.sinusoid_hz=1.5"), id="a sinusoid"),
    ],
)
def test_settings_of_the_scenario_are_in_the_c(settings: tuple[str, ...], law: tuple[str, ...], tmp_path: Path) -> None:
    loop = record("adaptive", *law, *settings)
    plain = Compiled("adaptive", "double", tmp_path / "plain", *law).run(loop.samples)
    assert not np.array_equal(plain[:, -1], loop.results[:, -1])  # they do make a difference
    compiled = Compiled("adaptive", "double", tmp_path, *law, *settings)
    np.testing.assert_array_equal(compiled.run(loop.samples), loop.results)


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "settings"), CASES)
def test_single_precision_is_close_and_nothing_else(kind: str, settings: tuple[str, ...], tmp_path: Path) -> None:
    """RMS of the rate's difference: below 1e-5 rad/s, or 1e-4 of the observer's own error; of the command's: 1e-4."""
    loop, export = record(kind, *settings), Compiled(kind, "single", tmp_path, *settings)
    off = export.run(loop.samples) - loop.results
    own_error = loop.results[:, 1] - loop.rate
    assert (rms(off[:, 1]) <= max(1e-5, 1e-4 * rms(own_error))) is (kind != SWITCHING)
    assert kind == SWITCHING or 0.0 < rms(off[:, -1]) <= 1e-4 * rms(loop.results[:, -1])
    assert export.output.splitlines()[-1] == "as in cmg_mj"

    code = re.sub(r"/\*.*?\*/", "", export.header.read_text() + export.source.read_text(), flags=re.DOTALL)
    assert not re.search(r"\bdouble\b|malloc|static (?!const|void|int is_finite\()", code)
    floats = re.findall(r"(?<![\w.])(?:\d+\.\d*(?:e[+-]?\d+)?|\d+e[+-]?\d+)\w?", code)
    assert floats
    assert all(literal.endswith("f") for literal in floats)
    if shutil.which("nm"):
        symbols = subprocess.run(["nm", "-D", "-u", export.library], capture_output=True, text=True, check=True).stdout
        calls = [name for name in re.findall(r"U (\w+)", symbols) if not name.startswith("_")]
        assert "atan2f" in calls
        assert all(name.endswith("f") for name in calls), calls


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))
