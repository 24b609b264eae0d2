"""A robot with a pair mounted on it, written as a model and a scenario to run, with a plugin, tuned."""

from __future__ import annotations

import dataclasses
import math
import os
import re
import time
import tomllib
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

import mujoco
import tomli_w

from cmg_mj.core.errors import InputError
from cmg_mj.features.export.names import LONGEST, RESERVED
from cmg_mj.features.mounting import MountedRobot
from cmg_mj.features.mounting.limits import (
    LOW_LIMIT_DEG,
    NOISE_HINT,
    PUSH_S,
    WORLDS,
    PairDemands,
    Prospects,
    pair_demands,
    prospects,
    push_margin,
    smallest_sufficient_scale,
)
from cmg_mj.features.mounting.mount import check_replaceable, check_target, mount_on_request, with_scenario
from cmg_mj.features.mounting.push import (
    OutOfTimeError,
    SimulatedPush,
    TimeLimit,
    simulated_push,
    standing_unpushed,
)
from cmg_mj.features.mounting.request import MountRequest
from cmg_mj.features.plugin.make import Plugin, make_plugin, require_tools, write_plugin
from cmg_mj.features.plugin.tables import NAMES_IN_USE
from cmg_mj.features.tuning import NoiseLevelResult, TuningResult, tune, tuned_scenario
from cmg_mj.features.tuning.search import plain
from cmg_mj.inputs.files import expanded, model_files
from cmg_mj.observers import OBSERVER_CLASSES
from cmg_mj.observers.parameter_options import ParameterValue
from cmg_mj.observers.scaling import Number, scaled_names, scaled_parameters
from cmg_mj.plant.plant import Plant
from cmg_mj.results.files import whole_file
from cmg_mj.results.folder import RunFolder, is_own, is_signed, signed
from cmg_mj.runs.experiment import Experiment, prepare
from cmg_mj.scenario.loading import load_scenario
from cmg_mj.scenario.schema import Scenario

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
AxesParameters = Mapping[str, Mapping[str, Number]]
"""Axis -> parameter of its observer -> value."""
SUITS_EVERY_RIG = "finite_difference"
"""An observer with which the plant is prepared before another's parameters are known."""


class RigSettings(NamedTuple):
    """The robot that carries the pair, as a scenario has it besides its model.

    Attributes:
        sliding: Axes whose pivot slides freely.
        parameters: Parameters of the observers.
    """

    sliding: Collection[str] = ()
    parameters: AxesParameters = MappingProxyType({})


@dataclass(frozen=True)
class MountResult:
    """A robot with a pair, its files, and what the pair can do.

    Attributes:
        mounted: The robot with its pair.
        path: The model's file; the scenario lies beside it.
        plant: The plant of the pair's axis.
        observer: Name of the observer in the loop.
        prospects: Limits of the pair on this robot, of the reduced model.
        simulated: The push that the robot stands in MuJoCo; None if that was not tried.
        demands: Demands of the pair on the robot.
        sufficient_scale: A scale that was tried, with which the robot stands and the ceiling is `LOW_LIMIT_DEG` or
            more; None if the pair's own suffices, or if none was found that does.
        plugin: The plugin beside the model; None if there is none.
    """

    mounted: MountedRobot
    path: Path
    plant: Plant
    observer: str
    prospects: Prospects
    simulated: SimulatedPush | None
    demands: PairDemands
    sufficient_scale: float | None
    plugin: Plugin | None = None

    @property
    def scenario_path(self) -> Path:
        """The scenario's file."""
        return self.path.with_suffix(".toml")

    @property
    def hints(self) -> list[str]:
        """Clauses on what is likely to make the robot fall; none on noise if it falls in MuJoCo anyway."""
        falls = self.simulated is not None and self.simulated.falls
        return [hint for hint in self.prospects.hints if not (falls and hint.startswith(NOISE_HINT))]

    def figures(self) -> dict[str, float | str | list[str] | None]:
        """Return the figures that `cmg-mj mount --json` prints."""
        simulated = self.simulated
        return {
            **self.prospects.figures(),
            "stand_unpushed": simulated and simulated.standing,
            "stand_unpushed_of": simulated and simulated.worlds,
            "stands_push_impulse_n_m_s": simulated and simulated.impulse,
            "stands_push_torque_n_m": simulated and simulated.impulse / PUSH_S,
            "stands_push_complete": simulated and simulated.complete,
            "servo_peak_torque_n_m": simulated and simulated.servo_torque,
            "servo_peak_rate_rad_s": simulated and simulated.servo_rate,
            **self.demands.figures(),
            "observer": self.observer,
            "model": str(self.path),
            "held": list(self.mounted.held),
            "scale_that_suffices": self.sufficient_scale,
            **({"plugin_model": str(self.plugin.model)} if self.plugin else {}),
        }


def mount_and_write(
    robot: str | Path,
    request: MountRequest,
    target: str | Path,
    observer: str,
    *,
    overwrite: bool = False,
    time_limit: TimeLimit | None = None,
    with_plugin: bool = False,
) -> MountResult:
    """Mount a pair on a robot, find its limits, and write the model with a scenario beside it.

    Args:
        robot: The robot's MJCF file.
        request: The body, the axis and the modules.
        target: The model's file, `.xml`; the scenario gets the same name with `.toml`.
        observer: Observer in the scenario's loop.
        overwrite: Whether the files of an earlier mount are replaced. Others never are.
        time_limit: The time to try in MuJoCo what the robot stands, and a larger scale if it does not; None to leave
            that out.
        with_plugin: Whether a plugin of MuJoCo is written too, into a folder beside the model.

    Returns:
        The robot, its files and its limits.

    Raises:
        InputError: The robot or the request does not allow it, or a file cannot be written.
    """
    robot, file = Path(robot), expanded(target, "-o")
    OBSERVER_CLASSES.find(observer)
    check_target(file, expanded(robot, "ROBOT"))
    check_replaceable(file, overwrite=overwrite)
    if with_plugin:
        require_tools()
        check_plugin_folder(file, expanded(robot, "ROBOT"), overwrite=overwrite)
    mounted = _mount(robot, request)
    with with_scenario(file) as model:
        mounted.save(model)
        experiment = write_scenario(model, mounted.path, observer, axis=request.name)
        if with_plugin:
            check_plugin(experiment, file)
        limits = prospects(experiment, request.name)
        simulated = sufficient = plugin = None
        if time_limit is not None:
            simulated = simulated_push(experiment, limits, request.name, time_limit)
            if math.degrees(limits.limit.tilt) < LOW_LIMIT_DEG or simulated.falls:
                trial = model.with_suffix(".trial.xml")
                sufficient = _sufficient_scale(robot, request, trial, observer, time_limit)
        pushed = write_scenario(model, mounted.path, observer, limits, request.name, simulated) if with_plugin else None
        rig = RigSettings(sliding_axes(experiment.plant), observer_parameters(observer, experiment))
        text = scenario_text(file.name, mounted.path, observer, limits, request.name, simulated, rig)
        model.with_suffix(".toml").write_bytes(signed(text, ".toml"))
        check_replaceable(file, overwrite=overwrite)  # also what has come meanwhile
        if pushed:
            plugin = write_mounted_plugin(pushed, file)
    plant = experiment.plant.single_axis(request.name)
    demands = pair_demands(plant, experiment.law.rate_limit, request.scale)
    return MountResult(mounted, file, plant, observer, limits, simulated, demands, sufficient, plugin)


def _mount(robot: Path, request: MountRequest) -> MountedRobot:
    try:
        return mount_on_request(robot, request)
    except InputError:
        raise
    except (ValueError, KeyError, mujoco.FatalError) as error:  # unforeseen errors of MuJoCo's model editing
        message = " ".join(str(error.args[0] if error.args else error).split()).removeprefix("Error: ")
        raise InputError(f"{robot}: MuJoCo cannot put a pair on it: {message}") from error


def _sufficient_scale(
    robot: Path, request: MountRequest, trial: Path, observer: str, time_limit: TimeLimit
) -> float | None:
    """Try larger scales until the ceiling is `LOW_LIMIT_DEG` or more and the robot stands in MuJoCo."""

    def suffices(scale: float) -> bool:
        time_limit.check(f"--scale {scale:g}")
        model = _mount(robot, dataclasses.replace(request, scale=scale)).save(trial)
        try:
            experiment = write_scenario(model, robot, observer, axis=request.name)
            limits = prospects(experiment, request.name, with_margin=False)
            enough = math.degrees(limits.limit.tilt) >= LOW_LIMIT_DEG
            return enough and standing_unpushed(experiment, limits, request.name, time_limit) == WORLDS
        finally:
            for file in (model, model.with_suffix(".toml")):
                file.unlink(missing_ok=True)

    try:
        return smallest_sufficient_scale(suffices, request.scale)
    except OutOfTimeError:
        return None


def write_scenario(
    model: Path,
    robot: Path,
    observer: str,
    limits: Prospects | None = None,
    axis: str = "",
    simulated: SimulatedPush | None = None,
) -> Experiment:
    """Write a scenario beside a model that carries a pair.

    Args:
        model: The model's file; the scenario gets the same name with `.toml`.
        robot: The robot that the model was made from, for the title.
        observer: Observer in the loop.
        limits: Limits of the pair, which set the first tilt and the push; without them there is neither.
        axis: Name of the axis that the limits are of.
        simulated: The push that the robot stands in MuJoCo, which then sets the push.

    Returns:
        The prepared experiment.
    """
    path = model.with_suffix(".toml")

    def written(kind: str, settings: RigSettings) -> Scenario:
        text = scenario_text(model.name, robot, kind, limits, axis, simulated, settings)
        with whole_file(path) as temporary:
            temporary.write_bytes(signed(text, ".toml"))
        return load_scenario(str(path))

    kind = SUITS_EVERY_RIG if scaled_names(observer) else observer
    rig = prepare(written(kind, RigSettings()))
    sliding = sliding_axes(rig.plant)
    if sliding:
        rig = prepare(written(kind, RigSettings(sliding)))
    if kind == observer:
        return rig
    return prepare(written(observer, RigSettings(sliding, observer_parameters(observer, rig))), rig.plant)


def sliding_axes(plant: Plant) -> list[str]:
    """Return the names of the axes whose pivot slides freely."""
    return [axis.name for axis in plant.axes if axis.reduced.pivot_arm]


def scenario_text(
    model: str,
    robot: Path,
    observer: str,
    limits: Prospects | None,
    axis: str,
    simulated: SimulatedPush | None = None,
    rig: RigSettings | None = None,
) -> str:
    """Return the scenario that `write_scenario` writes, as TOML."""
    sliding, parameters = rig or RigSettings()
    start = {"initial_tilt_deg": limits.start_tilt_deg if limits else 0.0}
    plant = {"model": model, "equilibrium_bias_deg": 0.0, **({"initial_tilt_deg": 0.0} if axis else start)}
    slides = {"pivot_slides": True}
    plant |= slides if "" in sliding else {}
    axes: dict[str, dict[str, Mapping[str, Number]]] = {axis: {"plant": start}} if axis else {}
    for name in filter(None, sliding):
        axes[name] = {"plant": {**axes.get(name, {}).get("plant", {}), **slides}}
    pushes: list[dict[str, str | float]] = []
    largest = simulated.impulse if simulated else limits.push_margin.median_impulse if limits else 0.0
    if largest:
        torque = float(f"{PUSH_SHARE * largest / PUSH_S:.3g}")
        pushed_axis = {"axis": axis} if axis else {}
        pushes = [{**pushed_axis, "start_s": PUSHED_AT_S, "duration_s": PUSH_S, "torque_n_m": torque}]
    observers = {name: its for name, its in parameters.items() if its}
    if len(observers) > 1:
        axes |= {name: {**axes.get(name, {}), "observer": its} for name, its in observers.items()}
    text = tomli_w.dumps(
        {
            "title": f"{robot.stem}, balanced",
            "duration_s": DURATION_S,
            "plant": plant,
            "controller": {"gains": "scaled"},
            "observer": {"kind": observer, **(next(iter(observers.values())) if len(observers) == 1 else {})},
            **({"axes": axes} if axes else {}),
            **({"push": pushes} if pushes else {}),
        }
    )
    if not observers:
        return text
    return with_comment(text, SCALED_COMMENT, "[axes" if len(observers) > 1 else "[observer]")


def with_comment(text: str, comment: str, header: str) -> str:
    """Put a comment above the first header in a TOML text that begins so."""
    return text.replace(f"\n{header}", f"\n{comment}\n{header}", 1)


def observer_parameters(kind: str, experiment: Experiment) -> AxesParameters:
    """Carry an observer's parameters to a robot, axis by axis, in the digits that its scenario shows."""
    parts = experiment.parts
    return {
        part.plant.axis.name: {
            name: _round(value) for name, value in scaled_parameters(kind, part.plant.reduced).items()
        }
        for part in parts
    }


def _round(value: Number) -> Number:
    return tuple(map(_round, value)) if isinstance(value, tuple) else float(f"{value:.{DIGITS}g}")


def plugin_folder(target: Path) -> Path:
    """Return the folder of the plugin that belongs to a mounted model."""
    return target.with_name(f"{target.stem}_plugin")


def plugin_name(target: Path) -> str:
    """Name a plugin after a model's file, in letters, digits and _: `my robot.xml` has my_robot."""
    words = re.sub(r"[^A-Za-z0-9]+", "_", target.stem, flags=re.ASCII).strip("_")
    name = words if words[:1].isalpha() else f"robot_{words}".rstrip("_")
    taken = {name, name.lower()} & (RESERVED | NAMES_IN_USE)
    return f"{name}_robot" if taken else name[:LONGEST]


def check_plugin_folder(target: Path, robot: Path, *, overwrite: bool) -> None:
    """Check that the folder of a plugin may be written, by the rules that hold for the mounted model.

    Args:
        target: The model's file.
        robot: The robot's own file.
        overwrite: Whether the plugin of an earlier mount is replaced.

    Raises:
        InputError: The folder holds a file of the robot's, or anything that may not be replaced.
    """
    folder = plugin_folder(target)
    originals = model_files(robot) if robot.is_file() else []
    if any(folder.resolve() in file.resolve().parents for file in originals):
        raise InputError(f"-o {target}: {folder} holds the robot's own file, or one that it names; give another name")
    if os.path.lexists(folder) and not is_own(folder):
        raise InputError(f"-o {target}: {folder} holds files that cmg-mj did not write; give another name")
    if folder.exists() and not overwrite:
        raise InputError(f"-o {target}: {folder} exists; give another name, or --overwrite")


def check_plugin(experiment: Experiment, target: Path) -> None:
    """Generate a plugin as `write_mounted_plugin` does, before what takes a minute.

    Raises:
        InputError: Something in use cannot be exported.
    """
    make_plugin(experiment, plugin_name(target), start="spinning")


def write_mounted_plugin(experiment: Experiment, target: Path) -> Plugin:
    """Write the plugin of a mounted robot, whole or not at all.

    Args:
        experiment: The robot's scenario, prepared.
        target: The mounted model's file, after which the plugin is named.

    Returns:
        The plugin. It sets the flywheels going itself, since a robot's own programs do not.

    Raises:
        InputError: Something in use cannot be exported, or the folder cannot be written.
    """
    made = make_plugin(experiment, plugin_name(target), start="spinning")
    with RunFolder(plugin_folder(target), overwrite=True) as folder:
        return write_plugin(made, folder)


MAX_TUNING_S = 120.0
"""The search ends after so long, with the best parameters so far [s]."""
TUNED_WORLDS = 8
"""Worlds that are fitted; as many others are scored."""
TUNED_COMMENT = "# The observer's parameters, tuned on this robot by cmg-mj mount --tune"


class MountTuning(NamedTuple):
    """The observer of a mounted robot with its parameters tuned, beside those that it was mounted with."""

    study: TuningResult
    margin: float
    """E of the reduced model, as mounted [N m s]."""
    tuned_margin: float
    """E of the reduced model with the tuned parameters [N m s]."""
    in_use: bool
    """True if the scenario has the tuned parameters now."""
    whole: bool
    """True if the search came to its end."""

    @property
    def level(self) -> NoiseLevelResult:
        """The parameters and their scores."""
        return self.study.levels[0]

    def figures(self) -> dict[str, ParameterValue]:
        """Return the figures that `cmg-mj mount --tune --json` prints beside the mount's."""
        return {
            "tuned_held_out_fit": self.level.fit,
            "tuned_given_held_out_fit": self.level.given_fit,
            "tuned_push_margin_impulse_n_m_s": self.tuned_margin,
            "tuned_in_use": self.in_use,
            "tuned_whole": self.whole,
        }

    def line(self) -> str:
        """Describe the result in a line."""
        numbers = ", ".join(f"{name} {size:.4g}" for name, size in self.level.sizes.items())
        began = "tuned" if self.whole else "tuned as far as there was time"
        if self.in_use:
            verdict = "the scenario has the tuned ones"
        elif self.level.verdict != "better":
            verdict = "the scenario keeps the others, because tuned ones are not better beyond chance"
        else:
            verdict = "the scenario keeps the others, because with tuned ones it stands less"
        return (
            f"  {self.study.kind} {began} on {TUNED_WORLDS} worlds: {numbers}; on {TUNED_WORLDS} others its fit is "
            f"{self.level.fit:.2f} (before {self.level.given_fit:.2f}), and by the reduced model E = "
            f"{self.tuned_margin:.3g} N m s (before {self.margin:.3g}): {verdict}"
        )


def tune_mounted(
    path: Path,
    *,
    stop: Callable[[], bool] = lambda: False,
    on_share: Callable[[float], None] | None = None,
) -> MountTuning:
    """Tune the observer of a mounted robot, and write its parameters if they are better in both ways.

    The loop is closed on the gyro, as in `cmg-mj tune`, so that the smallest error may be that of an estimate near
    zero, with which nothing stands: the tuned parameters must not have a smaller E either.

    Args:
        path: The scenario that the mount has written.
        stop: Whether to end the search now.
        on_share: Called now and then with the completed share.

    Returns:
        The result.

    Raises:
        InputError: There is nothing to tune, the robot falls without its observer, or the file cannot be written.
    """
    experiment = prepare(load_scenario(str(path)))
    experiment.require_single_axis("mount --tune")
    end, stopped = time.monotonic() + MAX_TUNING_S, False

    def over() -> bool:
        nonlocal stopped
        stopped = stopped or stop() or time.monotonic() > end
        return stopped

    study = tune(experiment.scenario, worlds=TUNED_WORLDS, starts=1, on_share=on_share, stop=over)
    level = study.levels[0]
    tuned = prepare(tuned_scenario(study, level), experiment.plant)
    margins = [push_margin(loop.scenario, loop.design).median_impulse for loop in (experiment, tuned)]
    better = level.verdict == "better" and margins[1] >= margins[0]
    if better:
        _write(path, level)
    return MountTuning(study, margins[0], margins[1], better, not stopped)


def _write(path: Path, level: NoiseLevelResult) -> None:
    """Replace the parameters in a mounted robot's scenario.

    Raises:
        InputError: No mount has written it.
    """
    if not is_signed(path):
        raise InputError(f"{path}: is not a file of cmg-mj mount; the tuned parameters are not written")
    fields = tomllib.loads(path.read_text(encoding="utf-8"))
    fields["observer"] |= plain(level.parameters)
    with whole_file(path) as temporary:
        temporary.write_bytes(signed(with_comment(tomli_w.dumps(fields), TUNED_COMMENT, "[observer]"), ".toml"))
