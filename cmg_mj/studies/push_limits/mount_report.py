"""What `cmg-mj mount` says and writes beside the robot: a scenario to run."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import tomli_w

from cmg_mj.plant.mounting.mounted import MountedRobot
from cmg_mj.plant.plant import Plant
from cmg_mj.plant.tilt_line import HingeLine
from cmg_mj.results.files import whole_file
from cmg_mj.scenario.loading import load_scenario
from cmg_mj.simulation.experiment import Experiment, prepare
from cmg_mj.studies.push_limits.largest_push import PUSH_S
from cmg_mj.studies.push_limits.prospects import LOW_CEILING_DEG, Prospects

START_DEG, SHARE_OF_CEILING = 1.0, 0.25
"""A run starts with one degree of tilt, or with a quarter of the ceiling if that is less."""
SHARE_OF_BORNE = 0.6
PUSHED_AT_S, DURATION_S = 10.0, 20.0
"""A run lets the gimbals come back from the first tilt before it pushes: E is borne by gimbals that stand upright.
Those of a slow robot, whose pole is 3 1/s, need so long."""


def write_scenario(model: Path, robot: Path, observer: str, can: Prospects | None = None, axis: str = "") -> Experiment:
    """Write a scenario beside a model that carries a pair.

    Args:
        model: The model's file; the scenario's has its name.
        robot: What the model was made from, for the title.
        observer: In the loop.
        can: What the pair can do, which says how far the robot is tilted and pushed; without it, it is neither.
        axis: Which axis the prospects are of, if it has a name.

    Returns:
        The scenario, made ready to run.
    """
    path = model.with_suffix(".toml")
    with whole_file(path) as temporary:
        temporary.write_text(scenario_text(model.name, robot, observer, can, axis), encoding="utf-8")
    return prepare(load_scenario(str(path)))


def scenario_text(model: str, robot: Path, observer: str, can: Prospects | None, axis: str) -> str:
    """A scenario around a model of that name, as `write_scenario` writes it."""
    tilt = min(START_DEG, SHARE_OF_CEILING * math.degrees(can.ceiling.tilt)) if can else 0.0
    start = {"initial_tilt_deg": float(f"{tilt:.3g}")}
    fields: dict[str, Any] = {
        "title": f"{robot.stem}, balanced",
        "duration_s": DURATION_S,
        "plant": {"model": model, "equilibrium_bias_deg": 0.0, **({} if axis else start)},
        "controller": {"gains": "scaled"},
        "observer": {"kind": observer},
    }
    if axis:
        fields["plant"]["initial_tilt_deg"] = 0.0
        fields["axes"] = {axis: {"plant": start}}
    if can and can.push_margin.median_impulse:
        torque = float(f"{SHARE_OF_BORNE * can.push_margin.median_impulse / PUSH_S:.3g}")
        of_axis = {"axis": axis} if axis else {}
        fields["push"] = [{**of_axis, "start_s": PUSHED_AT_S, "duration_s": PUSH_S, "torque_n_m": torque}]
    return tomli_w.dumps(fields)


def mount_report_lines(mounted: MountedRobot, plant: Plant, can: Prospects, enough: float | None) -> Iterator[str]:
    """What was done, and what the pair can do there, line by line.

    Args:
        mounted: The robot with its pair.
        plant: The same as a rig, with the axis of the pair alone.
        can: What the pair can do.
        enough: If the ceiling is low, the scale that suffices, if one does.

    Yields:
        Lines.
    """
    figures = can.figures()
    line = plant.axis.line
    joint = plant.model.joint(line.joint).name
    about = f"the hinge {joint!r}" if isinstance(line, HingeLine) else "the line that it stands on"
    body = plant.model.body(plant.frame).name
    yield f"{mounted.path}: {len(plant.axis.cubes)} modules on {body!r}; tilts about {about}"
    if mounted.held:
        yield f"  held where they stand: {', '.join(mounted.held)}"
    for note in mounted.notes:
        yield f"  {note}"
    yield (
        f"  inertia {figures['inertia_kg_m2']:.4g} kg m^2, gravity {figures['gravity_torque_n_m']:.4g} N m, momentum "
        f"{figures['momentum_n_m_s']:.4g} N m s, falls with {figures['pole_1_s']:.3g} 1/s"
    )
    yield (
        f"  any controller: recovers at most {figures['ceiling_tilt_deg']:.3g} deg, or a push of "
        f"{figures['ceiling_push_n_m']:.3g} N m for {PUSH_S:g} s"
    )
    yield (
        f"  this one: bears a push of {figures['push_margin_torque_n_m']:.3g} N m for {PUSH_S:g} s (E = "
        f"{figures['push_margin_impulse_n_m_s']:.3g} N m s, {can.fraction_of_limit:.0%} of that)"
    )
    if enough is not None:
        yield f"  a pair of this size recovers less than {LOW_CEILING_DEG:g} deg: --scale {enough:g} suffices"
    elif figures["ceiling_tilt_deg"] < LOW_CEILING_DEG:
        yield f"  a pair recovers less than {LOW_CEILING_DEG:g} deg at any scale that it has room for"
