"""A robot with a pair mounted on it, written as a model and a scenario to run, with a plugin."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

import tomli_w

from cmg_mj.features.export.names import LONGEST, RESERVED
from cmg_mj.features.mounting.limits import PUSH_S, PairDemands, PushLimits, pair_demands, push_limits
from cmg_mj.features.mounting.mount import PLUGIN, MountedRobot, check_target, mount, with_scenario
from cmg_mj.features.mounting.push import SimulatedPush, TimeLimit, simulated_push
from cmg_mj.features.plugin.make import Plugin, make_plugin, require_tools, write_plugin
from cmg_mj.inputs.files import expanded
from cmg_mj.inputs.overrides import assign
from cmg_mj.observers import OBSERVER_CLASSES
from cmg_mj.observers.scaling import Number, scaled_parameters
from cmg_mj.plant.plant import Plant, load_plant
from cmg_mj.results.folder import RunFolder, signed, whole_file
from cmg_mj.runs.experiment import Experiment, prepare
from cmg_mj.scenario.loading import load_scenario
from cmg_mj.scenario.rig_file import load_rig

PUSH_SHARE = 0.6
"""A run is pushed with this share of the push that the robot stands in MuJoCo, or of E if that is not known."""
PUSHED_AT_S, DURATION_S = 10.0, 20.0
"""The gimbals come back from the first tilt before the push: both limits are those of upright gimbals. On a slow robot,
whose pole is 3 1/s, that takes so long."""
DIGITS = 4
"""Significant digits of the observer's parameters."""
SCALED_COMMENT = (
    "# The observer's parameters, carried over from the papers' rig by this robot's time scale (docs/mount.md)."
)


@dataclass(frozen=True)
class MountResult:
    """A robot with a pair, its files, and what the pair can do.

    Attributes:
        mounted: The robot with its pair.
        path: The model's file; the scenario lies beside it.
        plant: The plant of the pair's axis.
        observer: Name of the observer in the loop.
        push_limits: Limits of the pair on this robot, of the reduced model.
        simulated: The push that the robot stands in MuJoCo; None if that was not tried.
        demands: Demands of the pair on the robot.
        plugin: The plugin beside the model; None if there is none.
    """

    mounted: MountedRobot
    path: Path
    plant: Plant
    observer: str
    push_limits: PushLimits
    simulated: SimulatedPush | None
    demands: PairDemands
    plugin: Plugin | None = None

    def figures(self) -> dict[str, Any]:
        """Return the figures that `cmg-mj mount --json` prints."""
        simulated = self.simulated
        return {
            **self.push_limits.figures(),
            "stand_unpushed": simulated and simulated.standing,
            "stand_unpushed_of": simulated and simulated.worlds,
            "stands_push_impulse_n_m_s": simulated and simulated.impulse,
            "stands_push_torque_n_m": simulated and simulated.impulse / PUSH_S,
            "stands_push_complete": simulated and simulated.complete,
            "servo_peak_torque_n_m": simulated and simulated.servo_torque,
            "servo_peak_rate_rad_s": simulated and simulated.servo_rate,
            **self.demands._asdict(),
            "observer": self.observer,
            "model": str(self.path),
            "held": list(self.mounted.held),
            **({"plugin_model": str(self.plugin.model)} if self.plugin else {}),
        }


def mount_and_write(
    robot: str | Path,
    target: str | Path,
    observer: str,
    *,
    overwrite: bool = False,
    time_limit: TimeLimit | None = None,
    with_plugin: bool = False,
    rig: str | Path | None = None,
    **request: Any,
) -> MountResult:
    """Mount a pair on a robot, find its limits, and write the model with a scenario beside it.

    Args:
        robot: The robot's MJCF file.
        target: The model's file, `.xml`; the scenario gets the same name with `.toml`.
        observer: Observer in the scenario's loop.
        overwrite: Whether the files of an earlier mount are replaced. Others never are.
        time_limit: The time to try in MuJoCo what the robot stands; None to leave that out.
        with_plugin: Whether a plugin of MuJoCo is written too, into a folder beside the model.
        rig: A rig file, whose accelerometers the scenario gets.
        **request: Arguments of `mount`, all of them.

    Returns:
        The robot, its files and its limits.

    Raises:
        InputError: The robot or the request does not allow it, or a file cannot be written.
    """
    file, axis = expanded(target, "-o"), request["name"]
    OBSERVER_CLASSES.find(observer)
    endings = [".xml", ".toml", *([PLUGIN] if with_plugin else [])]
    check_target(file, expanded(robot, "ROBOT"), endings, overwrite=overwrite)
    if with_plugin:
        require_tools()
    placed = {} if rig is None else load_rig(rig).settings(f"--rig {rig}", with_pendulum=False)
    mounted = mount(robot, **request)
    simulated = plugin = None
    with with_scenario(file) as model:
        experiment = write_scenario(mounted.save(model), mounted.path, observer, axis=axis, placed=placed)
        if with_plugin:  # what cannot be exported is refused before what takes a minute
            make_plugin(experiment, plugin_name(file), start="spinning")
        limits = push_limits(experiment, axis)
        if time_limit is not None:
            simulated = simulated_push(experiment, limits, axis, time_limit)
        experiment = write_scenario(model, mounted.path, observer, limits, axis, simulated, placed)
        if with_plugin:
            made = make_plugin(experiment, plugin_name(file), start="spinning")
            with RunFolder(file.with_name(file.stem + PLUGIN), overwrite=True) as folder:
                plugin = write_plugin(made, folder)
    plant = experiment.plant.single_axis(axis)
    demands = pair_demands(plant, experiment.law.rate_limit, request["scale"])
    return MountResult(mounted, file, plant, observer, limits, simulated, demands, plugin)


def write_scenario(
    model: Path,
    robot: Path,
    observer: str,
    limits: PushLimits | None = None,
    axis: str = "",
    simulated: SimulatedPush | None = None,
    placed: Mapping[str, float] = MappingProxyType({}),
) -> Experiment:
    """Write a scenario beside a model that carries a pair.

    Args:
        model: The model's file; the scenario gets the same name with `.toml`.
        robot: The robot that the model was made from, for the title.
        observer: Observer in the loop.
        limits: Limits of the pair, which set the first tilt and the push; without them there is neither.
        axis: Name of the axis that the limits are of.
        simulated: The push that the robot stands in MuJoCo, which then sets the push.
        placed: Field -> value, of a rig file's accelerometers.

    Returns:
        The prepared experiment.
    """
    plant = load_plant(model=str(model))
    names = [each.name for each in plant.axes]
    parts: dict[str, dict[str, Any]] = {name: {"plant": {}, "observer": {}} for name in names}
    parts[""] = {
        "plant": {"model": model.name, "equilibrium_bias_deg": 0.0, "initial_tilt_deg": 0.0},
        "observer": {"kind": observer},
    }
    parts[axis]["plant"]["initial_tilt_deg"] = limits.start_tilt_deg if limits else 0.0
    parameters: dict[str, Number] = {}
    for each in plant.axes:
        if each.reduced.pivot_arm:
            parts[each.name]["plant"]["pivot_slides"] = True
        parameters = {name: _round(value) for name, value in scaled_parameters(observer, each.reduced).items()}
        parts[each.name if len(names) > 1 else ""]["observer"] |= parameters
    common = parts.pop("")
    axes = {name: {section: its for section, its in part.items() if its} for name, part in parts.items()}
    axes = {name: part for name, part in axes.items() if part}
    largest = limits.push_margin.median_impulse if limits else 0.0
    if simulated and (simulated.complete or simulated.impulse):
        largest = simulated.impulse
    push = {
        **({"axis": axis} if axis else {}),
        "start_s": PUSHED_AT_S,
        "duration_s": PUSH_S,
        "torque_n_m": float(f"{PUSH_SHARE * largest / PUSH_S:.3g}"),
    }
    fields = {
        "title": f"{robot.stem}, balanced",
        "duration_s": DURATION_S,
        "plant": common["plant"],
        "controller": {"gains": "scaled"},
        "observer": common["observer"],
        **({"axes": axes} if axes else {}),
        **({"push": [push]} if largest else {}),
    }
    for name, value in placed.items():
        assign(fields, f"axes.{axis}.{name}" if len(names) > 1 else name, value, "--rig")
    path, text = model.with_suffix(".toml"), tomli_w.dumps(fields)
    if parameters:
        header = "\n[axes" if len(names) > 1 else "\n[observer]"
        text = text.replace(header, f"\n{SCALED_COMMENT}{header}", 1)
    with whole_file(path) as temporary:
        temporary.write_bytes(signed(text, ".toml"))
    return prepare(load_scenario(str(path)), like=plant)


def _round(value: Number) -> Number:
    return tuple(map(_round, value)) if isinstance(value, tuple) else float(f"{value:.{DIGITS}g}")


def plugin_name(target: Path) -> str:
    """Name a plugin after a model's file, in letters, digits and _: `my robot.xml` has my_robot."""
    words = re.sub(r"[^A-Za-z0-9]+", "_", target.stem, flags=re.ASCII).strip("_")
    name = words if words[:1].isalpha() else f"robot_{words}".rstrip("_")
    taken = {name, name.lower()} & RESERVED
    return f"{name}_robot" if taken else name[:LONGEST]
