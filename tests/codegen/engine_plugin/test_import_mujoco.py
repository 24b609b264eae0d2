"""Installed plugins in earnest: compiled, installed by the command, loaded by `import mujoco` in fresh processes."""

from __future__ import annotations

import shutil
import statistics
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import pytest

from cmg_mj.codegen.engine_plugin import install as installing
from cmg_mj.codegen.engine_plugin.load import VARIABLE
from cmg_mj.simulation.plugin_files import Plugin
from tests.codegen.engine_plugin.made import make, needs_compiler
from tests.codegen.export.compiled import COMPILER
from tests.command import ROOT, cmg_mj, environment

pytestmark = [needs_compiler, pytest.mark.slow]

MOST_OF_THE_IMPORT = 0.10
"""Share of the processor time of `import mujoco`, which takes 0.13 s and more: 20 ms are 0.15 of it."""
LOAD = "import mujoco, sys; model = mujoco.MjModel.from_xml_path({model!r}); print(model.nplugin)"


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    path = tmp_path / "plugins"
    monkeypatch.setenv(VARIABLE, str(path))
    return path


@pytest.fixture
def site(tmp_path: Path) -> Path:
    """A folder of packages in which this one is installed with its entry point, however old the tests' own is."""
    site = tmp_path / "site"
    package = site / f"cmg_mj-{version('cmg_mj')}.dist-info"
    package.mkdir(parents=True)
    (package / "METADATA").write_text(f"Name: cmg_mj\nVersion: {version('cmg_mj')}\n", encoding="utf-8")
    table = (ROOT / "pyproject.toml").read_text("utf-8").partition('entry-points."mujoco.plugins"]')[2].splitlines()[1]
    (package / "entry_points.txt").write_text(f"[mujoco.plugins]\n{table.replace(chr(34), '')}\n", encoding="utf-8")
    return site


def python(program: str, site: Path, *options: str) -> subprocess.CompletedProcess[str]:
    """Run a program in a fresh process, in an empty folder."""
    elsewhere = site / "elsewhere"
    elsewhere.mkdir(exist_ok=True)
    process = subprocess.run(
        [sys.executable, *options, "-c", program],
        cwd=elsewhere,
        env=environment() | {"PYTHONPATH": f"{site}:{ROOT}"},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert list(elsewhere.iterdir()) == []  # no log of MuJoCo's
    return process


def loads(plugin: Plugin) -> str:
    return LOAD.format(model=str(plugin.model))


def pristine(tmp_path: Path) -> Plugin:
    """A plugin whose files a test may change."""
    made = make("gyro_free").plugin
    target = tmp_path / "balance"
    shutil.copytree(made.library.parent, target)
    return made._replace(library=target / made.library.name, model=target / made.model.name)


def test_a_model_loads_after_its_plugin_is_installed(folder: Path, site: Path, tmp_path: Path) -> None:
    plugin = pristine(tmp_path)
    process = python(loads(plugin), site)
    assert process.stderr.endswith(f"plugin {plugin.name} not found\nElement 'plugin', line 3\n\n")
    assert cmg_mj("plugin", "--install", plugin.library.parent).status == 0
    process = python(
        f"{loads(plugin)}; print(*(name for name in sys.modules if name.split('.')[0] in "
        "('cmg_mj', 'pydantic', 'casadi', 'scipy', 'click')))",
        site,
        "-W",
        "error",
    )
    assert process.stderr == ""
    assert process.stdout.splitlines() == [
        "1",
        "cmg_mj cmg_mj.codegen cmg_mj.codegen.engine_plugin cmg_mj.codegen.engine_plugin.load",
    ]
    assert cmg_mj("plugin", "--uninstall", plugin.name).status == 0
    assert "not found" in python(loads(plugin), site).stderr


def test_a_program_that_loads_the_library_itself(folder: Path, site: Path, tmp_path: Path) -> None:
    """A copy of the installed one is no news; another one of its name is."""
    plugin = pristine(tmp_path)
    assert cmg_mj("plugin", "--install", plugin.library).status == 0
    again = f"import mujoco; mujoco.mj_loadPluginLibrary({str(plugin.library)!r}); {loads(plugin)}"
    process = python(again, site)
    assert (process.stdout, process.stderr) == ("1\n", "")
    example = next(plugin.library.parent.glob("*_example.py")).read_text("utf-8")
    process = python(example.replace("__file__", repr(str(plugin.library))), site)
    assert (process.returncode, process.stderr, process.stdout.count("tilt")) == (0, "", 15)


def test_another_library_of_an_installed_name(folder: Path, site: Path, tmp_path: Path) -> None:
    plugin = pristine(tmp_path)
    name = plugin.name.removeprefix("cmg_mj.")
    assert cmg_mj("plugin", "--install", plugin.library).status == 0
    arguments = ("plugin", "gyro_free", "--name", name, "--set", "controller.rate_hz=100", "--out", tmp_path / "new")
    outcome = cmg_mj(*arguments)
    assert outcome.status == 0
    hint = f"cmg-mj: hint: {plugin.name} is installed from another library: cmg-mj plugin --install {tmp_path}/new"
    assert hint in outcome.err
    library, model = (tmp_path / "new" / file for file in (plugin.library.name, f"{name}.xml"))
    program = f"import mujoco; mujoco.set_mju_user_warning(print); mujoco.mj_loadPluginLibrary({str(library)!r}); "
    process = python(program + LOAD.format(model=str(model)), site)
    assert "from another library, which stays in force" in process.stdout
    assert "the model was written with another library" in process.stderr
    example = (tmp_path / "new" / f"{name}_example.py").read_text("utf-8")
    quiet = "import mujoco; mujoco.set_mju_user_warning(print)\n"  # no log
    process = python(quiet + example.replace("__file__", repr(str(library))), site)
    assert process.returncode == 1
    assert f"Was a copy installed? cmg-mj plugin --install {tmp_path}/new, or --uninstall {name}" in process.stderr
    assert "Traceback" not in process.stderr
    assert cmg_mj("plugin", "--install", library).status == 0
    assert python(LOAD.format(model=str(model)), site).stdout == "1\n"


def test_mujoco_is_imported_whatever_is_wrong(folder: Path, site: Path, tmp_path: Path) -> None:
    plugin = pristine(tmp_path)
    assert cmg_mj("plugin", "--install", plugin.library).status == 0
    manifest = next(folder.glob("*.json"))
    (folder / "aaa.json").write_text("{", encoding="utf-8")
    process = python(loads(plugin), site)
    (line,) = process.stderr.splitlines()
    assert "RuntimeWarning: cmg_mj.aaa is not loaded: its manifest aaa.json" in line
    assert process.stdout == "1\n"
    assert python("import mujoco", site, "-W", "error").returncode == 0
    manifest.write_text(manifest.read_text("utf-8").replace('"4.', '"5.'), encoding="utf-8")
    folder.chmod(0o770)
    (line,) = python("import mujoco", site).stderr.splitlines()
    assert "its mode is 0770 and must be 0700" in line
    folder.chmod(0o700)
    assert len(python("import mujoco", site).stderr.splitlines()) == 2


def test_a_run_with_a_plugin_beside_an_installed_one(folder: Path, site: Path, tmp_path: Path) -> None:
    plugin = pristine(tmp_path)
    assert cmg_mj("plugin", "--install", plugin.library).status == 0
    command = ["run", "push_recovery", "--driver", "plugin", "--set", "duration_s=2.5", "--json", "--out", "."]
    program = f"from cmg_mj.cli import main; import os; os.chdir({str(tmp_path)!r}); main({command!r})"
    process = python(program, site)
    assert process.returncode == 0, process.stderr
    assert '"outcome": "done"' in process.stdout


def compile_library(folder: Path, code: str, *flags: str) -> Path:
    library = folder / "libcmg_mj_balance.so"
    source = folder / "balance.c"
    source.write_text(code, encoding="utf-8")
    subprocess.run([str(COMPILER), "-shared", "-fPIC", str(source), "-o", str(library), *flags], check=True)
    return library


AT_ONCE = "__attribute__((constructor)) static void at_once(void) {{ {} }}"
STRANGE = {
    "no plugin": ("int x;", "its library is no plugin of MuJoCo"),
    "a crash": ("void abort(void);" + AT_ONCE.format("abort();"), "crashed the process that loaded it (signal 6)"),
    "no end": (AT_ONCE.format("for (;;) {}"), "has not loaded within 5 s, where milliseconds are usual"),
    "an unknown function": ("int missing(void); int x(void) { return missing(); }", "undefined symbol: missing"),
    "an exit": ("void exit(int); " + AT_ONCE.format("exit(0);"), "ended the process that loaded it"),
}


@pytest.mark.parametrize("case", STRANGE)
def test_a_library_that_is_not_installed(
    case: str, folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if case == "no end":
        monkeypatch.setattr(installing, "LONGEST_TRIAL", 5.0)
    code, reason = STRANGE[case]
    complaint = cmg_mj("plugin", "--install", compile_library(tmp_path, code, "-Wl,-z,now")).complaint
    assert complaint.startswith(f"--install {tmp_path}/libcmg_mj_balance.so: ")
    assert reason in complaint
    assert list(folder.iterdir()) == []


def test_files_that_are_no_library_of_this_mujoco(folder: Path, tmp_path: Path) -> None:
    library = pristine(tmp_path).library
    target = tmp_path / "libcmg_mj_balance.so"
    content = library.read_bytes()
    for changed, reason in {
        b"": "too short",
        b"no library": "does not load: ",
        content[: len(content) // 2]: "crashed",  # where it is mapped beyond its end
        content.replace(b"libmujoco.so.4.", b"libmujoco.so.5."): "libmujoco.so.5.",
        content: "has no plugin cmg_mj.balance",  # but one of another name
    }.items():
        target.write_bytes(changed)
        complaint = cmg_mj("plugin", "--install", target).complaint
        assert complaint.startswith(f"--install {target}: ")
        assert reason in complaint
    assert list(folder.iterdir()) == []


def test_what_it_costs(folder: Path, site: Path, tmp_path: Path) -> None:
    assert cmg_mj("plugin", "--install", pristine(tmp_path).library).status == 0
    program = (
        "import time; begin = time.process_time(); import importlib.metadata as metadata; search, at = "
        "metadata.entry_points, []\n"
        "def entry_points(**arguments):\n"
        "    result = search(**arguments)\n"
        "    at.append(time.process_time())\n"
        "    return result\n"
        "metadata.entry_points = entry_points; import mujoco; end = time.process_time()\n"
        "print((end - at[0]) / (end - begin))"
    )
    shares = [float(python(program, site).stdout) for _ in range(7)]
    assert statistics.median(shares) < MOST_OF_THE_IMPORT, shares
