"""A robot with a pair mounted on it, written as a model and a scenario to run, with a plugin, tuned."""

from __future__ import annotations

import math
import re
import time
import tomllib
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import tomli_w

from cmg_mj.core.errors import InputError
from cmg_mj.features.export.names import LONGEST, RESERVED
from cmg_mj.features.mounting.limits import (
    LOW_LIMIT_DEG,
    PUSH_S,
    WORLDS,
    PairDemands,
    Prospects,
    pair_demands,
    prospects,
    push_margin,
)
from cmg_mj.features.mounting.mount import PLUGIN, MountedRobot, check_target, mount, with_scenario
from cmg_mj.features.mounting.push import OutOfTimeError, SimulatedPush, TimeLimit, simulated_push, standing_unpushed
from cmg_mj.features.mounting.request import SCALES, MountRequest
from cmg_mj.features.plugin.make import Plugin, make_plugin, require_tools, write_plugin
from cmg_mj.features.plugin.tables import NAMES_IN_USE
from cmg_mj.features.tuning import NoiseLevelResult, TuningResult, tune, tuned_scenario
from cmg_mj.features.tuning.search import plain
from cmg_mj.inputs.files import expanded
from cmg_mj.observers import OBSERVER_CLASSES
from cmg_mj.observers.parameter_options import ParameterValue
from cmg_mj.observers.scaling import Number, scaled_parameters
from cmg_mj.plant.plant import Plant, load_plant
from cmg_mj.results.folder import RunFolder, signed, whole_file
from cmg_mj.runs.experiment import Experiment, prepare
from cmg_mj.scenario.loading import load_scenario

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
TUNED_COMMENT = "# The observer's parameters, tuned on this robot by cmg-mj mount --tune"
MAX_TUNING_S = 120.0
"""The search ends after so long, with the best parameters so far [s]."""
TUNED_WORLDS = 8
"""Worlds that are fitted; as many others are scored."""


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

    def figures(self) -> dict[str, Any]:
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
            **self.demands._asdict(),
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
    file, axis = expanded(target, "-o"), request.name
    OBSERVER_CLASSES.find(observer)
    endings = [".xml", ".toml", *([PLUGIN] if with_plugin else [])]
    check_target(file, expanded(robot, "ROBOT"), endings, overwrite=overwrite)
    if with_plugin:
        require_tools()
    mounted = mount(robot, **vars(request))
    simulated = sufficient = plugin = None
    with with_scenario(file) as model:
        experiment = write_scenario(mounted.save(model), mounted.path, observer, axis=axis)
        if with_plugin:  # what cannot be exported is refused before what takes a minute
            make_plugin(experiment, plugin_name(file), start="spinning")
        limits = prospects(experiment, axis)
        if time_limit is not None:
            simulated = simulated_push(experiment, limits, axis, time_limit)
            if math.degrees(limits.limit.tilt) < LOW_LIMIT_DEG or simulated.falls:
                sufficient = _sufficient_scale(robot, request, model.with_suffix(".trial.xml"), observer, time_limit)
        experiment = write_scenario(model, mounted.path, observer, limits, axis, simulated)
        if with_plugin:
            made = make_plugin(experiment, plugin_name(file), start="spinning")
            with RunFolder(file.with_name(file.stem + PLUGIN), overwrite=True) as folder:
                plugin = write_plugin(made, folder)
    plant = experiment.plant.single_axis(axis)
    demands = pair_demands(plant, experiment.law.rate_limit, request.scale)
    return MountResult(mounted, file, plant, observer, limits, simulated, demands, sufficient, plugin)


def _sufficient_scale(
    robot: str | Path, request: MountRequest, trial: Path, observer: str, time_limit: TimeLimit
) -> float | None:
    """Try larger scales, in steps of a tenth, until the ceiling is `LOW_LIMIT_DEG` or more and the robot stands."""
    scale = request.scale
    try:
        while (scale := round(1.1 * scale, 2)) <= SCALES[1]:
            time_limit.check(f"--scale {scale:g}")
            mount(robot, **vars(replace(request, scale=scale))).save(trial)
            experiment = write_scenario(trial, Path(robot), observer, axis=request.name)
            limits = prospects(experiment, request.name, with_margin=False)
            enough = math.degrees(limits.limit.tilt) >= LOW_LIMIT_DEG
            if enough and standing_unpushed(experiment, limits, request.name, time_limit) == WORLDS:
                return scale
    except (OutOfTimeError, InputError):  # there is no room for it, say
        pass
    finally:
        for file in (trial, trial.with_suffix(".toml")):
            with suppress(OSError):
                file.unlink()
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
    largest = simulated.impulse if simulated else limits.push_margin.median_impulse if limits else 0.0
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
    header = "[axes" if len(names) > 1 else "[observer]"
    path = model.with_suffix(".toml")
    _write_signed(path, fields, SCALED_COMMENT if parameters else "", header)
    return prepare(load_scenario(str(path)), like=plant)


def _write_signed(path: Path, fields: dict[str, Any], comment: str, header: str) -> None:
    """Write a scenario with a comment above the first header that begins so."""
    text = tomli_w.dumps(fields)
    if comment:
        text = text.replace(f"\n{header}", f"\n{comment}\n{header}", 1)
    with whole_file(path) as temporary:
        temporary.write_bytes(signed(text, ".toml"))


def _round(value: Number) -> Number:
    return tuple(map(_round, value)) if isinstance(value, tuple) else float(f"{value:.{DIGITS}g}")


def plugin_name(target: Path) -> str:
    """Name a plugin after a model's file, in letters, digits and _: `my robot.xml` has my_robot."""
    words = re.sub(r"[^A-Za-z0-9]+", "_", target.stem, flags=re.ASCII).strip("_")
    name = words if words[:1].isalpha() else f"robot_{words}".rstrip("_")
    taken = {name, name.lower()} & (RESERVED | NAMES_IN_USE)
    return f"{name}_robot" if taken else name[:LONGEST]


class MountTuning(NamedTuple):
    """The observer of a mounted robot with its parameters tuned, beside those that it was mounted with."""

    study: TuningResult
    margin: float
    """E of the reduced model, as mounted [N m s]."""
    tuned_margin: float
    """E of the reduced model with the tuned parameters [N m s]."""
    whole: bool
    """True if the search came to its end."""

    @property
    def level(self) -> NoiseLevelResult:
        """The parameters and their scores."""
        return self.study.levels[0]

    @property
    def in_use(self) -> bool:
        """True if the scenario has the tuned parameters: they are better on other worlds, and E is no smaller."""
        return self.level.verdict == "better" and self.tuned_margin >= self.margin

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
        verdict = "the scenario keeps the others, because with tuned ones it stands less"
        if self.in_use:
            verdict = "the scenario has the tuned ones"
        elif self.level.verdict != "better":
            verdict = "the scenario keeps the others, because tuned ones are not better beyond chance"
        return (
            f"  {self.study.kind} {began} on {TUNED_WORLDS} worlds: {numbers}; on {TUNED_WORLDS} others its fit is "
            f"{self.level.fit:.2f} (before {self.level.given_fit:.2f}), and by the reduced model E = "
            f"{self.tuned_margin:.3g} N m s (before {self.margin:.3g}): {verdict}"
        )


def tune_mounted(
    path: Path, *, stop: Callable[[], bool] = lambda: False, on_share: Callable[[float], None] | None = None
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
    tuned = prepare(tuned_scenario(study, study.levels[0]), experiment.plant)
    margins = [push_margin(loop.design).median_impulse for loop in (experiment, tuned)]
    result = MountTuning(study, *margins, whole=not stopped)
    if result.in_use:
        fields = tomllib.loads(path.read_text(encoding="utf-8"))
        fields["observer"] |= plain(result.level.parameters)
        _write_signed(path, fields, TUNED_COMMENT, "[observer]")
    return result
