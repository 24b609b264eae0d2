"""A frame that bends: one torsional mode about the tilt axis, as an edit of a parsed rig."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from cmg_mj.core.errors import InputError
from cmg_mj.features.bend import Bend
from cmg_mj.plant.axis import Axis, ResolvedModel
from cmg_mj.plant.elements import BEND_JOINT, SENSORS, element_id, joint_sizes
from cmg_mj.plant.inertia import free_motions
from cmg_mj.plant.mjcf import data_at_keyframe
from cmg_mj.plant.tilt_line import HingeLine
from cmg_mj.scenario.plant_settings import PlantSettings

RIGID_SHARE = 0.999
"""Largest share of the frame's own inertia on one side of the bend: a part without mass does not move."""


def bend_frame(
    spec: mujoco.MjSpec, rig: ResolvedModel, settings: PlantSettings, section: Bend
) -> Callable[[mujoco.MjModel], None] | None:
    """Split the body that tilts in two, joined by a spring and a damper about the tilt axis.

    The modules stay on the body that has the tilt's joint. The other part is a new body with a share of that body's
    own mass, its centre and its inertia's shape, and with the sensors if these are on the other side of the bend.

    Args:
        spec: The parsed rig, which is changed.
        rig: The rig, compiled.
        settings: The plant's settings.
        section: The mode.

    Returns:
        A finish that gives the compiled model, and the parsed joint, the spring and the damper; None for a rigid frame.

    Raises:
        InputError: The rig has several axes or does not tilt about a hinge of its frame, the frame has not so much
            inertia to share, or that hinge has friction or a spring which would act beyond the bend.
    """
    if not section.frequency_hz:
        return None
    rigid, key, path = rig.model, rig.key, rig.path
    axis, line = _axis_to_bend(rig, section)
    if section.beyond != "sensors":
        _refuse_torques_of_hinge(rigid, line, settings, section, path)
    part = _leaf_part(rigid, key, axis.frame, line, section, path)
    frame = next(body for body in spec.bodies if body.name == rigid.body(axis.frame).name)
    leaf = frame.add_body(name=BEND_JOINT)
    for body, share in ((frame, 1.0 - part), (leaf, part)):
        body.explicitinertial = True
        body.mass, body.inertia = share * rigid.body_mass[axis.frame], share * rigid.body_inertia[axis.frame]
        body.ipos, body.iquat = rigid.body_ipos[axis.frame], rigid.body_iquat[axis.frame]
        body.fullinertia = np.full(6, np.nan)
    hinge = mujoco.mjtJoint.mjJNT_HINGE
    joint = leaf.add_joint(name=BEND_JOINT, type=hinge, pos=axis.point, axis=axis.direction)
    joint.limited, joint.armature, joint.frictionloss = mujoco.mjtLimited.mjLIMITED_FALSE, 0.0, 0.0
    joint.stiffness, joint.damping = np.zeros(3), np.zeros(3)
    if section.beyond != "both":
        _move_sites(spec, rigid, leaf, axis.prefix)
    _extend_keyframes(spec)

    def finish(model: mujoco.MjModel) -> None:
        inertia = mode_inertia(model, key, line, slides=axis.reduced.pivot_arm > 0.0)
        omega = 2.0 * math.pi * section.frequency_hz
        joint.stiffness[0] = inertia * omega**2
        joint.damping[0] = 2.0 * section.damping_ratio * inertia * omega
        bend = model.joint(BEND_JOINT)
        model.jnt_stiffness[bend.id] = joint.stiffness[0]
        model.dof_damping[bend.dofadr[0]] = joint.damping[0]

    return finish


def _axis_to_bend(rig: ResolvedModel, section: Bend) -> tuple[Axis, HingeLine]:
    """Find the only axis and its hinge, or say why the rig cannot bend."""
    setting, rigid = f"bend.frequency_hz = {section.frequency_hz:g}: {rig.path}", rig.model
    if len(rig.axes) > 1:
        lock = f'; lock the others, as with --set plant.locked_axes=["{rig.axes[-1].name}"]'
        can_lock = isinstance(rig.axes[-1].line, HingeLine)
        raise InputError(f"{setting} tilts about several axes, and a bend takes one{lock if can_lock else ''}")
    if element_id(rigid, "joint", BEND_JOINT) >= 0 or element_id(rigid, "body", BEND_JOINT) >= 0:
        raise InputError(f"{setting} has a body or joint {BEND_JOINT!r} already, which is what a bend adds")
    axis = next(iter(rig.axes))
    if not isinstance(axis.line, HingeLine) or int(rigid.jnt_bodyid[axis.line.joint]) != axis.frame:
        raise InputError(
            f"{setting} does not tilt about a hinge of the body that carries its sensors; a bend takes one"
        )
    return axis, axis.line


def _refuse_torques_of_hinge(
    rigid: mujoco.MjModel, line: HingeLine, settings: PlantSettings, section: Bend, path: Path
) -> None:
    """Refuse what the model's file has at the tilt's hinge, which would act on the modules, beyond the bend."""
    for name in ("tilt_friction_n_m", "tilt_damping_n_m_s"):  # these replace the file's
        if value := getattr(settings, name):
            raise InputError(
                f"plant.{name} = {value:g}: {path}: acts on the part with the modules, which lies beyond the bend with "
                f"bend.beyond = {section.beyond!r}; leave it out, or take bend.beyond = 'sensors'"
            )
    torques = {
        "damping": settings.tilt_damping_n_m_s is None and rigid.dof_damping[line.dof],
        "frictionloss": settings.tilt_friction_n_m is None and rigid.dof_frictionloss[line.dof],
        "nonlinear damping": rigid.dof_dampingpoly[line.dof].any(),
        "stiffness": rigid.jnt_stiffness[line.joint] or rigid.jnt_stiffnesspoly[line.joint].any(),
        "armature": rigid.dof_armature[line.dof],
    }
    cures = {"damping": "set plant.tilt_damping_n_m_s=0", "frictionloss": "set plant.tilt_friction_n_m=0"}
    for attribute, acts in torques.items():
        if acts:
            raise InputError(
                f"bend.beyond = {section.beyond!r}: {path}: the {attribute} of joint "
                f"{rigid.joint(line.joint).name!r} would act on the part with the modules, beyond the bend; "
                f"{cures.get(attribute, 'take it out of the file')}, or take bend.beyond=sensors"
            )


def mode_inertia(model: mujoco.MjModel, key: int, line: HingeLine, *, slides: bool) -> float:
    """Compute the inertia that the spring of a bend feels with the tilt's hinge free: J_1 J_2/(J_1 + J_2) [kg m^2].

    Args:
        model: The compiled model, with the bend.
        key: The keyframe.
        line: The tilt's hinge.
        slides: True if the pivot slides freely. It then moves with the mode, as all unheld joints do.
    """
    data = data_at_keyframe(model, key)
    dense = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, dense)
    dofs = [line.dof, int(model.joint(BEND_JOINT).dofadr[0])]
    if slides:
        motions = free_motions(model, data, dofs)
        bend = motions[dofs[1]]
        return float(1.0 / (bend @ np.linalg.solve(motions.T @ dense @ motions, bend)))
    return float(1.0 / np.linalg.inv(dense[np.ix_(dofs, dofs)])[1, 1])


def _leaf_part(rigid: mujoco.MjModel, key: int, frame: int, line: HingeLine, section: Bend, path: Path) -> float:
    """Part of the frame's own inertia and mass that goes to the new body."""
    data = data_at_keyframe(rigid, key)
    dense = np.zeros((rigid.nv, rigid.nv))
    mujoco.mj_fullM(rigid, data, dense)
    whole = float(dense[line.dof, line.dof]) - float(rigid.dof_armature[line.dof])
    turn = data.ximat[frame].reshape(3, 3).T @ data.xaxis[line.joint]
    arm = np.cross(data.xaxis[line.joint], data.xipos[frame] - data.xanchor[line.joint])
    own = float(rigid.body_inertia[frame] @ turn**2 + rigid.body_mass[frame] * arm @ arm)
    is_mast = section.beyond == "sensors"
    part = (section.share if is_mast else 1.0 - section.share) * whole / own if own > 0.0 else math.inf
    if part <= RIGID_SHARE:
        return part
    if own <= 0.0:
        raise InputError(
            f"bend.share: {path}: the body {rigid.body(frame).name!r} has no mass of its own to share (give the "
            "model's compiler fusestatic=\"true\", so that the modules' halves become part of it)"
        )
    most = RIGID_SHARE * own / whole  # rounded so that it is allowed
    limit = (
        f"at most {math.floor(1e3 * most) / 1e3:g}" if is_mast else f"at least {math.ceil(1e3 * (1 - most)) / 1e3:g}"
    )
    raise InputError(
        f"bend.share = {section.share:g}: {path}: gimbals and flywheels, which stay with the modules, have "
        f"too much of the inertia; with bend.beyond = {section.beyond!r} set bend.share to {limit}"
    )


def _move_sites(spec: mujoco.MjSpec, rigid: mujoco.MjModel, leaf: Any, prefix: str) -> None:
    """Put the sites of the sensors on the new body, where they are; its frame is the old one's."""
    sites = {site.name: site for site in spec.sites}
    names = [spec.sensor(prefix + name).objname for name in SENSORS]
    for name in dict.fromkeys(names):
        old, at = sites[name], element_id(rigid, "site", name)
        old.name = f"{name} before the bend"
        new = leaf.add_site(name=name, pos=rigid.site_pos[at], quat=rigid.site_quat[at])
        new.type, new.size, new.rgba = old.type, old.size, old.rgba
        spec.delete(old)


def _extend_keyframes(spec: mujoco.MjSpec) -> None:
    """Give every keyframe the new joint, unbent and at rest."""
    before = spec.joints[: [joint.name for joint in spec.joints].index(BEND_JOINT)]
    at, at_rate = (sum(joint_sizes(int(joint.type))[i] for joint in before) for i in (0, 1))
    for key in spec.keys:
        key.qpos, key.qvel = (
            np.insert(entries, place, 0.0) if len(entries) else entries
            for entries, place in ((key.qpos, at), (key.qvel, at_rate))
        )
