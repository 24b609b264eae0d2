"""What a mount replaces and takes away: its own files alone, as it wrote them, and what a killed one left."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import mujoco
import pytest

from cmg_mj.errors import InputError
from cmg_mj.plant.mounting import mount
from cmg_mj.plant.mounting.target import check_replaceable, claimed_target
from cmg_mj.results.run_folder.lock import Lock
from cmg_mj.results.signed_text import is_as_written, is_begun, signed
from tests.command import HANGS_AFTER_S, cmg_mj, environment
from tests.plant.mounting.robots import EXAMPLES
from tests.studies.push_limits.robots import PENDULUM

pytestmark = pytest.mark.usefixtures("elsewhere")

GIVEN = ("mount", str(EXAMPLES / "torso.xml"), "--body", "torso", "--axis", "x", "--scale", "1.3", "-o", "b.xml")
MODEL, SCENARIO = signed("<mujoco/>\n", ".xml"), signed("seed = 1\n", ".toml")
ENDED = 2**22 + 1
"""No process' number: Linux has none above 2**22."""
KILLED = """
import os, signal, sys
from tests.command import main
import cmg_mj.studies.push_limits.mount_files as files
def kill(*_):
    os.kill(os.getpid(), signal.SIGKILL)
{where}
main(sys.argv[1:])
"""
KILLED_AT = {
    "its prospects": "files.prospects = kill",
    "a larger scale": "files.simulated_push, files.standing_unpushed = lambda *_: files.SimulatedPush(3), kill",
}


def there() -> list[str]:
    return sorted(os.listdir())


def test_a_signed_file_is_known_until_it_is_changed() -> None:
    for name, content in ("b.xml", MODEL), ("b.toml", SCENARIO):
        path = Path(name)
        path.write_bytes(content)
        assert is_as_written(path)
        assert is_begun(path)
        for other in (content + b"\n", content[:-1], content.replace(b"1", b"2"), content.split(b"\n", 1)[1], b""):
            path.write_bytes(other)
            assert not is_as_written(path)
        path.unlink()
        path.symlink_to(Path("elsewhere" + path.suffix))
        Path("elsewhere" + path.suffix).write_bytes(content)
        assert not is_as_written(path)
        path.unlink()
        os.mkfifo(path)
        assert not is_as_written(path)  # and is not waited for
        assert not is_begun(path)
    assert mujoco.MjModel.from_xml_string(MODEL.decode()).nq == 0


def test_every_beginning_of_a_signed_file_is_known_and_no_other_text() -> None:
    path = Path("b.xml")
    for end in range(0, len(MODEL), 7):
        path.write_bytes(MODEL[:end])
        assert is_begun(path)
    for text in ("<!-- Written by me", "<mujoco/>", "# mine", "\n"):
        path.write_text(text, encoding="utf-8")
        assert not is_begun(path)


@pytest.mark.parametrize("options", [[], ["--overwrite"]])
@pytest.mark.parametrize("name", ["b.xml", "b.toml"])
def test_what_no_mount_has_written_is_never_replaced(name: str, options: list[str]) -> None:
    for text in ("mine", "", (MODEL if name == "b.xml" else SCENARIO).decode() + " "):
        Path(name).write_text(text, encoding="utf-8")
        complaint = cmg_mj(*GIVEN, *options).complaint
        assert f"-o b.xml: {name} is there, not as cmg-mj mount wrote it, and would be lost: move it, or" in complaint
        assert (there(), Path(name).read_text(encoding="utf-8")) == ([name], text)


def test_a_link_in_the_place_of_a_file_is_not_followed() -> None:
    Path("mine.xml").write_bytes(MODEL)
    Path("b.xml").symlink_to("mine.xml")
    Path("b.toml").symlink_to("nowhere.toml")
    assert "b.xml, b.toml are there, not as cmg-mj mount wrote it" in cmg_mj(*GIVEN, "--overwrite").complaint
    assert there() == ["b.toml", "b.xml", "mine.xml"]


def test_the_files_of_an_earlier_mount_are_replaced_if_that_is_asked_for() -> None:
    Path("b.xml").write_bytes(MODEL)
    Path("b.toml").write_bytes(SCENARIO)
    assert "b.xml exists; give another name, or --overwrite" in cmg_mj(*GIVEN).complaint
    check_replaceable(Path("b.xml"), overwrite=True)


@pytest.mark.slow
def test_a_mount_knows_its_own_files() -> None:
    Path("b.xml").write_bytes(MODEL)
    assert cmg_mj(*GIVEN, "--overwrite", "--json").status == 0
    assert cmg_mj(*GIVEN, "--overwrite", "--json").status == 0
    assert there() == ["b.toml", "b.xml"]
    assert all(is_as_written(Path(name)) for name in there())
    assert Path("b.xml").read_bytes() != MODEL


def test_what_comes_while_a_mount_works_is_not_replaced(monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(*_: object, **__: object) -> None:
        Path("b.toml").write_text("mine", encoding="utf-8")
        check_replaceable(Path("b.xml"), overwrite=True)

    monkeypatch.setattr("cmg_mj.studies.push_limits.mount_files._mount", fails)
    assert "b.toml is there, not as cmg-mj mount wrote it" in cmg_mj(*GIVEN, "--overwrite").complaint
    assert (there(), Path("b.toml").read_text(encoding="utf-8")) == (["b.toml"], "mine")


def test_from_python_a_mount_replaces_its_own_files_alone() -> None:
    """Another robot's model too, so that a script can run again; the scenario beside it is not touched."""
    mounted = mount(mujoco.MjSpec.from_string(PENDULUM), "pole")
    Path("b.toml").write_text("mine", encoding="utf-8")
    Path("b.xml").write_bytes(MODEL)
    assert mounted.save("b.xml") == Path("b.xml")
    written = Path("b.xml").read_bytes()
    assert written != MODEL
    mounted.save("b.xml")
    assert (there(), Path("b.toml").read_text(encoding="utf-8")) == (["b.toml", "b.xml"], "mine")
    for content in (written + b" ", b"mine", b""):
        Path("b.xml").write_bytes(content)
        with pytest.raises(InputError, match=r"b\.xml is there, not as cmg-mj mount wrote it, and would be lost"):
            mounted.save("b.xml")
        assert Path("b.xml").read_bytes() == content
    Path("b.xml").unlink()
    Path("b.xml").symlink_to("mine.xml")
    with pytest.raises(InputError, match="would be lost"):
        mounted.save("b.xml")
    assert Path("b.xml").is_symlink()


def test_two_mounts_do_not_write_the_same_files() -> None:
    with claimed_target(Path("b.xml"), overwrite=False):
        assert "-o b.xml: another mount is writing it" in cmg_mj(*GIVEN).complaint
        with claimed_target(Path("c.xml"), overwrite=False):
            pass
    assert there() == []


def partial(stem: str, process: int) -> list[str]:
    """The names under which a mount writes."""
    first = f".{stem}.{process}.partial"
    names = [f"{first}{trial}{ending}" for trial in ("", ".trial") for ending in (".xml", ".toml")]
    return [*names, *(f".{name}.{process}.partial" for name in names), f".{names[0]}.{process}.partial.xml"]


def test_what_a_killed_mount_left_is_cleared() -> None:
    for i, name in enumerate((*partial("b", ENDED), *partial("other", ENDED))):
        Path(name).write_bytes((MODEL, SCENARIO, b"", MODEL[:20])[i % 4])
    Path(".b.mount.lock").write_bytes(b"")
    with claimed_target(Path("b.xml"), overwrite=False):
        assert there() == [".b.mount.lock"]
    assert there() == []


def test_a_mount_that_is_refused_clears_too() -> None:
    Path("b.xml").write_bytes(MODEL)
    Path(partial("b", ENDED)[0]).write_bytes(MODEL)
    assert "b.xml exists" in cmg_mj(*GIVEN).complaint
    assert there() == ["b.xml"]


def test_what_may_be_anybody_elses_stays() -> None:
    alive = partial("b", os.getpid())
    theirs = {
        **dict.fromkeys(alive, MODEL),  # of a process that lives
        f".b.{ENDED}.partial.xml": b"mine",
        f".b.{ENDED}.partial.toml": b"# my notes",
        f"b.{ENDED}.partial.xml": MODEL,
        f".b.{ENDED}.partial.txt": MODEL,
        ".b.x.partial.xml": MODEL,
        f".held.{ENDED}.partial.xml": MODEL,  # a process that another machine may have, which holds the lock
    }
    for name, content in theirs.items():
        Path(name).write_bytes(content)
    Path(f".link.{ENDED}.partial.xml").symlink_to("b.xml")
    Path(f".folder.{ENDED}.partial.xml").mkdir()
    os.mkfifo(f".pipe.{ENDED}.partial.xml")
    lock = Lock(Path(".held.mount.lock"))
    before = there()
    with claimed_target(Path("b.xml"), overwrite=False):
        pass
    assert there() == before
    assert {name: Path(name).read_bytes() for name in theirs} == theirs
    lock.release()


@pytest.mark.slow
@pytest.mark.parametrize("moment", KILLED_AT)
def test_a_mount_that_was_killed_and_the_next(moment: str) -> None:
    words = [sys.executable, "-c", KILLED.format(where=KILLED_AT[moment]), *GIVEN]
    done = subprocess.run(words, env=environment(), capture_output=True, timeout=HANGS_AFTER_S, check=False)
    assert done.returncode == -9
    assert any(".partial." in name for name in there())
    assert any(".trial." in name for name in there()) == (moment == "a larger scale")
    with pytest.raises(InputError), claimed_target(Path("b.xml"), overwrite=False):
        raise InputError("a mount that fails clears, too")
    assert there() == []


def test_a_folder_that_cannot_be_written() -> None:
    Path("folder").mkdir()
    assert "cannot be written: " in cmg_mj(*GIVEN[:-1], "/proc/b.xml").complaint


def test_the_help_says_so() -> None:
    assert "except files that have changed since" in " ".join(cmg_mj("mount", "--help").out.split())
