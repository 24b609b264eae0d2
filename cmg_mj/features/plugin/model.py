"""Writes a plant as an MJCF that names an engine plugin, with every number exact."""

from __future__ import annotations

import ctypes
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from html import escape
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from cmg_mj.core.errors import InputError
from cmg_mj.plant.elements import EQUILIBRIUM_KEY
from cmg_mj.plant.mjcf import as_mjcf, compile_model, quiet, set_control_callback
from cmg_mj.plant.plant import Plant

PLACES = {
    mujoco.MjsBody: ("body", "quat"),
    mujoco.MjsSite: ("site", "quat"),
    mujoco.MjsJoint: ("jnt", "axis"),
    mujoco.MjsGeom: ("geom", "quat"),
    mujoco.MjsCamera: ("cam", "quat"),
    mujoco.MjsLight: ("light", "dir"),
}
"""An element -> prefix of its arrays in a compiled model, and what says where it points."""
INSTANCE = "balance"
"""Name of the plugin's instance; of an attached rig the prefix stands before it."""
START_KEY = "start"
"""Keyframe of the scenario's initial state."""
QUANTITIES = ("estimate", "command", "tilt", "gimbal_angle", "acceleration", "integrator", "sample")
"""Quantities of each axis that the plugin shows as sensors."""
EXACT_DIGITS = 17
PHYSICS = ("body_", "jnt_", "dof_", "site_pos", "site_quat", "actuator_", "eq_", "tendon_", "pair_", "exclude_")
"""Prefixes of the attributes that the written model must have in common with the plant."""
SEEN_OR_DERIVED = ("bvh", "_plugin", "name", "geom", "mocapid", "sameframe", "length0", "dof_length", "_user")
"""Parts of the names of what geoms that are only seen change, or that no physics of a rig takes."""


def plugin_mjcf(plant: Plant, plugin: str, config: Mapping[str, str], sensors: bool = True) -> str:
    """Print a plant's model with an instance of a plugin.

    Args:
        plant: The plant.
        plugin: Name of the plugin.
        config: What the instance's <config> says: key -> value.
        sensors: Whether the plugin's sensors are in the model.

    Returns:
        The MJCF, with a keyframe `start` of the scenario's initial state.

    Raises:
        InputError: MuJoCo does not write the model, or what it reads of it is not the plant.
    """
    with set_control_callback(None), quiet(), _exact_numbers():
        drawn = plant.drawn_spec()
        drawn_model = compile_model(drawn, plant.path)
        spec = mujoco.MjSpec.from_string(as_mjcf(drawn, plant.path))
        _locate_files(spec, plant.path.parent)
        filed = compile_model(spec, plant.path)
        _take_out_of_frames(spec, drawn_model)
        _take_over(spec, filed, drawn_model, plant)
        compile_model(spec, plant.path)
        text = as_mjcf(spec, plant.path)
        different = differences(plant.model, mujoco.MjModel.from_xml_string(text))
    if different:
        raise InputError(f"{plant.path}: MuJoCo does not read what it has written: {', '.join(different)} differ")
    return _with_instance(text, plugin, config, plant.axis_names if sensors else ())


def differences(plant: mujoco.MjModel, written: mujoco.MjModel) -> list[str]:
    """List the arrays of physics in which two models differ."""
    names = [name for name in dir(plant) if name.startswith(PHYSICS)]
    names = [name for name in names if not any(part in name for part in SEEN_OR_DERIVED)]
    return [name for name in names if not np.array_equal(getattr(plant, name), getattr(written, name))]


def mujoco_library() -> ctypes.CDLL:
    """Return the library of MuJoCo's Python package, for functions that this does not have."""
    return ctypes.CDLL(str(Path(mujoco.__file__).with_name(f"libmujoco.so.{mujoco.__version__}")))


@contextmanager
def _exact_numbers() -> Iterator[None]:
    """Have MuJoCo write numbers with all their digits: it has a function for this, though no public one."""
    library = mujoco_library()
    before = library._mjPRIVATE__get_xml_precision()
    library._mjPRIVATE__set_xml_precision(EXACT_DIGITS)
    try:
        yield
    finally:
        library._mjPRIVATE__set_xml_precision(before)


def _locate_files(spec: mujoco.MjSpec, folder: Path) -> None:
    """Let the model find its meshes and textures wherever it is written."""
    if any(getattr(asset, "file", "") for asset in (*spec.meshes, *spec.textures, *spec.hfields)):
        spec.meshdir, spec.texturedir = (str((folder / part).resolve()) for part in (spec.meshdir, spec.texturedir))


def _take_out_of_frames(spec: mujoco.MjSpec, drawn: mujoco.MjModel) -> None:
    """Place what frames hold where a model has it, without the frames: each reading of a frame rounds again.

    A frame with a mesh in it stays, whose place MuJoCo takes otherwise.
    """
    otherwise = [geom for geom in spec.geoms if geom.meshname or not np.isnan(geom.fromto[0])]
    staying = [frame for geom in otherwise for frame in _frames_around(geom)]
    for frame in spec.frames:
        if not any(outer in staying for outer in (frame, *_frames_around(frame))):
            frame.pos, frame.quat = np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])
    for element in (*spec.bodies, *spec.sites, *spec.joints, *spec.geoms, *spec.cameras, *spec.lights):
        frames = _frames_around(element)
        if frames and not any(frame in staying for frame in frames):
            kind, direction = PLACES[type(element)]
            for name in ("pos", direction):
                setattr(element, name, getattr(drawn, f"{kind}_{name}")[element.id])


def _frames_around(element: Any) -> list[mujoco.MjsFrame]:
    """List the frames that an element is in, the innermost first."""
    frames = []
    while (frame := element.frame) is not None:
        frames.append(frame)
        element = frame
    return frames


def _take_over(spec: mujoco.MjSpec, filed: mujoco.MjModel, drawn: mujoco.MjModel, plant: Plant) -> None:
    """Give a parsed model what the plant's settings change: see `plant.settings`.

    Args:
        spec: The model, which is changed; of what was written it has read `filed`.
        filed: The same, compiled.
        drawn: The model before it was written.
        plant: The plant.
    """
    model = plant.model
    spec.option.timestep, spec.option.integrator = model.opt.timestep, model.opt.integrator
    spec.option.disableflags = model.opt.disableflags
    for body in spec.bodies:
        if any(
            not np.array_equal(getattr(filed, name)[body.id], getattr(model, name)[body.id])
            for name in ("body_ipos", "body_inertia")
        ):
            body.explicitinertial = True  # else MuJoCo takes it from the geoms
            body.mass, body.inertia = model.body_mass[body.id], model.body_inertia[body.id]
            body.ipos, body.iquat = model.body_ipos[body.id], model.body_iquat[body.id]
            body.fullinertia = np.full(6, np.nan)
    for joint in spec.joints:
        dof = int(model.jnt_dofadr[joint.id])
        joint.armature, joint.frictionloss = model.dof_armature[dof], model.dof_frictionloss[dof]
        joint.damping[0] = model.dof_damping[dof]
    for site in spec.sites:
        for name in ("pos", "quat"):
            if not np.array_equal(getattr(drawn, f"site_{name}")[site.id], getattr(model, f"site_{name}")[site.id]):
                setattr(site, name, getattr(model, f"site_{name}")[site.id])
    for actuator in spec.actuators:
        actuator.gainprm[:] = model.actuator_gainprm[actuator.id]
        actuator.biasprm[:] = model.actuator_biasprm[actuator.id]
    start = plant.new_data()
    for key in [key for key in spec.keys if key.name == START_KEY]:
        spec.delete(key)
    for key in spec.keys:
        if key.name == EQUILIBRIUM_KEY:
            key.qvel, key.ctrl = model.key_qvel[plant.key], model.key_ctrl[plant.key]
            key.qpos = _balanced(plant)
    spec.add_key(name=START_KEY, qpos=start.qpos, qvel=start.qvel, act=start.act, ctrl=start.ctrl)


def _balanced(plant: Plant) -> np.ndarray:
    """Return qpos at the keyframe where the plant balances: by e off the file's keyframe, about each axis."""
    data = mujoco.MjData(plant.model)
    mujoco.mj_resetDataKeyframe(plant.model, data, plant.key)
    for axis in plant.axes:
        if axis.bias:
            axis.line.tilt(data, -axis.bias)
    return data.qpos.copy()


def _with_instance(text: str, plugin: str, config: Mapping[str, str], axes: Sequence[str]) -> str:
    """Add an instance of the plugin to an MJCF that MuJoCo has written, and the sensors that it shows for some axes."""
    names = [escape("/".join(filter(None, (INSTANCE, axis, part)))) for axis in axes for part in QUANTITIES]
    sensors = "".join(f'  <plugin name="{name}" plugin="{plugin}" instance="{INSTANCE}"/>\n  ' for name in names)
    lines = "".join(f'        <config key="{key}" value="{value}"/>\n' for key, value in config.items())
    head = text.index("<mujoco")
    head = text.index(">", head) + 1
    extension = f"""
  <extension>
    <plugin plugin="{plugin}">
      <instance name="{INSTANCE}">
{lines}      </instance>
    </plugin>
  </extension>
"""
    end = text.rindex("</sensor>")
    return f"{text[:head]}{extension}{text[head:end]}{sensors}{text[end:]}"
