"""The observer's parameters in the scenario that a mount writes."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import mujoco
import pytest

from cmg_mj import mount
from cmg_mj.features.mounting.write import (
    SCALED_COMMENT,
    AxesParameters,
    RigSettings,
    scenario_text,
    write_scenario,
)
from cmg_mj.observers.linear import LinearDifferentiator
from cmg_mj.observers.scaling import scaled_parameters
from tests.features.mounting.test_mount import UNIVERSAL


def text(axis: str, parameters: AxesParameters) -> tuple[str, dict[str, Any]]:
    written = scenario_text(
        "robot.xml", Path("robot.xml"), "homogeneous", None, axis, None, RigSettings((), parameters)
    )
    return written, tomllib.loads(written)


def test_they_are_in_the_observers_section_below_a_comment() -> None:
    written, fields = text("", {"": {"k1": 7.5, "k2": 21.0}})
    assert fields["observer"] == {"kind": "homogeneous", "k1": 7.5, "k2": 21.0}
    assert f"\n{SCALED_COMMENT}\n[observer]\n" in written


def test_two_axes_have_their_own() -> None:
    written, fields = text("pitch", {"roll": {"k1": 7.5}, "pitch": {"k1": 9.0}})
    assert fields["observer"] == {"kind": "homogeneous"}
    assert fields["axes"]["roll"] == {"observer": {"k1": 7.5}}
    assert fields["axes"]["pitch"] == {"plant": {"initial_tilt_deg": 0.0}, "observer": {"k1": 9.0}}
    assert written.count(SCALED_COMMENT) == 1


def test_an_observer_without_such_is_named_alone() -> None:
    written, fields = text("", {"": {}})
    assert fields["observer"] == {"kind": "homogeneous"}
    assert SCALED_COMMENT not in written


@pytest.mark.slow
def test_each_axis_has_those_of_its_own_reduced_model(tmp_path: Path) -> None:
    first = mount(
        mujoco.MjSpec.from_string(UNIVERSAL.format(0)), "trunk", axis="roll", name="roll", position=(0.0, 0.0, 0.15)
    )
    model = mount(first.spec, "trunk", axis="pitch", name="pitch", position=(0.0, 0.0, 0.35)).save(tmp_path / "rig.xml")
    experiment = write_scenario(model, model, "linear", axis="pitch")
    for part in experiment.parts:
        observer = part.design.observer()
        assert isinstance(observer, LinearDifferentiator)
        assert observer.tau == pytest.approx(scaled_parameters("linear", part.plant.reduced)["tau"], rel=1e-3)
