"""Writes a plant as an MJCF that names an engine plugin, with every number exact."""

from __future__ import annotations

import ctypes
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import mujoco
import numpy as np

from cmg_mj.errors import InputError
from cmg_mj.plant.mjcf import as_mjcf, compile_model
from cmg_mj.plant.mujoco_state import quiet, set_control_callback
from cmg_mj.plant.parts import EQUILIBRIUM_KEY
from cmg_mj.plant.plant import Plant

INSTANCE = "balance"
"""Name of the plugin's instance; of an attached rig the prefix stands before it."""
START_KEY = "start"
"""Keyframe of the scenario's initial state."""
QUANTITIES = ("estimate", "command", "tilt", "gimbal_angle", "acceleration", "integrator", "sample")
"""What the plugin shows as sensors, of each axis."""
EXACT_DIGITS = 17
PHYSICS = ("body_", "jnt_", "dof_", "site_pos", "site_quat", "actuator_", "sensor_", "eq_", "tendon_", "key_")
"""Beginnings of the names of what the written model must have in common with the plant."""
DERIVED = ("bvh", "_plugin", "name", "geom", "sensor_", "mocapid", "sameframe", "key_", "dof_length")


def load_library(library: Path, plugin: str) -> None:
    """Load a plugin's library into MuJoCo, unless it has been loaded.

    Raises:
        InputError: It registers no plugin of that name.
    """
    mujoco.mj_loadPluginLibrary(str(library.resolve()))


def write_model(plant: Plant, plugin: str, path: Path, sensors: bool = True) -> mujoco.MjModel:
    """Write a plant's model with an instance of a plugin, whose library has been loaded.

    Args:
        plant: The plant.
        plugin: Name of the plugin.
        path: File to write.
        sensors: Whether the plugin's sensors are in the model.

    Returns:
        The compiled model.

    Raises:
        InputError: MuJoCo does not write or read the model, or what it reads is not the plant.
    """
    with set_control_callback(None), quiet(), _exact_numbers():
        drawn = plant.drawn_spec()
        compile_model(drawn, plant.path)
        spec = mujoco.MjSpec.from_string(as_mjcf(drawn, plant.path))
        _take_over(spec, compile_model(spec, plant.path), plant)
        _add_instance(spec, plugin, plant.axis_names if sensors else ())
        model = compile_model(spec, path)
        text = as_mjcf(spec, path)
    path.write_text(text, encoding="utf-8")
    with set_control_callback(None):
        model = mujoco.MjModel.from_xml_path(str(path))
    if different := differences(plant.model, model):
        raise InputError(f"{path}: MuJoCo does not read what it has written: {', '.join(different)} differ")
    return model


def differences(plant: mujoco.MjModel, written: mujoco.MjModel) -> list[str]:
    """List the arrays of physics in which two models differ."""
    names = [name for name in dir(plant) if name.startswith(PHYSICS) and not any(part in name for part in DERIVED)]
    arrays = [(name, getattr(plant, name), getattr(written, name)) for name in names]
    return [name for name, a, b in arrays if isinstance(a, np.ndarray) and not np.array_equal(a, b)]


@contextmanager
def _exact_numbers() -> Iterator[None]:
    """Have MuJoCo write numbers with all their digits: it has a function for this, though no public one."""
    library = ctypes.CDLL(str(Path(mujoco.__file__).parent / f"libmujoco.so.{mujoco.__version__}"))
    before = library._mjPRIVATE__get_xml_precision()
    library._mjPRIVATE__set_xml_precision(EXACT_DIGITS)
    try:
        yield
    finally:
        library._mjPRIVATE__set_xml_precision(before)


def _take_over(spec: mujoco.MjSpec, filed: mujoco.MjModel, plant: Plant) -> None:
    """Give a parsed model, as its file has it, what the plant's settings change: see `plant.variations`."""
    model = plant.model
    spec.option.timestep, spec.option.integrator = model.opt.timestep, model.opt.integrator
    spec.option.disableflags = model.opt.disableflags
    for body in spec.bodies:
        i = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, body.name)
        if i >= 0 and not np.array_equal(filed.body(body.name).ipos, model.body_ipos[i]):
            body.ipos = model.body_ipos[i]
    for joint in spec.joints:
        dof = int(model.jnt_dofadr[model.joint(joint.name).id])
        joint.armature, joint.frictionloss = model.dof_armature[dof], model.dof_frictionloss[dof]
        joint.damping[0] = model.dof_damping[dof]
    for site in spec.sites:
        if not np.array_equal(filed.site(site.name).pos, model.site(site.name).pos):
            site.pos = model.site(site.name).pos
    for actuator in spec.actuators:
        i = model.actuator(actuator.name).id
        actuator.gainprm[:] = model.actuator_gainprm[i]
        actuator.biasprm[:] = model.actuator_biasprm[i]
    start = plant.new_data()
    for key in spec.keys:
        if key.name == EQUILIBRIUM_KEY:
            key.qvel, key.ctrl = model.key_qvel[plant.key], model.key_ctrl[plant.key]
    spec.add_key(name=START_KEY, qpos=start.qpos, qvel=start.qvel, act=start.act, ctrl=start.ctrl)


def _add_instance(spec: mujoco.MjSpec, plugin: str, axes: Sequence[str]) -> None:
    """Add an instance of the plugin, and the sensors that it shows for some axes."""
    spec.activate_plugin(plugin)
    instance = spec.add_plugin(name=INSTANCE, plugin_name=plugin, active=True)
    for axis in axes:
        for quantity in QUANTITIES:
            name = "/".join(filter(None, (INSTANCE, axis, quantity)))
            sensor = spec.add_sensor(name=name, type=mujoco.mjtSensor.mjSENS_PLUGIN, needstage=mujoco.mjtStage.mjSTAGE_VEL)
            sensor.plugin = instance
