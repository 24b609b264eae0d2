"""Installing, listing and removing plugins, several processes at a time; and the commands that do so."""

from __future__ import annotations

import json
import os
import threading
import time
from importlib.metadata import EntryPoint, version
from pathlib import Path

import pytest

from cmg_mj import InputError
from cmg_mj.codegen.engine_plugin import install as installing
from cmg_mj.codegen.engine_plugin.install import find_library, has_another, install, list_plugins, uninstall
from tests.codegen.engine_plugin.fake_libraries import files_in, library_in, make_library
from tests.command import cmg_mj

pytestmark = pytest.mark.usefixtures("folder")

MUJOCO = version("mujoco")


def test_a_second_library_takes_the_place_of_the_first(folder: Path, tmp_path: Path) -> None:
    first = install(make_library(tmp_path))
    (folder / ".balance.json.4711.partial").write_text("of a killed process", encoding="utf-8")
    other = install(make_library(tmp_path, "other"))
    assert not has_another(make_library(tmp_path))
    assert has_another(make_library(tmp_path, content="better code"))
    second = install(make_library(tmp_path, content="better code"))
    assert second.library != first.library
    assert files_in(folder) == sorted(["balance.json", second.library, "other.json", other.library])


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
    assert outcome.err.endswith("Remove it: cmg-mj plugin --uninstall balance\n")
    assert len(outcome.err.splitlines()) == 1
    (tmp_path / "other").mkdir()
    other = make_library(tmp_path / "other", content="another robot")
    expected = f"cmg-mj: the library replaces the one from {library}, whose models no longer load"
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
    ("value", "is_called"), [("cmg_mj.codegen.engine_plugin.load:load", True), ("other:load", False)]
)
def test_a_package_that_mujoco_does_not_call(
    value: str, is_called: bool, folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its metadata have no entry point: it was installed before it had plugins."""
    points = {"mujoco.plugins": [EntryPoint("cmg_mj", value, "mujoco.plugins")]}
    monkeypatch.setattr(installing, "entry_points", lambda group: points[group])
    said = cmg_mj("plugin", "--install", make_library(tmp_path)).err
    assert ("`import mujoco` loads it from now on" in said) == is_called
    for options in ((), ("--json",)):
        said = cmg_mj("plugin", "--list", *options).err
        assert said.startswith("" if is_called else "cmg-mj: hint: `import mujoco` loads no plugin in this Python")
        assert len(said.splitlines()) == (0 if is_called else 1)


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        ((), "name an OBSERVER to make a plugin, or give --install, --uninstall or --list"),
        (("gyro_free", "--list"), "--list does not go with OBSERVER"),
        (("--install", "x", "--uninstall", "y"), "--install does not go with --uninstall"),
        (("--uninstall", "x", "--list"), "--uninstall does not go with --list"),
        (("--install", "x", "--out", "y", "--set", "a=1", "--json"), "--install does not go with --out, --set"),
        (("--list", "--start", "spinning", "--no-sensors"), "--list does not go with --start, --no-sensors"),
    ],
)
def test_what_does_not_go_together(arguments: tuple[str, ...], complaint: str) -> None:
    assert cmg_mj("plugin", *arguments).complaint == f"plugin: {complaint}"
