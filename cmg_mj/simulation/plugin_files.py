"""Writes an engine plugin of MuJoCo: library, model and examples."""

from __future__ import annotations

import copy
import itertools
import tempfile
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Literal, NamedTuple, Protocol

import mujoco

from cmg_mj.codegen.engine_plugin.build import check_platform, compile_plugin
from cmg_mj.codegen.engine_plugin.files import extra_files, library_name
from cmg_mj.codegen.engine_plugin.generate import PluginCode, generate_plugin
from cmg_mj.codegen.engine_plugin.rig import PluginAxis, PluginModule, PluginRig
from cmg_mj.codegen.export import check_installed
from cmg_mj.codegen.export.names import name_of
from cmg_mj.controllers.laws import StateFeedback
from cmg_mj.errors import InputError
from cmg_mj.linear.verdict import require_stable_period
from cmg_mj.plant.mujoco_state import set_control_callback
from cmg_mj.plant.plant import Plant
from cmg_mj.plant.plugin_model import plugin_mjcf
from cmg_mj.results.run_folder import RunFolder
from cmg_mj.results.run_folder.folder import claimed, write_text
from cmg_mj.scenario.design import Design
from cmg_mj.scenario.omissions import IN_THE_MODEL, omissions
from cmg_mj.scenario.schema import Scenario

LIBRARY_MODE = 0o755

Start = Literal["keyframe", "spinning"]


class PluginSource(Protocol):
    """The parts of an experiment that a plugin is made from."""

    @property
    def scenario(self) -> Scenario:
        """The scenario."""
        ...

    @property
    def plant(self) -> Plant:
        """The rig."""
        ...

    @property
    def design(self) -> Design:
        """The law and the observer."""
        ...

    @property
    def parts(self) -> Sequence[PluginSource]:
        """One an axis."""
        ...


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


class PluginTexts(NamedTuple):
    """A plugin before it is compiled.

    Attributes:
        name: The plugin's name behind `cmg_mj.`.
        code: Its C.
        texts: All files but the library: name -> text.
    """

    name: str
    code: PluginCode
    texts: dict[str, str]


def describe_rig(experiment: PluginSource, name: str, world: int = 0) -> PluginRig:
    """Describe an experiment's rig and its controllers."""
    for part in experiment.parts:
        for field, clause in omissions(part.scenario).items():
            if field not in IN_THE_MODEL:
                raise InputError(f"{field}: {clause}: a plugin does not have it")
    axes = []
    for i, part in enumerate(experiment.parts):
        axis = part.plant.axis
        modules = tuple(
            PluginModule(module.name, module.direction, module.speed, module.gimbal_zero) for module in axis.modules
        )
        controller = part.design.controller(part.plant.interface, worlds=world, axis=i)
        joint = mujoco.mj_id2name(part.plant.model, mujoco.mjtObj.mjOBJ_JOINT, axis.line.joint)
        axes.append(PluginAxis(axis.prefix, modules, joint, tuple(axis.line.push[1]), controller))
    compensates = len(axes) > 1 and experiment.scenario.controller.compensate_turning
    turning = (experiment.plant.turning, experiment.scenario.sensors.mems_gyro) if compensates else None
    return PluginRig(tuple(axes), f"cmg_mj.{name}", turning)


def check_tools() -> None:
    """Check what a plugin's C is generated with, before anything is computed.

    Raises:
        InputError: CasADi is missing, or the platform is not supported.
    """
    check_platform()
    check_installed()


def find_tools() -> list[str]:
    """Find what a plugin is made with, before anything is computed.

    Returns:
        Command of the compiler.

    Raises:
        InputError: CasADi or a compiler is missing, or the platform is not supported.
    """
    check_tools()
    compiler = _find_compiler()
    if compiler is None:
        raise InputError("plugin: there is no C compiler: install gcc or clang, or name one in CC")
    return compiler


def _find_compiler() -> list[str] | None:
    from cmg_mj.codegen.export.check import find_compiler  # imports CasADi

    return find_compiler()


def require_stable_periods(experiment: PluginSource) -> None:
    """Refuse a control period so long that (8) does not hold an axis, as `cmg-mj export` does.

    Raises:
        InputError: An axis would fall.
    """
    for part in experiment.parts:
        if not isinstance(part.design.law, StateFeedback):
            continue
        try:
            require_stable_period(part.design.law, part.plant.reduced)
        except InputError as error:
            name = part.plant.axis.name
            raise InputError(f"axis {name}: {error}" if name else str(error)) from error


def make_plugin(
    experiment: PluginSource,
    name: str | None = None,
    *,
    sensors: bool = True,
    start: Start = "keyframe",
    world: int = 0,
) -> PluginTexts:
    """Generate a plugin's C and its model: see `plugin`. Its noise is that of a world, unless the model says other."""
    name = name_of(experiment.parts[0].design.observer(), name)
    rig = describe_rig(experiment, name, world)
    code = generate_plugin(rig, name)
    texts = code.files | extra_files(name, code.files, code.sources, experiment.plant.axis_names[0])
    texts[f"{name}.xml"] = plugin_mjcf(experiment.plant, rig.plugin, {"start": start, "build": code.build}, sensors)
    return PluginTexts(name, code, texts)


def plugin_files(made: PluginTexts) -> list[str]:
    """Name the files of a plugin."""
    return [*made.texts, library_name(made.name)]


def write_plugin(made: PluginTexts, out: Path | RunFolder) -> Plugin:
    """Compile a plugin and write it to a folder: see `plugin`."""
    name, library = made.name, library_name(made.name)
    compiler = find_tools()
    writers = _writers(made)
    with tempfile.TemporaryDirectory() as temporary, claimed(out, plugin_files(made)) as folder:
        compiled = Path(temporary) / library
        for file in made.code.files:
            writers[file](Path(temporary) / file)
        compile_plugin(Path(temporary), compiler, made.code.sources, library)
        writers[library] = partial(_copy, compiled)
        place = folder.write(writers, all_or_none=True)
    files = [place / file for file in plugin_files(made)]
    return Plugin(f"cmg_mj.{name}", place / library, place / f"{name}.xml", files)


def write_plugin_or_sources(made: PluginTexts, out: Path | RunFolder) -> Plugin:
    """Compile a plugin and write it: see `plugin`.

    Raises:
        InputError: There is no compiler. All but the library is written.
    """
    if _find_compiler() is not None:
        return write_plugin(made, out)
    with claimed(out, list(made.texts)) as folder:
        place = folder.write(_writers(made), all_or_none=True)
    raise InputError(
        f"plugin: {library_name(made.name)} is missing, for no C compiler was found (CC, cc, gcc, clang); the other "
        f"files are in {place}: run `make` there where there is a compiler"
    )


def _writers(made: PluginTexts) -> dict[str, Callable[[Path], None]]:
    return {file: partial(write_text, text=text) for file, text in made.texts.items()}


def _copy(source: Path, target: Path) -> None:
    target.write_bytes(source.read_bytes())
    target.chmod(LIBRARY_MODE)


_numbers = itertools.count()
"""A process registers a plugin's name once."""


def unused_name() -> str:
    """Name a plugin as none in this process has been named."""
    return f"run_{next(_numbers)}"


def plant_with_plugin(experiment: PluginSource, world: int = 0) -> Plant:
    """Make the plant of an experiment with a plugin in its model, whose library is compiled and loaded.

    Raises:
        InputError: Something in use cannot be exported, or there is no compiler.
    """
    made = make_plugin(experiment, unused_name(), world=world)
    with tempfile.TemporaryDirectory() as temporary, set_control_callback(None):
        written = write_plugin(made, Path(temporary))
        mujoco.mj_loadPluginLibrary(str(written.library))
        plant = copy.copy(experiment.plant)
        plant.model = mujoco.MjModel.from_xml_path(str(written.model))
    return plant
