"""Installed plugins: what goes into the folder, what is loaded from it, and what is refused; no library is compiled."""

from __future__ import annotations

import hashlib
import itertools
import json
import os
import subprocess
import sys
import threading
import time
import tomllib
import warnings
from collections.abc import Callable
from importlib.metadata import EntryPoint, version
from pathlib import Path
from types import SimpleNamespace

import pytest

from cmg_mj import InputError
from cmg_mj.codegen.engine_plugin import install as installing
from cmg_mj.codegen.engine_plugin import load as loading
from cmg_mj.codegen.engine_plugin.install import find_library, has_another, install, list_plugins, uninstall
from cmg_mj.codegen.engine_plugin.load import VARIABLE, library_file, load, plugin_folder
from tests.command import ROOT, cmg_mj, environment

MUJOCO = version("mujoco")
THIS_USER = os.geteuid()
SETTING = os.environ.get(VARIABLE)


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder of the plugins; libraries are taken to load."""
    path = tmp_path / "data" / "plugins"
    monkeypatch.setenv(VARIABLE, str(path))
    monkeypatch.setattr(installing, "_try", lambda library, copy, name: MUJOCO)
    return path


@pytest.fixture
def opened(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Names of the plugins whose libraries `load` opens in a MuJoCo of this version."""
    names: list[str] = []
    monkeypatch.setitem(sys.modules, "mujoco", SimpleNamespace(__version__=MUJOCO))
    monkeypatch.setattr(loading, "open_library", lambda library, name: names.append(name))
    return names


def make_library(tmp_path: Path, name: str = "balance", content: str = "code") -> Path:
    path = tmp_path / f"libcmg_mj_{name}.so"
    path.write_text(content, encoding="utf-8")
    return path


def load_warnings() -> list[str]:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        load()
    assert all(warning.category is RuntimeWarning for warning in caught)
    return [str(warning.message) for warning in caught]


def files_in(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_nothing_is_loaded_that_is_not_installed(folder: Path, opened: list[str]) -> None:
    load()
    assert opened == []
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


def test_what_is_installed_is_loaded(folder: Path, opened: list[str], tmp_path: Path) -> None:
    library = make_library(tmp_path)
    result = install(library)
    assert result.sha256 == hashlib.sha256(b"code").hexdigest()
    assert (folder / result.library).read_bytes() == b"code"
    assert folder.stat().st_mode & 0o777 == 0o700
    assert files_in(folder) == sorted(["balance.json", result.library])
    assert json.loads((folder / "balance.json").read_text("utf-8"))["mujoco"] == MUJOCO
    load()
    assert opened == ["balance"]
    assert [(status.name, status.problem) for status in list_plugins()[1]] == [("balance", "")]
    assert uninstall("cmg_mj.balance") == "cmg_mj.balance"
    assert files_in(folder) == []
    load()
    assert opened == ["balance"]


def test_a_second_library_takes_the_place_of_the_first(folder: Path, tmp_path: Path) -> None:
    first = install(make_library(tmp_path))
    (folder / ".balance.json.4711.partial").write_text("of a killed process", encoding="utf-8")
    other = install(make_library(tmp_path, "other"))
    assert not has_another(make_library(tmp_path))
    assert has_another(make_library(tmp_path, content="better code"))
    second = install(make_library(tmp_path, content="better code"))
    assert second.library != first.library
    assert files_in(folder) == sorted(["balance.json", second.library, "other.json", other.library])


def edit(**changes: object) -> Callable[[Path], None]:
    def change(path: Path) -> None:
        manifest = path / "balance.json"
        manifest.write_text(json.dumps(json.loads(manifest.read_text("utf-8")) | changes), encoding="utf-8")

    return change


def write(text: str) -> Callable[[Path], object]:
    return lambda path: (path / "balance.json").write_text(text, encoding="utf-8")


def library_in(path: Path) -> Path:
    return next(path.glob("balance-*.so"))


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
    case: str, folder: Path, opened: list[str], tmp_path: Path
) -> None:
    damage, reason = DAMAGE[case]
    for name in ("another", "balance", "chair"):
        install(make_library(tmp_path, name))
    damage(folder)
    (warning,) = load_warnings()
    assert warning.startswith("cmg_mj.balance is not loaded: ")
    assert reason in warning
    assert "\n" not in warning
    assert opened == ["another", "chair"]
    problems = {status.name: status.problem for status in list_plugins()[1]}
    assert reason in problems.pop("balance")
    assert problems == {"another": "", "chair": ""}
    if case != "a folder":
        uninstall("balance")
        assert load_warnings() == []


@pytest.mark.parametrize("name", ["a b", "a.b", "4", "ä", "x" * 41, "*", "a\nb"])
def test_a_name_that_is_none(name: str, folder: Path, opened: list[str], tmp_path: Path) -> None:
    installed = install(make_library(tmp_path))
    library = library_file(name, installed.sha256)
    manifest = installed._replace(plugin=f"cmg_mj.{name}", library=library)
    (folder / f"{name}.json").write_text(json.dumps(manifest._asdict()), encoding="utf-8")
    (folder / library).write_text("code", encoding="utf-8")
    (warning,) = load_warnings()
    assert FORGED in warning
    assert "\n" not in warning
    assert opened == ["balance"]
    uninstall(name)  # and nothing else
    assert files_in(folder) == sorted(["balance.json", installed.library])


def test_a_library_that_cannot_be_opened(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It was installed, so that it did load; here it is opened in earnest."""
    monkeypatch.setitem(sys.modules, "mujoco", SimpleNamespace(__version__=MUJOCO))
    install(make_library(tmp_path))
    (warning,) = load_warnings()
    assert warning.startswith("cmg_mj.balance is not loaded: ")


def test_all_are_loaded_before_a_warning_becomes_an_exception(folder: Path, opened: list[str], tmp_path: Path) -> None:
    for name in ("balance", "chair"):
        install(make_library(tmp_path, name))
    library_in(folder).unlink()
    with pytest.raises(RuntimeWarning, match="is missing"):
        load()
    assert opened == ["chair"]


def test_a_warning_is_one_line_on_the_terminal(tmp_path: Path, folder: Path, opened: list[str]) -> None:
    install(make_library(tmp_path))
    library_in(folder).unlink()
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        load()
    (warning,) = caught
    text = warnings.formatwarning(warning.message, warning.category, warning.filename, warning.lineno)
    assert len(text.splitlines()) == 1


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
def test_a_folder_that_others_can_write_to(case: str, folder: Path, opened: list[str], tmp_path: Path) -> None:
    library = make_library(tmp_path)
    install(library)
    change, reason = FOLDERS[case]
    change(folder)
    check_refusal(library, f"{folder} ", reason)
    assert opened == []


def test_a_folder_of_somebody_else(
    folder: Path, opened: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    library = make_library(tmp_path)
    install(library)
    monkeypatch.setattr(os, "geteuid", lambda: THIS_USER + 1)
    check_refusal(library, f"{folder} ", f"belongs to another user (number {THIS_USER})")
    assert opened == []


def test_a_relative_folder(opened: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
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
    folder: Path, opened: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    install(make_library(tmp_path))
    users = itertools.chain([THIS_USER], itertools.repeat(THIS_USER + 1))  # the first call is for the folder
    monkeypatch.setattr(os, "geteuid", lambda: next(users))
    (warning,) = load_warnings()
    assert "is no ordinary file of this user's" in warning


def test_an_empty_variable_switches_loading_off(
    opened: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    install(make_library(tmp_path))
    monkeypatch.setenv(VARIABLE, "")
    load()
    assert opened == []
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


# --- several at a time ---------------------------------------------------------------------------------------


def test_two_installs_at_once(folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    running: list[int] = []

    def try_slowly(library: Path, copy: Path, name: str) -> str:
        running.append(1)
        assert len(running) == 1
        time.sleep(0.05)
        running.pop()
        return MUJOCO

    monkeypatch.setattr(installing, "_try", try_slowly)
    libraries = [
        make_library(tmp_path / str(i), name, str(i))
        for i, name in enumerate(("balance", "balance", "chair"))
        if (tmp_path / str(i)).mkdir() is None
    ]
    threads = [threading.Thread(target=install, args=(library,)) for library in libraries]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert [status.problem for status in list_plugins()[1]] == ["", ""]
    assert len(files_in(folder)) == 4


def test_an_install_that_does_not_end(folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    install(make_library(tmp_path))
    monkeypatch.setattr(installing, "LONGEST_WAIT", 0.0)
    with installing._own_folder(), pytest.raises(InputError, match="another process is writing to"):
        uninstall("balance")


def test_an_install_that_is_interrupted_leaves_what_was(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = install(make_library(tmp_path))

    def interrupt(*arguments: object) -> str:
        assert len(files_in(folder)) == 4  # the lock, and the new library
        raise KeyboardInterrupt

    monkeypatch.setattr(installing, "_try", interrupt)
    with pytest.raises(KeyboardInterrupt):
        install(make_library(tmp_path, content="better code"))
    assert files_in(folder) == sorted(["balance.json", first.library])


def test_a_library_that_is_replaced_while_it_is_loaded(
    folder: Path, opened: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    install(make_library(tmp_path))
    check, checked = loading.check_library, []

    def replace_once(*arguments: object) -> str:
        if not checked:
            checked.append(install(make_library(tmp_path, content="better code")))
        return check(*arguments)  # pyright: ignore[reportArgumentType]

    monkeypatch.setattr(loading, "check_library", replace_once)
    load()
    assert opened == ["balance"]


# --- the command ---------------------------------------------------------------------------------------------


@pytest.mark.usefixtures("elsewhere")
def test_what_install_names(tmp_path: Path) -> None:
    for place in (Path("one"), Path("runs/plugin-balance"), Path("two"), Path("none")):
        place.mkdir(parents=True)
    for place in ("one", "runs/plugin-balance", "two"):
        make_library(Path(place))
    make_library(Path("two"), "other")
    for target in ("one", "./one/", "one/libcmg_mj_balance.so"):
        assert find_library(target) == Path("one/libcmg_mj_balance.so")
    assert find_library("balance") == Path("runs/plugin-balance/libcmg_mj_balance.so")
    Path("text.so").touch()
    os.mkfifo("libcmg_mj_pipe.so")
    make_library(Path(), "run_0")
    for target, complaint in {
        "two": "--install two: holds several libraries, name one of them: libcmg_mj_balance.so, libcmg_mj_other.so",
        "none": "--install none: holds no library libcmg_mj_NAME.so; `cmg-mj plugin` writes one",
        "nine": "--install 'nine': there is no such library or folder, nor a folder runs/plugin-nine",
        "a/b": "--install 'a/b': there is no such library or folder",
        "text.so": "--install text.so: is no library libcmg_mj_NAME.so of `cmg-mj plugin`",
        "libcmg_mj_pipe.so": "--install libcmg_mj_pipe.so: is no library libcmg_mj_NAME.so of `cmg-mj plugin`",
        "libcmg_mj_run_0.so": "--install libcmg_mj_run_0.so: `cmg-mj run` needs run_0 itself; make it with another "
        "--name",
        "": "--install '': name a library, a folder with one, or a plugin",
    }.items():
        assert cmg_mj("plugin", "--install", target).complaint == complaint


@pytest.mark.usefixtures("elsewhere")
def test_command(folder: Path, tmp_path: Path) -> None:
    library = make_library(tmp_path)
    outcome = cmg_mj("plugin", "--install", library)
    assert (outcome.status, outcome.out.split()[:2]) == (0, ["plugin", "cmg_mj.balance"])
    assert outcome.err.endswith("Take it back: cmg-mj plugin --uninstall balance\n")
    assert len(outcome.err.splitlines()) == 1
    (tmp_path / "other").mkdir()
    other = make_library(tmp_path / "other", content="another robot")
    expected = f"cmg-mj: it takes the place of the library from {library}, whose models no longer load"
    assert cmg_mj("plugin", "--install", other).err.splitlines()[0] == expected
    assert json.loads(cmg_mj("plugin", "--install", library, "--json").out)["mujoco"] == MUJOCO
    assert cmg_mj("plugin", "--list").out == f"balance  from {library}\n{folder}\n"
    library_in(folder).write_text("other code", encoding="utf-8")
    (plugin,) = json.loads(cmg_mj("plugin", "--list", "--json").out)["plugins"]
    assert (plugin["name"], plugin["mujoco"], plugin["source"]) == ("balance", MUJOCO, str(library))
    assert "has been changed" in plugin["problem"]
    assert "balance  not loaded: its library" in cmg_mj("plugin", "--list").out
    assert cmg_mj("plugin", "--uninstall", "balence").complaint == (
        "--uninstall 'balence': is not installed; did you mean 'balance'? installed: balance"
    )
    assert cmg_mj("plugin", "--uninstall", "balance").out == "uninstalled cmg_mj.balance\n"
    assert cmg_mj("plugin", "--list").out == f"no plugin is installed\n{folder}\n"


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        ((), "name an OBSERVER to make a plugin, or give --install, --uninstall or --list"),
        (("gyro_free", "--list"), "--list goes without OBSERVER"),
        (("--install", "x", "--uninstall", "y"), "--install goes without --uninstall"),
        (("--uninstall", "x", "--list"), "--uninstall goes without --list"),
        (("--install", "x", "--out", "y", "--set", "a=1", "--json"), "--install goes without --out, --set"),
        (("--list", "--start", "spinning", "--no-sensors"), "--list goes without --start, --no-sensors"),
    ],
)
def test_what_does_not_go_together(arguments: tuple[str, ...], complaint: str) -> None:
    assert cmg_mj("plugin", *arguments).complaint == f"plugin: {complaint}"
