"""Where the mount command writes: both files or neither, and in nobody's place."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import mujoco
import pytest

from cmg_mj.core.errors import InputError
from cmg_mj.features.mounting import mount
from cmg_mj.results.folder import signed
from tests.command import cmg_mj
from tests.features.mounting.robots import EXAMPLES

pytestmark = pytest.mark.usefixtures("elsewhere")

TORSO = EXAMPLES / "torso.xml"
MOUNT = ("mount", str(TORSO), "--body", "torso", "--axis", "x", "--scale", "1.3", "--quick")
NO_XML = "must be a file that ends in .xml, such as balanced.xml"


def files() -> list[str]:
    return sorted(str(path) for path in Path().rglob("*"))


@pytest.mark.parametrize(
    ("out", "message"),
    [
        ("b.toml", f"-o b.toml: {NO_XML}"),
        ("noext", f"-o noext: {NO_XML}"),
        (".", f"-o .: {NO_XML}"),
        ("", NO_XML),
        ("there/is/none.xml", "-o there/is/none.xml: cannot be written: there is no folder there/is"),
        ("folder.xml", "-o folder.xml: folder.xml is not of cmg-mj mount"),
    ],
)
def test_the_place_is_looked_at_before_anything_is_made(out: str, message: str) -> None:
    Path("folder.xml").mkdir()
    assert message in cmg_mj(*MOUNT, "-o", out, "--overwrite").complaint
    assert files() == ["folder.xml"]
    spec = mujoco.MjSpec.from_file(str(TORSO))
    with pytest.raises(InputError):
        mount(spec, "torso", axis="x", scale=1.3).save(out)


@pytest.mark.parametrize("observer", ["homogenous", "nowhere:Class"])
def test_an_observer_that_is_none_leaves_nothing(observer: str) -> None:
    Path("a.xml").write_text("mine", encoding="utf-8")
    assert observer.partition(":")[0] in cmg_mj(*MOUNT, "-o", "a.xml", "--overwrite", "--observer", observer).complaint
    assert (files(), Path("a.xml").read_text(encoding="utf-8")) == (["a.xml"], "mine")


def test_a_failure_in_the_middle_leaves_what_there_was(monkeypatch: pytest.MonkeyPatch) -> None:
    """Both files are written under other names, and renamed when all is done."""
    before = [signed("seed = 1\n", ".toml"), signed("<mujoco/>\n", ".xml")]
    for name, content in zip(("a.toml", "a.xml"), before, strict=True):
        Path(name).write_bytes(content)

    def fail(*_: object, **__: object) -> None:
        raise InputError(f"{next(Path().glob('.*.partial.a.xml'))}: fails")

    monkeypatch.setattr("cmg_mj.features.mounting.write.push_limits", fail)
    assert "a.xml: fails" in cmg_mj(*MOUNT, "-o", "a.xml", "--overwrite").complaint
    assert files() == ["a.toml", "a.xml"]
    assert [Path(name).read_bytes() for name in files()] == before


@pytest.mark.parametrize("name", ["a.xml", "a.toml"])
@pytest.mark.parametrize("options", [(), ("--overwrite",)])
def test_what_no_mount_has_written_is_never_replaced(name: str, options: tuple[str, ...]) -> None:
    Path(name).write_text("mine", encoding="utf-8")
    assert f"{name} is not of cmg-mj mount" in cmg_mj(*MOUNT, "-o", "a.xml", *options).complaint
    assert (files(), Path(name).read_text(encoding="utf-8")) == ([name], "mine")


def test_a_mounts_own_file_is_replaced_where_that_is_asked_for() -> None:
    Path("a.xml").write_bytes(signed("<mujoco/>", ".xml"))
    assert "a.xml exists" in cmg_mj(*MOUNT, "-o", "a.xml").complaint
    mount(TORSO, "torso", axis="x", scale=1.3).save("a.xml")
    assert mujoco.MjSpec.from_file("a.xml").body("torso") is not None
    Path("link.xml").symlink_to("a.xml")
    with pytest.raises(InputError, match=r"link\.xml is not of cmg-mj mount"):
        mount(TORSO, "torso", axis="x", scale=1.3).save("link.xml")


def test_a_file_that_the_robot_includes_is_never_overwritten() -> None:
    Path("part.xml").write_bytes(TORSO.read_bytes())
    Path("robot.xml").write_text('<mujoco><include file="part.xml"/></mujoco>', encoding="utf-8")
    arguments = ("mount", "robot.xml", *MOUNT[2:])
    message = cmg_mj(*arguments, "-o", "part.xml", "--overwrite").complaint
    assert "-o part.xml: part.xml is the robot's own file, or one that it names" in message
    assert Path("part.xml").read_bytes() == TORSO.read_bytes()
    assert files() == ["part.xml", "robot.xml"]
    with pytest.raises(InputError, match=r"part\.xml is the robot's own file"):
        mount("robot.xml", "torso", axis="x", scale=1.3).save("part.xml")


@pytest.mark.slow
def test_what_is_written_speaks_of_itself_alone() -> None:
    assert json.loads(cmg_mj(*MOUNT, "-o", "a.xml", "--json").out)["model"] == "a.xml"
    assert files() == ["a.toml", "a.xml"]
    text = Path("a.toml").read_text(encoding="utf-8")
    assert 'model = "a.xml"' in text
    assert "partial" not in text + Path("a.xml").read_text(encoding="utf-8")


def test_what_mujoco_cannot_do_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object, **__: object) -> None:
        raise ValueError("Error: repeated name 'x'\nin frame")

    monkeypatch.setattr(sys.modules["cmg_mj.features.mounting.mount"], "add_sensors", fail)
    message = cmg_mj(*MOUNT, "-o", "a.xml").complaint
    assert f"{TORSO}: MuJoCo cannot put a pair on it: repeated name 'x' in frame" in message
    assert files() == []
