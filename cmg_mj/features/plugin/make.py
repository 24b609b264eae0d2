"""Makes an engine plugin of MuJoCo from a scenario: library, model and examples."""

from __future__ import annotations

import copy
import itertools
import shutil
import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, Literal, NamedTuple, Unpack

import mujoco

from cmg_mj.core.errors import InputError
from cmg_mj.core.rig import RigControl
from cmg_mj.features.export.compiler import find_compiler
from cmg_mj.features.export.names import name_of
from cmg_mj.features.export.pipeline import require_traceable
from cmg_mj.features.plugin.driver import PluginLoop
from cmg_mj.features.plugin.model import plugin_mjcf
from cmg_mj.features.plugin.tables import (
    PluginCode,
    PluginRig,
    check_platform,
    compile_plugin,
    generate_plugin,
    library_name,
)
from cmg_mj.inputs.features import FEATURES
from cmg_mj.linear.verdict import require_stable_period
from cmg_mj.plant.mjcf import set_control_callback
from cmg_mj.results.folder import RunFolder, claimed, write_text
from cmg_mj.results.result import Result
from cmg_mj.runs.experiment import Experiment, prepare
from cmg_mj.runs.simulate import SimulationOptions
from cmg_mj.scenario.schema import Scenario

Start = Literal["keyframe", "spinning"]


class Plugin(NamedTuple):
    """A plugin as it was written.

    Attributes:
        name: Name under which MuJoCo knows it.
        library: The compiled library.
        model: The MJCF that names it.
        files: All files.
    """

    name: str
    library: Path
    model: Path
    files: list[Path]


def plugin(
    scenario: Scenario | Experiment,
    out: Path | RunFolder,
    *,
    name: str | None = None,
    sensors: bool = True,
    start: Start = "keyframe",
) -> Plugin:
    """Make an engine plugin of MuJoCo: wherever MuJoCo loads its model, the robot balances.

    Args:
        scenario: The scenario, or one that has been prepared.
        out: Folder to write to; made if need be.
        name: The plugin's name behind `cmg_mj.`; by default the observer's.
        sensors: Whether the model has sensors that show estimate, command and the rest.
        start: `keyframe`: a program sets the flywheels' rates, as the keyframe `start` does; `spinning`: the plugin
            does, for programs that reset to qpos0.

    Returns:
        What was written.

    Raises:
        InputError: Something in use cannot be exported, the control period is too long, or the folder holds files of
            the user's that would be overwritten. Without a compiler, all but the library is written.
    """
    experiment = scenario if isinstance(scenario, Experiment) else prepare(scenario)
    require_stable_periods(experiment)
    return write_plugin(make_plugin(experiment, name, sensors=sensors, start=start), out)


def require_tools() -> None:
    """Require what a plugin is made with, before anything is computed.

    Raises:
        InputError: A compiler is missing, or the platform is not supported.
    """
    check_platform()
    if find_compiler() is None:
        raise InputError("plugin: there is no C compiler: install gcc or clang, or name one in CC")


def require_stable_periods(experiment: Experiment) -> None:
    """Refuse a control period so long that (8) does not hold an axis, as `cmg-mj export` does.

    Raises:
        InputError: An axis would fall.
    """
    for part in experiment.axes:
        try:
            require_stable_period(part.design.law, part.plant.reduced)
        except InputError as error:
            name = part.name
            raise InputError(f"axis {name}: {error}" if name else str(error)) from error


def make_plugin(
    experiment: Experiment,
    name: str | None = None,
    *,
    sensors: bool = True,
    start: Start = "keyframe",
    world: int = 0,
) -> PluginCode:
    """Generate a plugin's C and its model: see `plugin`. Its noise is that of a world, unless the model says other."""
    check_platform()
    name = name_of(experiment.axes[0].design.observer(), name)
    rig = describe_rig(experiment, name, world)
    made = generate_plugin(rig, name)
    config = {"start": start, "build": made.build}
    made.files[f"{name}.xml"] = plugin_mjcf(experiment.plant, rig.plugin, config, sensors)
    return made


def describe_rig(experiment: Experiment, name: str, world: int = 0) -> PluginRig:
    """Describe an experiment's rig and its controllers.

    Raises:
        InputError: The scenario has something from outside that no plugin has, or an observer or law is no formula.
    """
    controls = []
    for i, part in enumerate(experiment.axes):
        for section, settings in part.scenario.feature_sections.items():
            words = next((one.unmodelled for one in settings if one.unmodelled), "")
            feature = FEATURES[section]
            if words and (feature.disturbance or feature.between):
                raise InputError(f"{section}: {words}: a plugin does not have it")
        control = part.design.axis_control(part.plant.interface, axis=i, open_loop_observers=())
        require_traceable(control)
        controls.append(control)
    between = tuple(experiment.between(controls))
    control = RigControl(tuple(controls), between)
    return PluginRig(experiment.plant, control, f"cmg_mj.{name}", experiment.scenario.seed, world)


def write_plugin(made: PluginCode, out: Path | RunFolder) -> Plugin:
    """Compile a plugin and write it to a folder: see `plugin`.

    Raises:
        InputError: The C does not compile, or there is no compiler: then all but the library is written.
    """
    name, library, compiler = made.name, library_name(made.name), find_compiler()
    writers: dict[str, Callable[[Path], Any]] = {
        file: partial(write_text, text=text) for file, text in made.files.items()
    }
    with tempfile.TemporaryDirectory() as temporary, claimed(out) as folder:
        if compiler is not None:
            compiled = Path(temporary, library)
            for file, text in made.files.items():
                write_text(compiled.with_name(file), text)
            compile_plugin(compiled.parent, compiler, made.sources, library)
            writers[library] = partial(shutil.copy, compiled)
        place = folder.write(writers, all_or_none=True)
    if compiler is None:
        raise InputError(
            f"plugin: {library} is missing, for no C compiler was found (CC, cc, gcc, clang); the other files are in "
            f"{place}: run `make` there where there is a compiler"
        )
    return Plugin(f"cmg_mj.{name}", place / library, place / f"{name}.xml", [place / file for file in writers])


_numbers = itertools.count()
"""A process registers a plugin's name once."""


def run_with_plugin(experiment: Experiment, world: int, **options: Unpack[SimulationOptions]) -> Result:
    """Run one world with a plugin in the model, whose library is compiled and loaded.

    Raises:
        InputError: Something in use cannot be exported, or there is no compiler.
    """
    require_tools()
    made = make_plugin(experiment, f"run_{next(_numbers)}", world=world)
    plant = copy.copy(experiment.plant)
    with tempfile.TemporaryDirectory() as temporary, set_control_callback(None):
        written = write_plugin(made, Path(temporary))
        mujoco.mj_loadPluginLibrary(str(written.library))
        plant.model = mujoco.MjModel.from_xml_path(str(written.model))
    return experiment.simulate(plant, experiment.controller(world), driver="plugin", loop=PluginLoop, **options)
