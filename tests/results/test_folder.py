"""A result is renamed into its place whole, and nothing of anybody else's is touched."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import pytest

from cmg_mj.core.errors import InputError
from cmg_mj.results.folder import MARKER, RunFolder, is_own, write_text
from tests.run_folders import names, write

pytestmark = pytest.mark.usefixtures("elsewhere")


def save(scenario: str = "seed = 1", *, complete: bool = True, overwrite: bool = False, **others: str) -> str:
    """Write a result of some files to `it`; the folder's path."""
    texts = {"scenario.toml": scenario, **{f"{name}.json": text for name, text in others.items()}}
    with RunFolder(Path("it"), overwrite=overwrite) as folder:
        writers = {name: lambda path, text=text: write_text(path, text) for name, text in texts.items()}
        return str(folder.write(writers, complete=complete))


def test_a_rerun_replaces_what_it_wrote() -> None:
    assert save(a="1", b="1") == "it"
    assert save(b="2", c="2") == "it"
    assert names("it") == ["b.json", "c.json", "scenario.toml"]
    assert Path("it/b.json").read_text() == "2\n"
    assert os.listdir() == ["it"]


def test_another_result_is_replaced_only_where_that_is_asked_for() -> None:
    assert [save("seed = 1"), save("seed = 2"), save("seed = 2"), save("seed = 1")] == ["it", "it-2", "it-2", "it"]
    assert save("seed = 2", overwrite=True) == "it"
    assert Path("it/scenario.toml").read_text() == "seed = 2\n"


def test_a_result_comes_back_if_its_successor_cannot_come(monkeypatch: pytest.MonkeyPatch) -> None:
    save(a="1")
    rename = Path.rename

    def fail(path: Path, place: Path) -> Path:
        if path.name.endswith("part"):
            raise OSError(28, "No space left on device")
        return rename(path, place)

    monkeypatch.setattr(Path, "rename", fail)
    with pytest.raises(InputError, match="No space"):
        save(a="2")
    assert Path("it/a.json").read_text() == "1\n"


def users_file() -> None:
    write("mine", "it/notes")


def users_file_of_our_name() -> None:
    write("mine", "it/a.json")


def users_folder() -> None:
    Path("it/mine").mkdir()


def link_to_a_users_file() -> None:
    write("mine", "users")
    Path("it/a.json").unlink()
    Path("it/a.json").symlink_to(Path("users").absolute())


def no_marker() -> None:
    Path("it", MARKER).unlink()


def marker_of_others() -> None:
    write("a.json", f"it/{MARKER}")


def link_in_place_of_the_folder() -> None:
    os.rename("it", "users")
    Path("it").symlink_to("users")


CHANGES = [
    users_file,
    users_folder,
    link_to_a_users_file,
    no_marker,
    marker_of_others,
    link_in_place_of_the_folder,
]


@pytest.mark.parametrize("change", CHANGES, ids=lambda change: change.__name__)
@pytest.mark.parametrize("overwrite", [False, True])
def test_a_folder_that_holds_anything_else_is_left(change: Callable[[], None], overwrite: bool) -> None:
    save(a="1")
    change()
    before = everything()
    assert save(a="2", overwrite=overwrite) == "it-2"
    assert save(a="3", overwrite=overwrite) == "it-2"
    assert {path: text for path, text in everything().items() if not path.startswith("it-2")} == before
    assert Path("it-2/a.json").read_text() == "3\n"


def everything() -> dict[str, str]:
    return {
        str(path): os.readlink(path) if path.is_symlink() else path.read_text() if path.is_file() else ""
        for path in Path().rglob("*")
    }


def test_a_folder_without_a_marker_that_holds_a_file_of_our_name_is_left() -> None:
    users_file_of_our_name()
    assert save(a="2") == "it-2"
    assert Path("it/a.json").read_text() == "mine"


def test_a_marker_that_names_files_elsewhere_removes_none() -> None:
    save(a="1")
    write("mine", "users")
    with Path("it", MARKER).open("a") as marker:
        marker.write("\n../users\n" + str(Path("users").absolute()))
    assert save(a="2") == "it"
    assert Path("users").read_text() == "mine"


def test_an_empty_folder_is_taken() -> None:
    Path("it").mkdir()
    assert save() == "it"


def test_an_incomplete_result_replaces_no_complete_one() -> None:
    assert save(complete=False, a="1") == "it"
    assert save(a="2") == "it"
    assert save(complete=False, overwrite=True, a="3") == "it-2"
    assert save(complete=False, a="4") == "it-2"
    os.remove("it/a.json")  # no longer whole
    assert save(complete=False, a="5") == "it"


@pytest.mark.parametrize("all_or_none", [False, True])
def test_a_file_that_cannot_be_written(all_or_none: bool) -> None:
    save(a="1")

    def fail(path: Path) -> None:
        path.write_text("half")
        raise OSError(28, "No space left on device")

    writers = {"scenario.toml": lambda path: write_text(path, "seed = 1"), "a.json": fail}
    with pytest.raises(InputError, match=r"a\.json: cannot be written: No space left"), RunFolder(Path("it")) as folder:
        folder.write(writers, all_or_none=all_or_none)
    assert Path("it/a.json").read_text() == "1\n"
    assert sorted(os.listdir()) == (["it"] if all_or_none else ["it", "it-2"])
    if not all_or_none:
        assert names("it-2") == ["scenario.toml"]


def test_nothing_written_leaves_nothing() -> None:
    with RunFolder(Path("runs/new/it")):
        pass
    assert os.listdir() == []


@pytest.mark.parametrize("out", [".", "..", "/", "/proc/it", "file", "file/it", "a" * 300])
def test_a_place_that_cannot_be_written(out: str) -> None:
    write("mine", "file")
    with pytest.raises(InputError, match="--out"):
        RunFolder(Path(out))
    assert os.listdir() == ["file"]


def test_two_runs_at_once_write_two_results() -> None:
    with RunFolder(Path("it")) as one, RunFolder(Path("it")) as other:
        assert str(one.write({"study.toml": lambda path: write_text(path, "1")})) == "it"
        assert str(other.write({"study.toml": lambda path: write_text(path, "2")})) == "it-2"
    assert is_own(Path("it"))
    assert is_own(Path("it-2"))


def test_what_a_live_run_is_writing_stays() -> None:
    with RunFolder(Path("it")) as folder:
        save()
        assert folder.part.is_dir()
