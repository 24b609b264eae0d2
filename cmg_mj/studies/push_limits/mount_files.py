"""A robot with a pair mounted on it, written as a model and a scenario to run."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from pathlib import Path

import mujoco
import tomli_w

from cmg_mj.errors import InputError
from cmg_mj.observers import OBSERVER_CLASSES
from cmg_mj.plant.mounting import MountedRobot
from cmg_mj.plant.mounting.mount import mount_on_request
from cmg_mj.plant.mounting.mounted import check_target, with_scenario
from cmg_mj.plant.mounting.request import MountRequest
from cmg_mj.plant.plant import Plant, load_plant
from cmg_mj.results.files import whole_file
from cmg_mj.scenario.loading import load_scenario
from cmg_mj.simulation.experiment import Experiment, prepare
from cmg_mj.studies.push_limits.largest_push import PUSH_S
from cmg_mj.studies.push_limits.prospects import LOW_LIMIT_DEG, Prospects, prospects, smallest_sufficient_scale
from cmg_mj.studies.push_limits.recoverable_states import ceiling

START_DEG, START_SHARE = 1.0, 0.25
"""A run starts with one degree of tilt, or with a quarter of the recoverable tilt if that is less."""
PUSH_SHARE = 0.6
"""A run is pushed with this share of the push margin."""
PUSHED_AT_S, DURATION_S = 10.0, 20.0
"""The gimbals come back from the first tilt before the push: the margin E is that of upright gimbals. On a slow robot,
whose pole is 3 1/s, that takes so long."""


@dataclass(frozen=True)
class MountResult:
    """A robot with a pair, its files, and what the pair can do.

    Attributes:
        mounted: The robot with its pair.
        path: The model's file; the scenario lies beside it.
        plant: The plant of the pair's axis.
        prospects: Limits of the pair on this robot.
        sufficient_scale: A scale with which the robot recovers `LOW_LIMIT_DEG`; None if the pair's own does, or if no
            scale that has room does.
    """

    mounted: MountedRobot
    path: Path
    plant: Plant
    prospects: Prospects
    sufficient_scale: float | None

    @property
    def scenario_path(self) -> Path:
        """The scenario's file."""
        return self.path.with_suffix(".toml")

    def figures(self) -> dict[str, float | str | list[str] | None]:
        """Return the figures that `cmg-mj mount --json` prints."""
        return {
            **self.prospects.figures(),
            "model": str(self.path),
            "held": list(self.mounted.held),
            "scale_that_suffices": self.sufficient_scale,
        }


def mount_and_write(
    robot: str | Path, request: MountRequest, target: str | Path, observer: str, *, overwrite: bool = False
) -> MountResult:
    """Mount a pair on a robot, find its limits, and write the model with a scenario beside it.

    Args:
        robot: The robot's MJCF file.
        request: The body, the axis and the modules.
        target: The model's file, `.xml`; the scenario gets the same name with `.toml`.
        observer: Observer in the scenario's loop.
        overwrite: Whether existing files are replaced.

    Returns:
        The robot, its files and its limits.

    Raises:
        InputError: The robot or the request does not allow it, or a file cannot be written.
    """
    robot, file = Path(robot), Path(target).expanduser()
    OBSERVER_CLASSES.find(observer)
    check_target(file, robot.expanduser())
    for path in (file, file.with_suffix(".toml")):
        if path.exists() and not overwrite:
            raise InputError(f"-o {target}: {path} exists; give another name, or --overwrite")
    mounted = _mount(robot, request)
    with with_scenario(file) as model:
        mounted.save(model)
        limits = prospects(write_scenario(model, mounted.path, observer, axis=request.name), request.name)
        experiment = write_scenario(model, mounted.path, observer, limits, request.name)
        sufficient = None
        if math.degrees(limits.limit.tilt) < LOW_LIMIT_DEG:
            trial = model.with_name(f".{file.stem}.trial.xml")
            sufficient = smallest_sufficient_scale(
                lambda scale: _recoverable_tilt(robot, request, scale, trial, experiment.law.rate_limit), request.scale
            )
        scenario = scenario_text(file.name, mounted.path, observer, limits, request.name)
        model.with_suffix(".toml").write_text(scenario, encoding="utf-8")
    return MountResult(mounted, file, experiment.plant.single_axis(request.name), limits, sufficient)


def _mount(robot: Path, request: MountRequest) -> MountedRobot:
    try:
        return mount_on_request(robot, request)
    except InputError:
        raise
    except (ValueError, KeyError, mujoco.FatalError) as error:  # unforeseen errors of MuJoCo's model editing
        message = " ".join(str(error.args[0] if error.args else error).split()).removeprefix("Error: ")
        raise InputError(f"{robot}: MuJoCo cannot put a pair on it: {message}") from error


def _recoverable_tilt(robot: Path, request: MountRequest, scale: float, trial: Path, rate_limit: float) -> float:
    """Return the largest tilt that a pair of another scale recovers from [rad]."""
    model = _mount(robot, dataclasses.replace(request, scale=scale)).save(trial)
    try:
        return ceiling(load_plant(model=str(model)).single_axis(request.name).reduced, rate_limit).tilt
    finally:
        model.unlink()


def write_scenario(
    model: Path, robot: Path, observer: str, limits: Prospects | None = None, axis: str = ""
) -> Experiment:
    """Write a scenario beside a model that carries a pair.

    Args:
        model: The model's file; the scenario gets the same name with `.toml`.
        robot: The robot that the model was made from, for the title.
        observer: Observer in the loop.
        limits: Limits of the pair, which set the first tilt and the push; without them there is neither.
        axis: Name of the axis that the limits are of.

    Returns:
        The prepared experiment.
    """
    path = model.with_suffix(".toml")
    with whole_file(path) as temporary:
        temporary.write_text(scenario_text(model.name, robot, observer, limits, axis), encoding="utf-8")
    return prepare(load_scenario(str(path)))


def scenario_text(model: str, robot: Path, observer: str, limits: Prospects | None, axis: str) -> str:
    """Return the scenario that `write_scenario` writes, as TOML."""
    tilt = min(START_DEG, START_SHARE * math.degrees(limits.limit.tilt)) if limits else 0.0
    start = {"initial_tilt_deg": float(f"{tilt:.3g}")}
    plant = {"model": model, "equilibrium_bias_deg": 0.0, **({"initial_tilt_deg": 0.0} if axis else start)}
    pushes: list[dict[str, str | float]] = []
    if limits and limits.push_margin.median_impulse:
        torque = float(f"{PUSH_SHARE * limits.push_margin.median_impulse / PUSH_S:.3g}")
        pushed_axis = {"axis": axis} if axis else {}
        pushes = [{**pushed_axis, "start_s": PUSHED_AT_S, "duration_s": PUSH_S, "torque_n_m": torque}]
    return tomli_w.dumps(
        {
            "title": f"{robot.stem}, balanced",
            "duration_s": DURATION_S,
            "plant": plant,
            "controller": {"gains": "scaled"},
            "observer": {"kind": observer},
            **({"axes": {axis: {"plant": start}}} if axis else {}),
            **({"push": pushes} if pushes else {}),
        }
    )
