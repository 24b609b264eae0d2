"""Run folders from somebody else: whatever is in them, a run changes nothing outside its own folder."""

from __future__ import annotations

import hashlib
import json
import os
import re
from collections.abc import Callable
from pathlib import Path

import pytest

from cmg_mj.codegen.engine_plugin.build import COMMON_HEADERS, COMMON_SOURCES, library_name
from cmg_mj.codegen.export.names import export_files
from cmg_mj.errors import InputError
from cmg_mj.papers.report import REPORT_FILES
from cmg_mj.replay.save import files_of_replay
from cmg_mj.results.run_folder import RunFolder, write_text
from cmg_mj.results.run_folder.manifest import HIDDEN
from cmg_mj.results.run_folder.written_names import foreign_names
from cmg_mj.studies.sweeps.report import FILES as SWEEP_FILES
from cmg_mj.studies.tuning.save import files_of_study
from tests.command import cmg_mj
from tests.run_folders import FILES, write

VICTIM = "a user's words\n"
DIGEST = hashlib.sha256(VICTIM.encode()).hexdigest()
FORGERIES: dict[str, Callable[[], object]] = {}
Forgery = Callable[[], object]


def forgery(function: Forgery) -> Forgery:
    FORGERIES[function.__name__.replace("_", " ")] = function
    return function


def manifest(folder: str, *names: str, digest: object = DIGEST) -> None:
    """Write a list of a folder's files such as cmg_mj writes, with these names."""
    stored = {"written_by": "cmg_mj 0.1.0", "complete": True, "files": dict.fromkeys(names, digest)}
    write(json.dumps(stored), f"{folder}/{HIDDEN}/files.json")


def ready(name: str) -> None:
    """Make a result that only has to be moved into its folder, with a file of this name."""
    manifest(f"got/{HIDDEN}/ready", name)
    write("planted", f"got/{HIDDEN}/ready/{name}")


def link(path: str, target: str) -> None:
    Path(path).parent.mkdir(parents=True, exist_ok=True)
    os.symlink(Path(target).absolute(), path)


@forgery
def a_ready_file_one_level_up() -> None:
    ready("../planted.py")


@forgery
def a_ready_file_two_levels_up() -> None:
    ready("../../planted.py")


@forgery
def a_ready_file_through_a_link() -> None:
    link("got/elsewhere", "user")
    ready("elsewhere/planted.py")


@forgery
def a_ready_file_with_a_whole_path() -> None:
    manifest(f"got/{HIDDEN}/ready", str(Path("user/victim.txt").absolute()))


@forgery
def a_ready_file_with_backslashes() -> None:
    ready("..\\planted.py")


@forgery
def a_ready_file_that_is_a_link() -> None:
    manifest(f"got/{HIDDEN}/ready", "summary.json")
    link(f"got/{HIDDEN}/ready/summary.json", "user/victim.txt")


@forgery
def a_list_with_a_users_file_beside_the_folder() -> None:
    manifest("got", "../user/victim.txt", "victim.txt")
    ready("summary.json")


@forgery
def a_list_with_a_users_file_by_its_whole_path() -> None:
    manifest("got", str(Path("user/victim.txt").absolute()), "victim.txt")
    ready("summary.json")


@forgery
def a_list_with_the_folder_above() -> None:
    manifest("got", "..")


@forgery
def a_list_with_no_name() -> None:
    manifest("got", "")


@forgery
def a_list_without_digests() -> None:
    manifest("got", "summary.json", digest=None)


@forgery
def a_list_that_is_a_link() -> None:
    manifest("user", "victim.txt")
    link(f"got/{HIDDEN}/files.json", f"user/{HIDDEN}/files.json")


@forgery
def a_list_that_is_a_pipe() -> None:
    os.makedirs(f"got/{HIDDEN}")
    os.mkfifo(f"got/{HIDDEN}/files.json")


@forgery
def a_list_in_a_million_brackets() -> None:
    write("[" * 1_000_000, f"got/{HIDDEN}/files.json")


@forgery
def a_hidden_folder_that_is_a_link() -> None:
    write("mine", "user/new/notes.txt")
    link(f"got/{HIDDEN}", "user")


@forgery
def a_hidden_folder_that_links_to_a_ready_one() -> None:
    manifest("user/ready", "notes.txt")
    write("mine", "user/ready/notes.txt")
    link(f"got/{HIDDEN}", "user")


@forgery
def a_new_result_that_is_a_link() -> None:
    link(f"got/{HIDDEN}/new", "user")


@forgery
def a_ready_result_that_is_a_link() -> None:
    manifest("user", "victim.txt")
    link(f"got/{HIDDEN}/ready", "user")


@forgery
def a_ready_list_that_is_in_a_link() -> None:
    manifest("user", "victim.txt")
    write("planted", f"got/{HIDDEN}/ready/victim.txt")
    link(f"got/{HIDDEN}/ready/{HIDDEN}", f"user/{HIDDEN}")


@forgery
def a_lock_that_is_a_link() -> None:
    link(f"got/{HIDDEN}/lock", "user/victim.txt")


@forgery
def a_lock_that_is_a_link_to_nothing() -> None:
    link(f"got/{HIDDEN}/lock", "user/planted")


@forgery
def a_lock_that_is_a_pipe() -> None:
    os.makedirs(f"got/{HIDDEN}")
    os.mkfifo(f"got/{HIDDEN}/lock")


@forgery
def a_sibling_that_looks_staged() -> None:
    write("", f".got{HIDDEN}/{HIDDEN}/staged")
    write(VICTIM, f".got{HIDDEN}/victim.txt")


@forgery
def a_sibling_with_a_list() -> None:
    manifest(f".got{HIDDEN}", "victim.txt")
    write(VICTIM, f".got{HIDDEN}/victim.txt")


@forgery
def a_sibling_with_a_lock() -> None:
    manifest(f".got{HIDDEN}", "victim.txt")
    write(VICTIM, f".got{HIDDEN}/victim.txt")
    write("", f".got{HIDDEN}/{HIDDEN}/lock")


@forgery
def a_sibling_that_is_a_link() -> None:
    manifest("user", "victim.txt")
    link(f".got{HIDDEN}", "user")


@forgery
def a_result_set_aside_that_is_a_link() -> None:
    manifest("user", "victim.txt")
    link("got/incomplete", "user")


@forgery
def a_result_set_aside_whose_hidden_folder_is_a_link() -> None:
    write("mine", "user/new/notes.txt")
    link(f"got/incomplete/{HIDDEN}", "user")


@forgery
def a_result_set_aside_with_a_ready_file_outside() -> None:
    manifest(f"got/incomplete/{HIDDEN}/ready", "../../planted.py")
    write("planted", f"got/incomplete/{HIDDEN}/planted.py")


@forgery
def a_result_that_is_a_link() -> None:
    manifest("got", "summary.json")
    link("got/summary.json", "user/victim.txt")


@forgery
def a_list_with_a_users_file() -> None:
    write(VICTIM, "got/thesis.txt")
    manifest("got", "thesis.txt")


@forgery
def a_list_with_a_users_c_file() -> None:
    write(VICTIM, "got/thesis.c")
    manifest("got", "thesis.c", "summary.json")


@forgery
def a_list_with_a_number_for_a_digest() -> None:
    manifest("got", "plot.png", digest=5)


@forgery
def a_new_result_with_a_folder_in_it() -> None:
    write(VICTIM, f"got/{HIDDEN}/new/deep/er/mine")


@forgery
def a_ready_result_with_a_folder_in_it() -> None:
    write(VICTIM, f"got/{HIDDEN}/ready/deep/er/mine")


@forgery
def a_list_beside_a_folder() -> None:
    write(VICTIM, f"got/{HIDDEN}/deep/mine")


def outside() -> dict[str, str]:
    """Return everything but what is in the folder of the run: kind and content of each name."""
    content = {}
    for path in sorted(Path("../..").resolve().rglob("*")):
        if not path.is_relative_to(Path("got").absolute()):
            text = os.readlink(path) if path.is_symlink() else path.read_text() if path.is_file() else ""
            content[str(path)] = f"{path.lstat().st_mode:o} {path.lstat().st_ino} {text}"
    return content


@pytest.fixture
def forged(request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> dict[str, str]:
    """A forged folder `got`, two folders deep, and what is outside it."""
    (tmp_path / "one" / "two").mkdir(parents=True)
    monkeypatch.chdir(tmp_path / "one" / "two")
    write("duration_s = 0.1", "quick.toml")
    write(VICTIM, "user/victim.txt")
    FORGERIES[request.param]()
    return outside()


@pytest.mark.parametrize("forged", FORGERIES, indirect=True)
def test_a_run_changes_nothing_outside_its_folder(forged: dict[str, str]) -> None:
    """The first result replaces what is there, or is refused in a line; so does one that is not complete."""
    for complete in (True, False):
        complaint = ""
        try:
            with RunFolder(Path("got"), FILES) as folder:
                folder.write(dict.fromkeys(FILES, lambda path: write_text(path, "new")), complete=complete)
        except InputError as error:
            complaint = str(error)
        assert outside() == forged
        assert re.fullmatch("(--out got: [^\n]*, or name another folder)?", complaint)


@pytest.mark.parametrize(
    "forged",
    ["a ready file one level up", "a hidden folder that is a link", "a list with the folder above"],
    indirect=True,
)
def test_a_command_refuses_what_is_not_its_own(forged: dict[str, str]) -> None:
    complaint = cmg_mj("run", "quick.toml", "--out", "got").complaint
    assert complaint.startswith(f"--out got: {HIDDEN} there ")
    assert complaint.endswith(f": remove {HIDDEN}, or name another folder")
    assert outside() == forged


@pytest.mark.parametrize(
    ("forged", "said"),
    [
        ("a list with a users file", "names 'thesis.txt', which cmg-mj never writes"),
        ("a list with a users c file", "names 'thesis.c', which cmg-mj never writes"),
        ("a list with a number for a digest", "gives 5 as the SHA-256 of 'plot.png'"),
    ],
    indirect=["forged"],
)
def test_a_list_that_is_not_as_written_is_refused(forged: dict[str, str], said: str) -> None:
    before = {path.name: path.read_text() for path in Path("got").iterdir() if path.is_file()}
    complaint = cmg_mj("run", "quick.toml", "--out", "got").complaint
    assert complaint == f"--out got: {HIDDEN} there {said}: remove {HIDDEN}, or name another folder"
    assert {path.name: path.read_text() for path in Path("got").iterdir() if path.is_file()} == before


@pytest.mark.parametrize(
    ("forged", "place"),
    [
        ("a new result with a folder in it", "new/deep"),
        ("a ready result with a folder in it", "ready/deep"),
        ("a list beside a folder", "deep"),
    ],
    indirect=["forged"],
)
def test_folders_that_are_not_its_own_stay(forged: dict[str, str], place: str) -> None:
    before = sorted(Path("got").rglob("*"))
    complaint = cmg_mj("run", "quick.toml", "--out", "got").complaint
    assert complaint == (
        f"--out got: {HIDDEN}/{place} there is no folder that cmg-mj makes: remove {HIDDEN}, or name another folder"
    )
    assert sorted(Path("got").rglob("*")) == before


def test_what_the_commands_write_is_listed() -> None:
    names = {
        "sweep": list(SWEEP_FILES),
        "tune": files_of_study([1.0, 2.5]),
        "replay": files_of_replay(["ein Log", "b-2"]),
        "reproduce": REPORT_FILES,
        "export": export_files("my_observer"),
        "plugin": plugin_files("my_rig", "my_rig_roll"),
    }
    assert not [(command, name) for command, files in names.items() for name in foreign_names(files)]
    assert foreign_names(export_files("mine")[:3]) == export_files("mine")[:3]
    assert foreign_names([*plugin_files("mine", "mine"), "thesis.c"]) == ["thesis.c"]
    library, model, *others = plugin_files("mine", "mine")
    assert not foreign_names([model, *others])  # where no compiler is
    assert foreign_names([library, *others]) == [library, *others]


def plugin_files(name: str, axis: str) -> list[str]:
    own = [library_name(name), f"{name}.xml", f"{name}_example.c", f"{name}_example.py", "Makefile", "rig.c"]
    return [*own, f"{axis}.h", f"{axis}.c", f"{axis}_controller.c", *COMMON_HEADERS, *COMMON_SOURCES]
