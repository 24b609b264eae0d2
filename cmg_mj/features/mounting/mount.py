"""Mounting of control moment gyroscopes on a robot: MJCF in, a plant out."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np

from cmg_mj.core.errors import InputError
from cmg_mj.features.mounting.attach import add_sensors, attach_modules, check_room
from cmg_mj.features.mounting.hold import as_qpos, hold_joints, poses_of, write_keyframe
from cmg_mj.features.mounting.request import AxisLike, Base, Hold, MountRequest, find_place
from cmg_mj.features.mounting.robot import (
    body_of,
    find_existing_axes,
    free_base,
    pose_of,
    read_robot,
    set_physics_options,
)
from cmg_mj.features.mounting.stance import axes_along, check_falls, stand_upright, under_and_height
from cmg_mj.inputs.files import expanded, folder, model_files
from cmg_mj.plant.axis import find_axis
from cmg_mj.plant.build import build
from cmg_mj.plant.elements import EQUILIBRIUM_KEY, SENSORS, TILT_ELEMENT, axis_modules
from cmg_mj.plant.mjcf import as_mjcf, compile_model, data_at_keyframe, parse, posed, quiet, set_control_callback
from cmg_mj.results.folder import is_own, is_signed, signed, whole_file
from cmg_mj.scenario.plant_settings import PlantSettings

PLUGIN = "_plugin"
"""Ending of a plugin's folder, behind the stem of the model's file."""


@dataclass(frozen=True)
class MountedRobot:
    """A robot with a pair on it.

    Attributes:
        spec: The model, which can be edited further.
        path: File of the robot, or a name for messages.
        held: Joints that an equality constraint holds where they stand.
        notes: Other changes to the robot, in clauses.
    """

    spec: mujoco.MjSpec
    path: Path
    held: tuple[str, ...]
    notes: tuple[str, ...]

    def save(self, path: str | Path) -> Path:
        """Write the robot as MJCF, which plain MuJoCo loads and `plant.model` takes; whole or not at all.

        A file that a mount has written is replaced. No other file ever is.

        Args:
            path: The file, in any folder. It refers to meshes and textures by relative paths; they are not copied.

        Returns:
            The file.

        Raises:
            InputError: The file cannot be written, is no .xml, or would replace the robot, a file that it names, or
                one that no mount wrote.
        """
        target = expanded(path, "-o")
        check_target(target, self.path, [".xml"])
        spec = self.spec.copy()
        folder = Path(os.path.abspath(target.parent))
        for field in ("meshdir", "texturedir"):
            setattr(spec, field, _relative_assets(folder, spec.modelfiledir, getattr(spec, field)))
        spec.modelfiledir = f"{folder}{os.sep}"  # MuJoCo opens the meshes to write them
        try:
            with whole_file(target, ".xml") as temporary:
                temporary.write_bytes(signed(as_mjcf(spec, self.path), ".xml"))
                try:
                    build(temporary, PlantSettings(), {})
                except InputError as error:
                    raise InputError(str(error).replace(temporary.name, target.name)) from error
        except OSError as error:
            raise InputError(f"-o {path}: cannot be written: {error.strerror}") from error
        return target


def check_target(target: Path, robot: Path, endings: Sequence[str], *, overwrite: bool = True) -> None:
    """Check that a mounted robot may be written to a file.

    Args:
        target: The model's file.
        robot: The robot's own file, if there is one.
        endings: Endings, behind the target's stem, of the files and of the plugin's folder that are written.
        overwrite: Whether those that a mount has written may be replaced. Others never may.

    Raises:
        InputError: The target is no .xml file, has no folder, or would replace what may not be replaced.
    """
    if target.suffix != ".xml":
        raise InputError(
            f"-o {target}: must be a file that ends in .xml, such as balanced.xml; a .toml comes beside it"
        )
    if not target.parent.is_dir():
        raise InputError(f"-o {target}: cannot be written: there is no folder {target.parent}")
    originals = [file.resolve() for file in model_files(robot)] if robot.is_file() else []
    for ending in endings:
        path = target.with_name(target.stem + ending)
        if any(path.resolve() in (file, *file.parents) for file in originals):
            raise InputError(f"-o {target}: {path} is the robot's own file, or one that it names; give another name")
        is_ours = is_own(path) if ending == PLUGIN else is_signed(path)
        if os.path.lexists(path) and not is_ours:
            raise InputError(f"-o {target}: {path} is not of cmg-mj mount, and would be lost; give another name")
        if path.exists() and not overwrite:
            raise InputError(f"-o {target}: {path} exists; give another name, or --overwrite")


@contextmanager
def with_scenario(target: Path) -> Iterator[Path]:
    """Write a model and the scenario beside it, both whole or neither.

    Args:
        target: The model's file.

    Yields:
        A temporary name for the model; both files are renamed at the end, or removed if something failed.

    Raises:
        InputError: As raised while writing, with the final file names; or the files cannot be renamed.
    """
    prefix = f".{os.getpid()}.partial."
    files = [target.with_suffix(suffix) for suffix in (".xml", ".toml")]
    model, scenario = written = [file.with_name(prefix + file.name) for file in files]
    try:
        yield model
        scenario.write_bytes(scenario.read_bytes().replace(prefix.encode(), b""))  # which names the model
        for temporary, file in zip(written, files, strict=True):
            temporary.replace(file)
    except InputError as error:
        raise InputError(str(error).replace(prefix, "")) from error
    except OSError as error:
        raise InputError(f"-o {target}: cannot be written: {error.strerror}") from error
    finally:
        for temporary in written:
            temporary.unlink(missing_ok=True)


def _relative_assets(folder: Path, model_folder: str, assets: str) -> str:
    """Return the path of a robot's folder of assets, relative to another folder.

    It is absolute where a symbolic link makes the relative path depend on how the model is opened.
    """
    path = os.path.abspath(os.path.join(model_folder, assets))
    relative = os.path.relpath(path, folder)
    return relative if relative == os.path.relpath(os.path.realpath(path), os.path.realpath(folder)) else path


@quiet()
def mount(
    robot: str | Path | mujoco.MjSpec,
    body: str,
    *,
    axis: AxisLike = "y",
    position: Sequence[float] | None = None,
    modules: int = 2,
    scale: float = 1.0,
    name: str = "",
    keyframe: str | None = None,
    hold: Hold = "constraints",
    release: Sequence[str] = (),
    base: Base = "as_is",
) -> MountedRobot:
    """Mount control moment gyroscopes on a robot, so that they balance it about one axis.

    Args:
        robot: Its MJCF, or a model being edited, which is not changed.
        body: The body that carries the modules and the sensors.
        axis: Tilt axis: a hinge name, or a direction in the body frame (`x`, `y` or three numbers). A direction
            selects the hinge parallel to it, or, for a free body, the contact line.
        position: Middle of the row of modules in the body frame [m]; by default the body's centre of mass.
        modules: Number of modules.
        scale: Scale of the modules' lengths: see `attach.scaled_module`.
        name: Name of the axis, with which its elements' names begin, as `roll/tilt`. A second axis needs one.
        keyframe: Keyframe in which the robot stands; by default its reference pose.
        hold: `constraints` hold all joints that do not tilt the robot; `servos`: the robot's own servos hold theirs.
        release: Joints that nothing holds.
        base: `as_is`, or `free`: a free joint replaces the joints of the robot's root.

    Returns:
        The robot with the pair on it.

    Raises:
        InputError: The robot or an argument does not allow it; the message says why.
    """
    request = MountRequest(body, axis, position, modules, scale, name, keyframe, hold, release, base)
    with set_control_callback(None):
        spec, path = read_robot(robot)
        try:
            return _mount_on_spec(spec, path, request)
        except InputError:
            raise
        except (ValueError, KeyError, mujoco.FatalError) as error:  # unforeseen errors of MuJoCo's model editing
            message = " ".join(str(error.args[0] if error.args else error).split()).removeprefix("Error: ")
            raise InputError(f"{path}: MuJoCo cannot put a pair on it: {message}") from error


def _mount_on_spec(spec: mujoco.MjSpec, path: Path, request: MountRequest) -> MountedRobot:
    """Mount a pair on a model, which is changed."""
    body, has_keyframes = body_of(spec, request.body), bool(spec.keys)
    if request.base == "free":
        free_base(spec, body, path)
    names = [f"{request.prefix}cube{i + 1}" for i in range(request.modules)]
    model = compile_model(spec, path)
    existing = find_existing_axes(spec, model, request.name)
    sites = [request.prefix + name for name in (TILT_ELEMENT, *SENSORS)]
    taken = {element.name for kind in (spec.bodies, spec.frames, spec.sites, spec.sensors) for element in kind}
    for name in [*sites, *(f"{name}{end}" for name in names for end in ("/half", "_mount"))]:
        if name in taken:
            raise InputError(f"has an element {name!r} already, which a mounted pair brings: rename it")

    # The robot as it is to stand.
    pose = pose_of(model, request.keyframe or (EQUILIBRIUM_KEY if existing.drives else None))
    place = find_place(model, pose, request)
    if place.joint in existing.lines:
        raise InputError(f"the hinge {place.joint!r} has an axis already: another one needs another hinge")
    keyframes = [(model.key(i).name, data_at_keyframe(model, i)) for i in range(model.nkey)]
    for key in list(spec.keys):  # the robot gets more joints
        spec.delete(key)
    held = hold_joints(spec, model, pose, request, {place.joint, *existing.lines, *existing.drives})

    # With the modules on it.
    mounts = attach_modules(spec, body, names, request.scale)
    notes = set_physics_options(spec)
    if has_keyframes and not keyframes:
        notes.append("its keyframes are left out: they have the joints that a free base replaces")
    gimbals = {f"{module}/gimbal": np.array([math.pi / 2.0]) for module in names}
    others = [line for line in existing.lines if line != place.joint]
    poses = poses_of(model, pose) | gimbals
    model, (qpos, point, direction) = stand_upright(spec, poses, place, mounts, others, request, path)

    # With sensors, and a keyframe to start from.
    data = posed(model, qpos)
    check_room(model, data, names, point[2] if place.free else None)
    under, height = under_and_height(model, data, model.joint(place.joint).id, point, direction)
    frame = model.body(request.body).id
    turn, origin = data.xmat[frame].reshape(3, 3), data.xpos[frame]
    add_sensors(spec, body, request.prefix, turn.T @ (under - origin), turn.T @ axes_along(direction), height)
    model = compile_model(spec, path)
    papers_rig = parse(folder("models") / "scissored_pair.xml")  # whose flywheels' speed theirs is
    speed = max(papers_rig.key(EQUILIBRIUM_KEY).ctrl)
    speeds = {f"{module}/flywheel": speed * (-1.0) ** i for i, module in enumerate(names)}
    speeds |= existing.speeds
    write_keyframe(spec, model, EQUILIBRIUM_KEY, qpos, speeds)
    for name, own in keyframes:
        if name != EQUILIBRIUM_KEY:  # of an axis mounted earlier
            write_keyframe(spec, model, name, as_qpos(model, poses_of(own.model, own.qpos) | gimbals), speeds, own)
    model = compile_model(spec, path)
    key = model.key(EQUILIBRIUM_KEY).id
    check_falls(model, key, find_axis(model, key, request.name, axis_modules(model)[request.name]))
    return MountedRobot(spec, path, tuple(held), tuple(notes))
