"""The entry point that loads installed plugins: what is loaded, and what is refused."""

from __future__ import annotations

import hashlib
import itertools
import json
import os
import subprocess
import sys
import tomllib
import warnings
from collections.abc import Callable
from importlib.metadata import EntryPoint, version
from pathlib import Path
from types import SimpleNamespace

import pytest

from cmg_mj import InputError
from cmg_mj.codegen.engine_plugin import load as loading
from cmg_mj.codegen.engine_plugin.install import has_another, install, list_plugins, uninstall
from cmg_mj.codegen.engine_plugin.load import VARIABLE, library_file, load, plugin_folder
from tests.codegen.engine_plugin.fake_libraries import files_in, library_in, load_warnings, make_library
from tests.command import ROOT, environment

pytestmark = pytest.mark.usefixtures("folder")

MUJOCO = version("mujoco")
THIS_USER = os.geteuid()
SETTING = os.environ.get(VARIABLE)


def test_nothing_is_loaded_that_is_not_installed(folder: Path, open_names: list[str]) -> None:
    load()
    assert open_names == []
    assert not folder.exists()


def test_the_entry_point_is_the_function() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    ((name, value),) = project["entry-points"]["mujoco.plugins"].items()
    assert EntryPoint(name, value, "mujoco.plugins").load() is load


def test_loading_imports_the_standard_library_alone() -> None:
    program = (
        "import sys; from types import SimpleNamespace; before = set(sys.modules)\n"
        "from cmg_mj.codegen.engine_plugin.load import load, check_library, read_manifest\n"
        f"sys.modules['mujoco'] = SimpleNamespace(__version__={MUJOCO!r}); load()\n"
        "new = {name for name in set(sys.modules) - before if name.split('.')[0] not in sys.stdlib_module_names}\n"
        "print(*sorted(new - {'mujoco'}))"
    )
    process = subprocess.run(
        [sys.executable, "-W", "error", "-c", program], env=environment(), capture_output=True, text=True, check=True
    )
    package = "cmg_mj.codegen.engine_plugin.load"
    assert process.stdout.split() == ["cmg_mj", "cmg_mj.codegen", "cmg_mj.codegen.engine_plugin", package]


def test_what_is_installed_is_loaded(folder: Path, open_names: list[str], tmp_path: Path) -> None:
    library = make_library(tmp_path)
    result = install(library)
    assert result.sha256 == hashlib.sha256(b"code").hexdigest()
    assert (folder / result.library).read_bytes() == b"code"
    assert folder.stat().st_mode & 0o777 == 0o700
    assert files_in(folder) == sorted(["balance.json", result.library])
    assert json.loads((folder / "balance.json").read_text("utf-8"))["mujoco"] == MUJOCO
    load()
    assert open_names == ["balance"]
    assert [(status.name, status.problem) for status in list_plugins()[1]] == [("balance", "")]
    assert uninstall("cmg_mj.balance") == "cmg_mj.balance"
    assert files_in(folder) == []
    load()
    assert open_names == ["balance"]


def edit(**changes: object) -> Callable[[Path], None]:
    def change(path: Path) -> None:
        manifest = path / "balance.json"
        manifest.write_text(json.dumps(json.loads(manifest.read_text("utf-8")) | changes), encoding="utf-8")

    return change


def write(text: str) -> Callable[[Path], object]:
    return lambda path: (path / "balance.json").write_text(text, encoding="utf-8")


def link(target: Callable[[Path], Path]) -> Callable[[Path], None]:
    def change(path: Path) -> None:
        file = target(path)
        file.rename(path / "elsewhere")
        file.symlink_to("elsewhere")

    return change


def pad(path: Path) -> None:
    manifest = path / "balance.json"
    manifest.write_text(" " * 70000 + manifest.read_text("utf-8"), encoding="utf-8")


def put_pipe(path: Path) -> None:
    (path / "balance.json").unlink()
    os.mkfifo(path / "balance.json")


FORGED = "has not been written by this package"
DAMAGE: dict[str, tuple[Callable[[Path], object], str]] = {
    "another checksum": (lambda path: library_in(path).write_bytes(b"Code"), "has been changed (SHA-256)"),
    "no library": (lambda path: library_in(path).unlink(), "is missing"),
    "another MuJoCo": (edit(mujoco="4.0.1"), f"it is for MuJoCo 4.0.1, and this is {MUJOCO}"),
    "no MuJoCo": (edit(mujoco=None), FORGED),
    "a library elsewhere": (edit(library="../../libcmg_mj_balance.so"), FORGED),
    "an absolute library": (edit(library="/lib/libc.so.6"), FORGED),
    "a checksum that is none": (edit(sha256="../" * 21 + "x"), FORGED),
    "another plugin's manifest": (edit(plugin="cmg_mj.other"), FORGED),
    "a key more": (edit(command="rm"), FORGED),
    "no JSON": (write("{"), FORGED),
    "no text": (lambda path: (path / "balance.json").write_bytes(b"\xff\xfe\0"), FORGED),
    "a list": (write("[]"), FORGED),
    "a number": (write("1"), FORGED),
    "JSON without end": (write("[" * 60000), FORGED),
    "a very large file": (pad, FORGED),
    "a linked library": (link(library_in), "is no ordinary file"),
    "a linked manifest": (link(lambda path: path / "balance.json"), "is no ordinary file"),
    "a pipe": (put_pipe, "is no ordinary file"),
    "a folder": (lambda path: [(path / "balance.json").unlink(), (path / "balance.json").mkdir()], "is no ordinary"),
}


@pytest.mark.parametrize("case", DAMAGE)
def test_a_damaged_plugin_is_a_warning_and_the_others_are_loaded(
    case: str, folder: Path, open_names: list[str], tmp_path: Path
) -> None:
    damage, reason = DAMAGE[case]
    for name in ("another", "balance", "chair"):
        install(make_library(tmp_path, name))
    damage(folder)
    (warning,) = load_warnings()
    assert warning.startswith("cmg_mj.balance is not loaded: ")
    assert reason in warning
    assert "\n" not in warning
    assert open_names == ["another", "chair"]
    problems = {status.name: status.problem for status in list_plugins()[1]}
    assert reason in problems.pop("balance")
    assert problems == {"another": "", "chair": ""}
    if case != "a folder":
        uninstall("balance")
        assert load_warnings() == []


@pytest.mark.parametrize("name", ["a b", "a.b", "4", "ä", "x" * 41, "*", "a\nb"])
def test_a_name_that_is_none(name: str, folder: Path, open_names: list[str], tmp_path: Path) -> None:
    plugin = install(make_library(tmp_path))
    library = library_file(name, plugin.sha256)
    manifest = plugin._replace(plugin=f"cmg_mj.{name}", library=library)
    (folder / f"{name}.json").write_text(json.dumps(manifest._asdict()), encoding="utf-8")
    (folder / library).write_text("code", encoding="utf-8")
    (warning,) = load_warnings()
    assert FORGED in warning
    assert "\n" not in warning
    assert open_names == ["balance"]
    uninstall(name)  # and nothing else
    assert files_in(folder) == sorted(["balance.json", plugin.library])


def test_a_library_that_cannot_be_opened(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It was installed, so that it did load; here it is opened in earnest."""
    monkeypatch.setitem(sys.modules, "mujoco", SimpleNamespace(__version__=MUJOCO))
    install(make_library(tmp_path))
    (warning,) = load_warnings()
    assert warning.startswith("cmg_mj.balance is not loaded: ")


def test_all_are_loaded_before_a_warning_becomes_an_exception(
    folder: Path, open_names: list[str], tmp_path: Path
) -> None:
    for name in ("balance", "chair"):
        install(make_library(tmp_path, name))
    library_in(folder).unlink()
    with pytest.raises(RuntimeWarning, match="is missing"):
        load()
    assert open_names == ["chair"]


def test_a_warning_is_one_line_on_the_terminal(tmp_path: Path, folder: Path, open_names: list[str]) -> None:
    install(make_library(tmp_path))
    library_in(folder).unlink()
    with warnings.catch_warnings(record=True) as records:
        warnings.simplefilter("always")
        load()
    (warning,) = records
    text = warnings.formatwarning(warning.message, warning.category, warning.filename, warning.lineno)
    assert len(text.splitlines()) == 1


def test_a_library_that_is_replaced_while_it_is_loaded(
    folder: Path, open_names: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    install(make_library(tmp_path))
    check, replacements = loading.check_library, []

    def replace_once(*arguments: object) -> str:
        if not replacements:
            replacements.append(install(make_library(tmp_path, content="better code")))
        return check(*arguments)  # pyright: ignore[reportArgumentType]

    monkeypatch.setattr(loading, "check_library", replace_once)
    load()
    assert open_names == ["balance"]


# --- whose folder it is --------------------------------------------------------------------------------------


def replace_by_link(path: Path) -> None:
    path.rename(path.with_name("elsewhere"))
    path.symlink_to("elsewhere")


def replace_by_file(path: Path) -> None:
    path.rename(path.with_name("elsewhere"))
    path.write_text("", encoding="utf-8")


FOLDERS: dict[str, tuple[Callable[[Path], None], str]] = {
    "0770": (lambda path: path.chmod(0o770), "its mode is 0770 and must be 0700"),
    "0720": (lambda path: path.chmod(0o720), "its mode is 0720 and must be 0700"),
    "0755": (lambda path: path.chmod(0o755), "its mode is 0755 and must be 0700"),
    "1777": (lambda path: path.chmod(0o1777), "its mode is 1777 and must be 0700"),
    "a link": (replace_by_link, "is no folder, but a link"),
    "a file": (replace_by_file, "is no folder, but a file"),
}


@pytest.mark.parametrize("case", FOLDERS)
def test_a_folder_that_others_can_write_to(case: str, folder: Path, open_names: list[str], tmp_path: Path) -> None:
    library = make_library(tmp_path)
    install(library)
    change, reason = FOLDERS[case]
    change(folder)
    check_refusal(library, f"{folder} ", reason)
    assert open_names == []


def test_a_folder_of_somebody_else(
    folder: Path, open_names: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    library = make_library(tmp_path)
    install(library)
    monkeypatch.setattr(os, "geteuid", lambda: THIS_USER + 1)
    check_refusal(library, f"{folder} ", f"belongs to another user (number {THIS_USER})")
    assert open_names == []


def test_a_relative_folder(open_names: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(VARIABLE, "plugins")
    check_refusal(make_library(tmp_path), "CMG_MJ_PLUGINS=plugins: ", "must be an absolute path")


def check_refusal(library: Path, where: str, reason: str) -> None:
    """All that is asked of such a folder ends in one line."""
    (warning,) = load_warnings()
    assert warning.startswith(f"no plugin is loaded: {where}")
    assert reason in warning
    for act in (lambda: install(library), lambda: uninstall("balance"), list_plugins):
        with pytest.raises(InputError) as error:
            act()
        assert str(error.value).startswith(f"plugin: {where}")
        assert reason in str(error.value)
    assert not has_another(library)


def test_the_libraries_of_somebody_else(
    folder: Path, open_names: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    install(make_library(tmp_path))
    users = itertools.chain([THIS_USER], itertools.repeat(THIS_USER + 1))  # the first call is for the folder
    monkeypatch.setattr(os, "geteuid", lambda: next(users))
    (warning,) = load_warnings()
    assert "is no ordinary file of this user's" in warning


def test_an_empty_variable_switches_loading_off(
    open_names: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    install(make_library(tmp_path))
    monkeypatch.setenv(VARIABLE, "")
    load()
    assert open_names == []
    assert list_plugins() == ("", [])
    with pytest.raises(InputError, match="CMG_MJ_PLUGINS is empty"):
        install(make_library(tmp_path))


def test_where_the_folder_is(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(VARIABLE)
    monkeypatch.setenv("HOME", "/home/somebody")
    for data, place in {
        "/srv/data": "/srv/data",
        "": "/home/somebody/.local/share",
        "relative": "/home/somebody/.local/share",
    }.items():
        monkeypatch.setenv("XDG_DATA_HOME", data)
        assert plugin_folder() == f"{place}/cmg_mj/plugins"


def test_the_tests_load_no_plugin_of_the_users() -> None:
    assert SETTING == ""
