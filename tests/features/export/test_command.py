"""`cmg-mj export` as a user meets it."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

from cmg_mj.core.errors import InputError
from cmg_mj.features.export import export, generate_code, write_code
from cmg_mj.results import folder
from tests.command import cmg_mj
from tests.features.export.compiled import compile_c, control, controller, needs_compiler

FILES = ["linear.c", "linear.h", "linear_example.c", "linear_test_vector.h"]

pytestmark = pytest.mark.usefixtures("elsewhere")


@pytest.fixture(autouse=True)
def few_signals(monkeypatch: pytest.MonkeyPatch) -> None:
    """On which an export compares C with Python; the other tests of the export have all."""
    monkeypatch.setattr("cmg_mj.features.export.check.TICKS", 100)


def files(place: str) -> list[str]:
    return sorted(path.name for path in Path(place).iterdir() if path.name != folder.MARKER)


@needs_compiler
def test_what_the_readme_of_an_export_says() -> None:
    outcome = cmg_mj("export", "linear", "--out", "board")
    assert outcome.status == 0
    assert "linear, double precision" in outcome.out
    assert outcome.out.count("0 (bit for bit)") == 5
    assert files("board") == FILES
    compile_c("board/linear.c", "board/linear_example.c", "-lm", "-o", "example")
    subprocess.run(["./example"], check=True, capture_output=True)


def test_parameters_gains_and_units_are_in_comments() -> None:
    cmg_mj("export", "homogeneous", "--out", "board", "--set", "controller.rate_limit_rad_s=3")
    header, source = (Path(f"board/homogeneous.{end}").read_text() for end in "hc")
    assert "k1 = 20.0" in header
    assert "gravity_torque = 3.45" in header
    assert "[kg m^2]" in header
    assert "rate_limit = 3.0;" in source
    assert "/* largest gimbal rate [rad/s] */" in source


@needs_compiler
@pytest.mark.daily_cases("*-watcher")
@pytest.mark.parametrize(
    ("cls", "arguments", "name"),
    [("Größe", [], "grosse"), ("Double", [], "double_observer"), ("观测器", ["--name", "watcher"], "watcher")],
)
def test_a_class_with_any_name(cls: str, arguments: list[str], name: str) -> None:
    """Compiled by the command, and by a user whose compiler looks for headers in the folder."""
    Path(f"called_{name}.py").write_text(
        f"class {cls}:\n"
        "    def __init__(self, dt, model): self.dt = dt\n"
        "    def init(self, y): return {'abs': y.y1, 'ω': 0.0, '速度': 0.0, 'this': 0.0, 'NAN': 0.0}\n"
        "    def step(self, state, y, u):\n"
        "        rate = (y.y1 - state['abs'])/self.dt + 0*(state['速度'] + state['this'] + state['NAN'] + state['ω'])\n"
        "        return {'abs': y.y1, 'ω': rate, '速度': rate, 'this': u, 'NAN': u}, (y.y1, rate, y.y2)\n",
        encoding="utf-8",
    )
    assert cmg_mj("export", f"called_{name}:{cls}", *arguments, "--out", "board").status == 0
    assert f"{name}.h" in files("board")
    code = Path(f"board/{name}.h").read_text() + Path(f"board/{name}.c").read_text()
    assert f"{name}_status {name}_update(" in code
    assert all(f" {member};" in code for member in ("abs_", "omega", "value", "this_", "NAN_"))
    assert re.sub(r"/\*.*?\*/", "", code, flags=re.DOTALL).isascii()
    compile_c("-Iboard", f"board/{name}.c", f"board/{name}_example.c", "-lm", "-o", "example")
    if arguments:
        complaint = cmg_mj("export", f"called_{name}:{cls}", "--out", "other").complaint
        assert complaint.endswith("give one with --name")
        assert not Path("other").exists()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["linear", "--out", ""], "--out '': name a folder"),
        (
            ["linear", "--name", "double"],
            "--name double: is a word of C or of its library; take another, such as double_",
        ),
        (["linear", "--name", "a-b"], "--name 'a-b': must be a name in C"),
        (["linear", "--set", "controller.feedback=fog"], "set controller.feedback=observer"),
        (
            ["linear", "--set", "controller.kind=tests.features.export.own_laws:Branches"],
            "law Branches: cannot be exported: a branch on a value (",
        ),
    ],
)
def test_wrong_input_is_one_line(arguments: list[str], words: str) -> None:
    Path("file").write_text("")
    assert words in cmg_mj("export", *arguments).complaint
    assert not Path("runs").exists() or not any(Path("runs").iterdir())


@pytest.mark.daily_cases("'-No closing quotation", "* -c 0-*")
@pytest.mark.parametrize(
    ("cc", "words"),
    [
        ("'", "No closing quotation"),
        ("no-such-compiler", "the C compiler no-such-compiler cannot be run: No such file or directory"),
        (f"{sys.executable} -c 'raise SystemExit(1)'", "it ended with status 1, silently"),
        (f"{sys.executable} -c 0", "the compiled example cannot be run"),
    ],
)
def test_a_compiler_that_is_none(cc: str, words: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CC", cc)
    assert words in cmg_mj("export", "linear", "--out", "board").complaint
    assert not Path("board").exists()


def test_without_a_compiler_that_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setattr("shutil.which", lambda name: None)
    outcome = cmg_mj("export", "linear", "--out", "board")
    assert outcome.status == 0
    assert "no C compiler was found" in outcome.err
    assert "C, off from Python" not in outcome.out
    assert files("board") == FILES


@needs_compiler
def test_c_that_is_not_what_python_runs_is_not_left(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """A fault planted in the printing: the formulas agree, the C does not."""
    from cmg_mj.features.export import c_code

    genuine = c_code.literal
    monkeypatch.setattr(c_code, "literal", lambda value, precision: genuine(1.0001 * value, precision))
    with pytest.raises(
        InputError, match=r"the C is not what Python runs: .*x2_rad_s: off by at most .* --precision double"
    ):
        export(controller("linear"), tmp_path / "board")
    assert not (tmp_path / "board").exists()


@needs_compiler
def test_large_gains_amplify_rounding_and_are_still_looked_at(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """u is off by k2 times what the rate is off by; k2 itself may not be off by half a percent."""
    k2 = 300.0
    monkeypatch.setattr("cmg_mj.features.export.check.TICKS", 400)
    axis = control("gyro_free", f"controller.gains=[{8.0 * k2}, {k2}, -1.1, 0.35]")
    code = generate_code(axis, "single")
    off = code.figures["c_off_by"]
    assert off["u_rad_s"] < 1.1 * k2 * off["x2_rad_s"] + 1e-4
    assert code.figures["beyond_rounding"] == []
    header, source, example, _ = write_code(tmp_path / "board", code)
    for gain, status in ((k2, 0), (1.005 * k2, 1)):
        text, count = re.subn(r"(?<=gain_x2 = )[\d.]+f", f"{gain}f", source.read_text())
        assert count == 1
        Path("changed.c").write_text(text)
        compile_c(f"-I{header.parent}", "changed.c", example, "-lm", "-o", "changed")
        assert subprocess.run(["./changed"], capture_output=True, check=False).returncode == status
