"""A model with one of this package's plugins, which its own runs and analyses leave out."""

from __future__ import annotations

from pathlib import Path

import mujoco
import pytest

import cmg_mj
from cmg_mj.inputs.files import find
from cmg_mj.plant.mjcf import compile_model, parse
from cmg_mj.plant.without_plugins import strip_plugins

PLUGIN = """
  <extension>
    <plugin plugin="cmg_mj.gyro_free">
      <instance name="balance"><config key="seed" value="1"/></instance>
    </plugin>
  </extension>"""
SENSOR = """
    <plugin name="balance/tilt" plugin="cmg_mj.gyro_free" instance="balance"/>
    <plugin name="balance/command" instance="balance"/>
  </sensor>"""


def with_plugin(folder: Path, plugin: str = PLUGIN) -> Path:
    bundled = find("models", "scissored_pair.xml", ".xml", "model")
    text = bundled.read_text(encoding="utf-8").replace("cube.xml", str(bundled.with_name("cube.xml")))
    head = text.index(">") + 1
    path = folder / "rig.xml"
    path.write_text(text[:head] + plugin + text[head:].replace("</sensor>", SENSOR), encoding="utf-8")
    return path


def test_the_rig_is_the_one_without_it(tmp_path: Path) -> None:
    rig, plain = cmg_mj.load_plant(model=str(with_plugin(tmp_path))), cmg_mj.load_plant()
    assert rig.model.nplugin == 0
    assert rig.model.nsensor == plain.model.nsensor
    assert rig.largest_step == plain.largest_step
    assert rig.reduced == plain.reduced
    assert [hint for hint in rig.hints if hint not in plain.hints] == [
        "the model has the plugin cmg_mj.gyro_free, which is left out here: the scenario's own controller takes its "
        "place"
    ]


def test_another_packages_plugin_stays(tmp_path: Path) -> None:
    with pytest.raises(cmg_mj.InputError, match=r"plugin other\.gyro_free not found"):
        cmg_mj.load_plant(model=str(with_plugin(tmp_path, PLUGIN.replace("cmg_mj.", "other."))))


OUTER = '<mujoco model="outer"><include file="{}"/></mujoco>'


def is_plain(path: Path) -> bool:
    """Whether the model has a rig's sensors and no plugin, whose name is known."""
    stripped, model = strip_plugins(path), parse(path).compile()
    assert stripped is not None
    assert stripped.plugins == ("cmg_mj.gyro_free",)
    return model.nplugin == 0 and model.nsensor == 5


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ("<worldbody>", "<!-- a -- b --><worldbody>"),
        ('<mujoco model="', '<mujoco model="a & b '),
        ("cmg_mj.", "cmg_mj&#46;"),
        ("cmg_mj.", "&#x63;mg_mj."),
        ("<plugin plugin=", "<plugin\n  plugin ="),
        ('"cmg_mj.gyro_free"', "'cmg_mj.gyro_free'"),
        ("<extension>", "<!-- <extension> --><extension><!-- </plugin> -->"),
        ("<extension>", '<custom><text name="t" data="a > b"/></custom><extension>'),
    ],
)
def test_what_mujoco_reads_and_other_parsers_do_not(before: str, after: str, tmp_path: Path) -> None:
    path = with_plugin(tmp_path)
    text = path.read_text(encoding="utf-8")
    assert before in text
    path.write_text(text.replace(before, after), encoding="utf-8")
    assert is_plain(path)


@pytest.mark.parametrize("folder", ["", "sub"])
def test_in_an_included_file(folder: str, tmp_path: Path) -> None:
    """Of the same name as the outer one, with a file of its own beside it."""
    (tmp_path / folder / "deep").mkdir(parents=True)
    inner = with_plugin(tmp_path)
    text = inner.read_text(encoding="utf-8").replace("</mujoco>", '<include file="more.xml"/></mujoco>')
    (tmp_path / folder / "deep" / "rig.xml").write_text(text, encoding="utf-8")
    more = '<mujoco><sensor><plugin name="balance/sample" instance="balance"/></sensor></mujoco>'
    (tmp_path / folder / "deep" / "more.xml").write_text(more, encoding="utf-8")
    (tmp_path / folder / "rig.xml").write_text(OUTER.format("deep/rig.xml"), encoding="utf-8")
    assert is_plain(tmp_path / folder / "rig.xml")


def test_files_are_found_beside_the_model(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """And not where the command runs, or under the same name elsewhere."""
    for name in ("here", "there"):
        (tmp_path / name / "parts").mkdir(parents=True)
        bundled = find("models", "scissored_pair.xml", ".xml", "model")
        cube = bundled.with_name("cube.xml").read_text(encoding="utf-8")
        (tmp_path / name / "parts" / "cube.xml").write_text(cube.replace('mass="', 'mass="1'), encoding="utf-8")
        (tmp_path / name / "cube.xml").write_text(cube, encoding="utf-8")
        path = with_plugin(tmp_path / name)
        text = path.read_text(encoding="utf-8").replace(str(bundled.with_name("cube.xml")), "cube.xml")
        path.write_text(text.replace("</mujoco>", '<include file="parts/body.xml"/></mujoco>'), encoding="utf-8")
        body = f'<mujoco><worldbody><body name="{name}" pos="9 0 0"/></worldbody></mujoco>'
        (tmp_path / name / "parts" / "body.xml").write_text(body, encoding="utf-8")
    (tmp_path / "here" / "cube.xml").write_text(OUTER, encoding="utf-8")
    monkeypatch.chdir(tmp_path / "here")
    for model in ("../there/rig.xml", str(tmp_path / "there" / "rig.xml")):
        assert is_plain(Path(model))
        assert parse(Path(model)).body("there") is not None


def test_in_a_model_that_is_attached(tmp_path: Path) -> None:
    (tmp_path / "sub").mkdir()
    body = '<worldbody><body name="b"><site name="s"/></body></worldbody><sensor><accelerometer site="s"/>'
    (tmp_path / "sub" / "rig.xml").write_text(f"<mujoco>{PLUGIN}{body}{SENSOR}</mujoco>", encoding="utf-8")
    outer = tmp_path / "rig.xml"
    outer.write_text(
        '<mujoco><asset><model name="rig" file="sub/rig.xml"/></asset>'
        '<worldbody><attach model="rig" body="b" prefix="p_"/></worldbody></mujoco>',
        encoding="utf-8",
    )
    model = parse(outer).compile()
    assert (model.nplugin, model.nsensor) == (0, 1)


def test_messages_name_the_users_file_and_line(tmp_path: Path) -> None:
    path = with_plugin(tmp_path)
    text = path.read_text(encoding="utf-8")
    line = text[: text.index("<worldbody>")].count("\n") + 1
    path.write_text(text.replace("<worldbody>", "<worldbody></wordlbody>"), encoding="utf-8")
    with pytest.raises(
        cmg_mj.InputError, match=rf"rig\.xml: not a model MuJoCo can read: XML syntax error at line {line}$"
    ):
        cmg_mj.load_plant(model=str(path))
    path.write_text(text.replace("<worldbody>", '<worldbody><include file="absent.xml"/>'), encoding="utf-8")
    with pytest.raises(cmg_mj.InputError, match=r"^[^#]*absent\.xml'[^#]*$"):
        cmg_mj.load_plant(model=str(path))


def test_a_plugin_that_stays_is_refused_by_name(tmp_path: Path) -> None:
    spec = mujoco.MjSpec()
    spec.add_plugin(name="balance", plugin_name="cmg_mj.mine")
    with pytest.raises(cmg_mj.InputError, match=r"rig\.xml: the plugin cmg_mj\.mine cannot be ignored"):
        compile_model(spec, tmp_path / "rig.xml")
