"""Laws other than (8) in C: `lqg` and a user's own, against Python; those that cannot be exported are refused."""

from __future__ import annotations

import inspect
import math
import re
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cmg_mj import laws
from cmg_mj.core.errors import InputError, RunStopped
from cmg_mj.features.export import check, export
from tests.command import cmg_mj
from tests.features.export import own_laws
from tests.features.export.compiled import Compiled, compile_c, controller, needs_compiler, record

OWN = "tests.features.export.own_laws:"
LAWS = [kind for kind in laws.LAWS if kind != "state_feedback"]
LAWS += ["examples.own_law:Leaning", *(f"{OWN}{name}" for name in ("Memoryless", "Elaborate", "InADict"))]
SETTINGS = {
    "trimmed": ("controller.bias_trim_s=0.52",),
    "estimated angles": ("controller.angle_source=estimated", "controller.rate_hz=400"),
    "limited": ("controller.rate_limit_rad_s=0.6",),
}
SHORT = ("duration_s=1.0", "push.0.start_s=0.25")
RESULT_NOT_FINITE = 2


def with_law(law: str) -> str:
    return f"controller.kind={law}"


def few_signals(monkeypatch: pytest.MonkeyPatch, ticks: int = 40) -> None:
    """The export compares on few of them, where a test compares on others or expects a refusal."""
    monkeypatch.setattr("cmg_mj.features.export.check.TICKS", ticks)


@needs_compiler
@pytest.mark.slow
@pytest.mark.parametrize("law", LAWS)
def test_double_precision_is_bit_for_bit(law: str, tmp_path: Path) -> None:
    loop, compiled = record("kalman", with_law(law)), Compiled("kalman", "double", tmp_path, with_law(law))
    np.testing.assert_array_equal(compiled.run(loop.samples), loop.results)
    assert compiled.output.splitlines()[-1] == "as in cmg_mj"


@needs_compiler
@pytest.mark.slow
def test_a_second_is_bit_for_bit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    few_signals(monkeypatch)
    settings = (with_law(f"{OWN}Elaborate"), *SHORT)
    loop, compiled = record("adaptive", *settings), Compiled("adaptive", "double", tmp_path, *settings)
    np.testing.assert_array_equal(compiled.run(loop.samples), loop.results)


@needs_compiler
@pytest.mark.slow
@pytest.mark.parametrize("settings", SETTINGS)
def test_settings_of_the_scenario_are_in_the_c(settings: str, tmp_path: Path) -> None:
    """The law of the first has no limit of its own; u is then what the controller's limit makes of it."""
    words = (with_law(f"{OWN}Elaborate"), *SETTINGS[settings])
    loop = record("adaptive", *words)
    plain = Compiled("adaptive", "double", tmp_path / "plain", words[0]).run(loop.samples)
    assert not np.array_equal(plain[:, -1], loop.results[:, -1])  # they do make a difference
    np.testing.assert_array_equal(Compiled("adaptive", "double", tmp_path, *words).run(loop.samples), loop.results)


@needs_compiler
@pytest.mark.slow
@pytest.mark.parametrize("law", LAWS)
def test_single_precision_is_close_and_nothing_else(law: str, tmp_path: Path) -> None:
    """RMS of the command's difference: 1e-4 of the command, whose observer is not to be blamed."""
    loop, compiled = record("kalman", with_law(law)), Compiled("kalman", "single", tmp_path, with_law(law))
    off = compiled.run(loop.samples)[:, -1] - loop.results[:, -1]
    assert 0.0 < np.sqrt(np.mean(off**2)) <= 1e-4 * np.sqrt(np.mean(loop.results[:, -1] ** 2))
    assert compiled.output.splitlines()[-1] == "as in cmg_mj"
    code = re.sub(r"/\*.*?\*/", "", compiled.header.read_text() + compiled.source.read_text(), flags=re.DOTALL)
    assert not re.search(r"\bdouble\b|malloc|static (?!const|void|int is_finite\()", code)
    floats = re.findall(r"(?<![\w.])(?:\d+\.\d*(?:e[+-]?\d+)?|\d+e[+-]?\d+)\w?", code)
    assert all(literal.endswith("f") for literal in floats)


@needs_compiler
@pytest.mark.slow
@pytest.mark.parametrize("member", ["parts_pi_1", "parts_abs", "x_e"])
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_a_state_of_the_law_that_is_not_finite_stops_it(member: str, value: float, tmp_path: Path) -> None:
    """Also the number that the law divides by, which leaves the command finite."""
    compiled = Compiled("linear", "double", tmp_path, with_law(f"{OWN}Elaborate"))
    samples = check.signals(controller("linear"), 0, "double")[:20]
    fresh = compiled.run(samples)
    members = [name for struct in ("state", "law_state") for name in members_of(compiled, struct)] + ["x_e"]
    compiled.run(samples[:5])
    compiled.numbers(len(members))[members.index(member)] = value
    statuses, results = compiled.go_on(samples[5:])
    assert set(statuses) == {RESULT_NOT_FINITE}
    assert not results.any()
    np.testing.assert_array_equal(compiled.run(samples), fresh)


def members_of(compiled: Compiled, struct: str) -> list[str]:
    """Names of the numbers in a struct of the header."""
    text = compiled.header.read_text().partition(f"}} linear_{struct};")[0].rpartition("typedef struct {")[2]
    return re.findall(r"linear_real (\w+);", text)


@needs_compiler
@pytest.mark.slow
def test_an_infinite_command_stops_it_as_python(tmp_path: Path) -> None:
    """It is not taken for one beyond the limit."""
    law = with_law(f"{OWN}Overflows")
    compiled, loop = Compiled("linear", "double", tmp_path, law), controller("linear", law)
    upright, overturned = [0.0, 9.81, 0.0, 9.81, 0.0, 0.0], [-1.0, -9.81, -1.0, -9.81, 0.0, 0.0]
    statuses, results = compiled.statuses(np.array([upright, overturned]))
    assert statuses.tolist() == [0, RESULT_NOT_FINITE]
    assert np.all(np.isfinite(results))
    loop.decide(0, upright[:4], upright[4:], 0.0, 0.0)
    with pytest.raises(RunStopped, match="law Overflows returned -inf for u"):
        loop.decide(loop.period, overturned[:4], overturned[4:], 0.0, 0.0)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("Branches", "a branch on a value"),
        pytest.param("Raises", "step(state, y, x, u) raised KeyError: 'floats only'", marks=pytest.mark.slow),
        pytest.param("HoldsADeque", "its state holds a deque", marks=pytest.mark.slow),
        pytest.param(
            "HoldsTooMuch", "its state holds 1001 numbers; at most 1000 can be exported", marks=pytest.mark.slow
        ),
        pytest.param("Remembers", "remembers something outside of its state", marks=pytest.mark.slow),
        pytest.param("Grows", "made otherwise than the one of init", marks=pytest.mark.slow),
        pytest.param("DrawsLots", "not twice the same", marks=pytest.mark.slow),
        ("LooksAtTypes", "traced, it is not what Python runs: on random signals u_rad_s is off by"),
        pytest.param(
            "BeginsAtInfinity", "its state holds inf (least) at sample 0, where the C stops", marks=pytest.mark.slow
        ),
        pytest.param("Blows", "cannot be compared on random signals: law Blows returned", marks=pytest.mark.slow),
        pytest.param("Uncopied", "cannot be copied: RuntimeError: there is only one of me", marks=pytest.mark.slow),
        ("Derives", "its integrator x_e is no number in its state"),
    ],
)
def test_what_c_would_not_have_is_refused(
    name: str, words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    few_signals(monkeypatch, 100)
    with pytest.raises(InputError) as info:
        export(controller("linear", with_law(f"{OWN}{name}")), tmp_path / "export")
    complaint = str(info.value)
    assert complaint.startswith(f"law {name}: cannot be exported: ")
    assert words in complaint
    assert "\n" not in complaint
    assert not (tmp_path / "export").exists()
    lines, first = inspect.getsourcelines(getattr(own_laws, name))
    for line, text in enumerate(lines, first):
        if text.rstrip().endswith("# here"):
            assert f"own_laws.py, line {line}: {text.strip()})" in complaint


@needs_compiler
@pytest.mark.slow
@pytest.mark.usefixtures("elsewhere")
@pytest.mark.parametrize("precision", ["double", "single"])
def test_command(precision: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    few_signals(monkeypatch)
    words = ["--set", "controller.kind=lqg", "--set", "controller.torque_walk=0.05", "--precision", precision]
    outcome = cmg_mj("export", "linear", "--out", "board", *words)
    assert outcome.status == 0
    header, source = (Path(f"board/linear.{end}").read_text() for end in "hc")
    assert "cmg_mj.laws.lqg:Lqg" in header
    assert "torque_walk = 0.05" in header
    assert "} linear_law_state;" in header
    assert "rate_limit = 4.7" in source
    assert "gain_x1" not in source
    compile_c("board/linear.c", "board/linear_example.c", "-lm", "-o", "example")
    subprocess.run(["./example"], check=True, capture_output=True)


@pytest.mark.slow
def test_a_docstring_that_would_end_the_comment(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    few_signals(monkeypatch)
    header = export(controller("linear", with_law(f"{OWN}Elaborate")), tmp_path)[0].read_text()
    assert "Takes whatever there is. * / / * Its integrator does not begin at zero." in header
