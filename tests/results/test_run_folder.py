"""Run folders: a user's files stay, a result is replaced whole or not at all, and one run at a time writes."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from cmg_mj.errors import InputError
from cmg_mj.results.run_folder import RunFolder, Writers, swap, write_text, written_names
from cmg_mj.results.run_folder.manifest import HIDDEN, Manifest
from tests.command import cmg_mj
from tests.run_folders import FILES, assert_whole, names, write

pytestmark = pytest.mark.usefixtures("elsewhere")


@pytest.fixture(autouse=True)
def _short_names(monkeypatch: pytest.MonkeyPatch) -> None:
    """As if cmg_mj wrote files of these names."""
    monkeypatch.setattr(written_names, "NAMES", (*written_names.NAMES, "[a-d]"))


@pytest.fixture(params=["folders change names", "files are moved"])
def swap_method(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    """Both ways in which a result takes its place; the first where the system can."""
    if request.param == "files are moved":
        monkeypatch.setattr(swap, "_swap_folders", lambda new, folder, lock: False)
    return request.param


def writers(text: str, *files: str) -> Writers:
    return dict.fromkeys(files, lambda path: write_text(path, text))


def fill(path: str, text: str, *files: str, complete: bool = True) -> Path:
    """A result of some files that all hold this text."""
    with RunFolder(Path(path)) as folder:
        return folder.write(writers(text, *files), complete=complete)


def holds(path: str) -> dict[str, str]:
    """Every file that a user sees in a folder, and what is in it."""
    files = [file for file in sorted(Path(path).rglob("*")) if file.is_file() and HIDDEN not in file.parts]
    return {str(file.relative_to(path)): file.read_text().rstrip() for file in files}


def everything(path: str) -> list[str]:
    return sorted(str(file.relative_to(path)) for file in Path(path).rglob("*"))


def quick(**fields: object) -> str:
    lines = [f"{name} = {value}" for name, value in ({"duration_s": 0.1} | fields).items()]
    return write("\n".join(lines), "quick.toml")


# --- a user's files ------------------------------------------------------------------------------------------


USERS = {"notes.txt": "mine", "plot.png": "a picture", "trajectory-mine.parquet": "rows", "sub/deep.txt": "deep"}


@pytest.mark.daily_cases("folders change names-True", "files are moved-True")
@pytest.mark.parametrize("with_folders", [False, True])
def test_a_users_files_survive_every_command(swap_method: str, with_folders: bool) -> None:
    user_files = {name: text for name, text in USERS.items() if with_folders or "/" not in name}
    for name, text in user_files.items():
        write(text, f"it/{name}")
    os.symlink("nowhere", "it/dangling")
    inode = Path("it/notes.txt").stat().st_ino
    for command in (["run"], ["compare", "--observers", "linear,ltv", "--worlds", "1"], ["run", "--observer", "ltv"]):
        outcome = cmg_mj(command[0], quick(), *command[1:], "--out", "it")
        assert outcome.status == 0, outcome
        assert user_files.items() <= {name: (Path("it") / name).read_text() for name in user_files}.items()
        assert os.readlink("it/dangling") == "nowhere"
    assert Path("it/notes.txt").stat().st_ino == inode
    assert {"trajectory-linear.parquet", "trajectory-ltv.parquet"} & set(names("it")) == set()
    assert set(FILES) <= set(names("it"))
    assert sorted(os.listdir()) == ["it", "quick.toml"]


@pytest.mark.parametrize("name", [*FILES, "plot.png"])
def test_a_users_file_is_not_written_over(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """It is found before anything is run."""
    monkeypatch.setattr("cmg_mj.simulation.experiment.simulate", pytest.fail)
    write("mine", f"it/{name}")
    outcome = cmg_mj("run", quick(), "--plot", "--out", "it")
    assert outcome.complaint == (
        f"--out it: {name} there is not as cmg-mj wrote it, and would be lost: move it, or name another folder"
    )
    assert everything("it") == [name]
    assert Path(f"it/{name}").read_text() == "mine"


def test_all_that_a_comparison_writes_is_known_before(monkeypatch: pytest.MonkeyPatch) -> None:
    command = ["compare", quick(), "--observers", "linear,ltv", "--worlds", "1", "--out"]
    assert cmg_mj(*command, "first").status == 0
    monkeypatch.setattr("cmg_mj.simulation.experiment.simulate", pytest.fail)
    for name in names("first"):
        write("mine", f"{name}/{name}")
        assert f"{name} there is not as cmg-mj wrote it" in cmg_mj(*command, name).complaint


def test_what_a_user_has_changed_is_the_users() -> None:
    fill("it", "old", "a", "b")
    write("improved", "it/a")
    with pytest.raises(InputError, match="a there is not as cmg-mj wrote it"):
        RunFolder(Path("it"), ["a"])
    assert fill("it", "new", "b") == Path("it")
    assert holds("it") == {"a": "improved", "b": "new"}


def test_a_folder_without_a_list_of_its_files_is_the_users() -> None:
    fill("it", "old", "a", "b")
    shutil.rmtree(f"it/{HIDDEN}")
    with pytest.raises(InputError, match="a, b there are not as cmg-mj wrote it"):
        RunFolder(Path("it"), ["a", "b", "c"])
    fill("it", "new", "c")
    assert holds("it") == {"a": "old", "b": "old", "c": "new"}


@pytest.mark.parametrize("broken", ["", "[]", "{}", '{"files": 3, "complete": true}', "\x00"])
def test_a_broken_list_is_none(broken: str) -> None:
    fill("it", "old", "a")
    write(broken, f"it/{HIDDEN}/files.json")
    assert Manifest.read(Path("it")) == Manifest()
    fill("it", "new", "b")
    assert holds("it") == {"a": "old", "b": "new"}


def test_a_link_in_the_place_of_a_file_is_the_users() -> None:
    fill("it", "old", "a")
    Path("it/a").rename("elsewhere")
    os.symlink("../elsewhere", "it/a")
    with pytest.raises(InputError, match="a there is not as cmg-mj wrote it"):
        RunFolder(Path("it"), ["a"])


def test_a_file_that_a_user_puts_there_meanwhile_stays(swap_method: str) -> None:
    """The result then stands in a folder of its own."""
    fill("it", "old", "a")
    with RunFolder(Path("it"), ["a", "b"]) as folder:
        write("mine", "it/b")
        assert folder.write(writers("new", "a", "b")) == Path("it/incomplete")
    assert holds("it") == {"a": "old", "b": "mine", "incomplete/a": "new", "incomplete/b": "new"}
    fill("it", "half", "a", "b", complete=False)
    assert holds("it/incomplete") == {"a": "new", "b": "new"}  # complete, whatever its folder is called
    assert holds("it/incomplete-2") == {"a": "half", "b": "half"}


def test_what_comes_while_folders_change_names_comes_along(monkeypatch: pytest.MonkeyPatch) -> None:
    fill("it", "old", "a")
    write("one", "it/saved")
    exchange = swap._exchange

    def and_meanwhile(one: Path, other: Path) -> None:
        write("late", "it/late")
        write("deep", "it/folder/late")
        write("two", "saving")
        os.replace("saving", "it/saved")
        exchange(one, other)

    monkeypatch.setattr(swap, "_exchange", and_meanwhile)
    fill("it", "new", "a")
    assert holds("it") == {"a": "new", "late": "late", "folder/late": "deep", "saved": "one", "saved.1": "two"}
    assert os.listdir() == ["it"]


# --- the old result goes, whole ------------------------------------------------------------------------------


def test_what_a_run_before_has_written_goes(swap_method: str) -> None:
    fill("it", "old", "a", "b", "c")
    fill("it", "new", "b", "d")
    assert holds("it") == {"b": "new", "d": "new"}
    assert everything("it") == [HIDDEN, f"{HIDDEN}/files.json", "b", "d"]


@pytest.mark.slow
def test_a_plot_goes_with_its_run() -> None:
    cmg_mj("run", quick(), "--plot", "--out", "it")
    assert "plot.png" in names("it")
    cmg_mj("run", quick(), "--seed", 1, "--out", "it")
    assert_whole("it")


def test_an_interrupted_run_does_not_replace_a_complete_one(swap_method: str) -> None:
    assert fill("it", "half", "a", "b", complete=False) == Path("it")  # where there is none it is better than nothing
    assert fill("it", "less", "a", complete=False) == Path("it")
    assert holds("it") == {"a": "less"}
    fill("it", "whole", "a", "b")
    for text in ("half", "quarter"):
        assert fill("it", text, "a", "b", complete=False) == Path("it/incomplete")
        assert holds("it") == {"a": "whole", "b": "whole", "incomplete/a": text, "incomplete/b": text}
    write("mine", "it/incomplete/notes")
    fill("it", "next", "a")
    assert holds("it") == {"a": "next", "incomplete/notes": "mine"}


def test_what_was_set_aside_stays_until_a_complete_result_comes(swap_method: str) -> None:
    with RunFolder(Path("it")) as folder:
        write("mine", "it/a")
        assert folder.write(writers("whole", "a", "b")) == Path("it/incomplete")
    assert fill("it", "half", "b", complete=False) == Path("it")
    assert holds("it") == {"a": "mine", "b": "half", "incomplete/a": "whole", "incomplete/b": "whole"}
    fill("it", "next", "b")
    assert holds("it") == {"a": "mine", "b": "next"}


def test_a_result_that_has_been_deleted_is_replaced() -> None:
    fill("it", "whole", "a", "b")
    Path("it/a").unlink()
    assert fill("it", "half", "a", complete=False) == Path("it")


def fail(path: Path) -> None:
    path.write_text("begun")
    raise OSError(28, "No space left on device")


def test_what_cannot_be_written_whole_replaces_nothing(swap_method: str) -> None:
    fill("it", "old", "a", "b")
    with RunFolder(Path("it")) as folder, pytest.raises(InputError) as info:
        folder.write({"b": fail, **writers("new", "a")})
    assert str(info.value) == "it/incomplete/b: cannot be written: No space left on device"
    assert holds("it") == {"a": "old", "b": "old", "incomplete/a": "new"}


def test_nothing_written_leaves_all_as_it_was(swap_method: str) -> None:
    fill("it", "old", "a")
    before = everything("it")
    with RunFolder(Path("it")) as folder, pytest.raises(InputError, match=r"^it/a: cannot be written: No space"):
        folder.write({"a": fail})
    assert everything("it") == before
    with RunFolder(Path("other/new")):
        pass
    assert os.listdir() == ["it"]


# --- places --------------------------------------------------------------------------------------------------


def inside_it(patch: pytest.MonkeyPatch) -> Path:
    os.chdir("it")
    return Path()


def by_a_link(patch: pytest.MonkeyPatch) -> Path:
    os.symlink("it", "link")
    return Path("link")


def nothing_beside_it(patch: pytest.MonkeyPatch) -> Path:
    """As if the folder above could not be written."""
    write("", f".it{HIDDEN}")
    return Path("it")


def without_links(patch: pytest.MonkeyPatch) -> Path:
    def link(*arguments: object, **options: object) -> None:
        raise PermissionError(1, "Operation not permitted")

    patch.setattr(os, "link", link)
    return Path("it")


def without_swapping(patch: pytest.MonkeyPatch) -> Path:
    """A system that does not know of it, a mount point."""

    def exchange(source: Path, target: Path) -> None:
        raise OSError(16, "Device or resource busy")

    patch.setattr(swap, "_exchange", exchange)
    return Path("it")


PLACES = [inside_it, by_a_link, nothing_beside_it, without_links, without_swapping]


@pytest.mark.parametrize("place", PLACES, ids=lambda place: place.__name__)
def test_places(place: Callable[[pytest.MonkeyPatch], Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    fill("it", "old", "a", "b")
    write("mine", "it/notes")
    neighbours = sorted(os.listdir())
    inode = Path("it").stat().st_ino
    path = place(monkeypatch)
    with RunFolder(path) as folder:
        assert folder.write(writers("new", "a", "c")) == path
    assert holds(str(tmp_path / "it")) == {"a": "new", "c": "new", "notes": "mine"}
    assert everything(str(tmp_path / "it")) == [HIDDEN, f"{HIDDEN}/files.json", "a", "c", "notes"]
    if place is inside_it:
        assert (tmp_path / "it").stat().st_ino == inode  # whoever stands there still does
        assert sorted(os.listdir("..")) == neighbours


def test_a_folder_keeps_its_permissions() -> None:
    fill("it", "old", "a")
    Path("it").chmod(0o2750)
    fill("it", "new", "a")
    assert Path("it").stat().st_mode & 0o7777 == 0o2750


def test_a_folder_that_is_taken_away_meanwhile_is_made_again() -> None:
    with RunFolder(Path("it")) as folder:
        shutil.rmtree("it")
        assert folder.write(writers("new", "a")) == Path("it")
    assert holds("it") == {"a": "new"}


# --- two at once ---------------------------------------------------------------------------------------------


def test_the_second_of_two_runs_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    fill("it", "old", "a")
    before = everything("it")
    with RunFolder(Path("it")):
        monkeypatch.setattr("cmg_mj.simulation.experiment.simulate", pytest.fail)
        for command in (["run", quick()], ["compare", quick()], ["tune", quick()], ["reproduce", "dao2023"]):
            assert cmg_mj(*command, "--out", "it").complaint == "--out it: another run is writing to it"
    assert everything("it") == before


def test_without_out_the_second_goes_elsewhere() -> None:
    with RunFolder(Path("runs/quick-homogeneous-0")):
        assert cmg_mj("run", quick(), "--json").status == 0
    assert os.listdir("runs") == ["quick-homogeneous-0-2"]


def test_the_same_run_again_goes_to_the_same_folder() -> None:
    for _ in range(2):
        cmg_mj("run", quick(), "--json")
    assert os.listdir("runs") == ["quick-homogeneous-0"]
    cmg_mj("run", quick(duration_s=0.2), "--json")
    Path("runs/quick-homogeneous-0-3").mkdir()  # nothing is in it
    Path("runs/quick-homogeneous-0/scenario.toml").write_text("mine")
    cmg_mj("run", quick(), "--json")
    assert sorted(os.listdir("runs")) == ["quick-homogeneous-0", "quick-homogeneous-0-2", "quick-homogeneous-0-3"]
    assert Path("runs/quick-homogeneous-0/scenario.toml").read_text() == "mine"
    assert_whole("runs/quick-homogeneous-0-3")


def test_a_list_tells_what_is_whose() -> None:
    cmg_mj("run", quick(), "--out", "it")
    file_list = json.loads(Path(f"it/{HIDDEN}/files.json").read_text())
    assert file_list["complete"] is True
    assert sorted(file_list["files"]) == FILES
