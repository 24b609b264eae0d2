"""Makes an engine plugin of MuJoCo from an experiment: library, model and examples."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from cmg_mj.codegen.engine_plugin.build import check_platform, compile_plugin
from cmg_mj.codegen.engine_plugin.generate import PluginCode, generate_plugin
from cmg_mj.codegen.engine_plugin.rig import PluginAxis, PluginModule, PluginRig
from cmg_mj.codegen.export.check import find_compiler
from cmg_mj.codegen.export.names import name_of
from cmg_mj.errors import InputError
from cmg_mj.plant.plugin_model import load_library, write_model
from cmg_mj.scenario.schema import Scenario
from cmg_mj.simulation.experiment import Experiment, prepare


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


def describe_rig(experiment: Experiment, name: str, world: int = 0) -> PluginRig:
    """Describe an experiment's rig and its controllers."""
    axes = []
    for i, part in enumerate(experiment.parts):
        axis = part.plant.axis
        modules = tuple(PluginModule(module.name, module.direction, module.speed) for module in axis.modules)
        controller = part.design.controller(part.plant.interface, worlds=world, axis=i)
        axes.append(PluginAxis(axis.prefix, modules, controller))
    return PluginRig(tuple(axes), f"cmg_mj.{name}")


def plugin(scenario: Scenario | Experiment, out: Path, *, name: str | None = None, sensors: bool = True) -> Plugin:
    """Make an engine plugin of MuJoCo: wherever MuJoCo loads its model, the robot balances.

    Args:
        scenario: The scenario, or one that has been prepared.
        out: Folder to write to.
        name: The plugin's name behind `cmg_mj.`; by default the observer's.
        sensors: Whether the model has sensors that show estimate, command and the rest.

    Returns:
        What was written.

    Raises:
        InputError: Something in use cannot be exported, or there is no compiler.
    """
    check_platform()
    experiment = scenario if isinstance(scenario, Experiment) else prepare(scenario)
    c_name = name_of(experiment.parts[0].design.observer(), name)
    rig = describe_rig(experiment, c_name)
    code = generate_plugin(rig, c_name)
    compiler = find_compiler()
    if compiler is None:
        raise InputError("plugin: there is no C compiler: install gcc or clang, or name one in CC")
    out.mkdir(parents=True, exist_ok=True)
    sources = _write_sources(code, out / "source")
    library, model = out / f"libcmg_mj_{c_name}.so", out / f"{c_name}.xml"
    compile_plugin(out / "source", compiler, code.sources, f"../{library.name}")
    load_library(library, rig.plugin)
    write_model(experiment.plant, rig.plugin, model, sensors)
    return Plugin(rig.plugin, library, model, [library, model, *sources])


def _write_sources(code: PluginCode, folder: Path) -> list[Path]:
    folder.mkdir(exist_ok=True)
    for name, text in code.files.items():
        (folder / name).write_text(text, encoding="utf-8")
    return [folder / name for name in code.files]
