"""The upright stance of a robot, its mass above the hinge or above its contacts, and how it falls from there."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import mujoco
import numpy as np

from cmg_mj.core.errors import InputError
from cmg_mj.features.mounting.attach import place_modules
from cmg_mj.features.mounting.hold import as_qpos, rest_controls
from cmg_mj.features.mounting.request import MountRequest, Place
from cmg_mj.plant.axis import Axis
from cmg_mj.plant.checks import TRUE_DEG
from cmg_mj.plant.elements import ON_A_JOINT, subtree
from cmg_mj.plant.mjcf import compile_model, data_at_keyframe, posed
from cmg_mj.plant.tilt_line import UP, Line, SupportLine, turn_pose

MAX_SETTLE_S = 10.0
"""Longest time for a robot to come to rest [s]."""
AT_REST = 1e-4
"""Rates below which a robot rests [m/s, rad/s]."""
UPRIGHT_DEG = 0.005
"""Largest lean of the mass from above the line [deg]."""
MAX_ROUNDS = 40
"""Most rounds of resting and leaning; on flat tyres each takes an eighth off the lean."""
MAX_LEAN_DEG = 20.0
"""A robot whose mass lies farther from its line of support has fallen, whatever holds it [deg]."""
STANDS_DEG = 2.0
"""A robot that must lean so far before it falls stands by itself [deg]."""
LEFT_DEG = 10.0
"""A robot that comes to rest nearer to where it was let go stands by itself; farther away, it leans on something
[deg]."""
MIN_FRICTION = math.tan(math.radians(STANDS_DEG))
"""On contacts with less friction a robot slides before it leans by `STANDS_DEG`."""
MIN_HEIGHT_M = 1e-3
"""Smallest height of a robot's mass above the line [m]."""
SEARCH_SHARE, MAX_SEARCH_STEPS, SEARCH_ERROR = 0.125, 5000, 1e-6
"""The floor is searched in steps of this share of a robot's height, so many at most, and found to a share of a step."""


class Support(NamedTuple):
    """The stance of a robot and the line that it stands on."""

    pose: np.ndarray
    """Joint positions, (nq,)."""
    point: np.ndarray
    """A point of the line, in the world (3,) [m]."""
    direction: np.ndarray
    """Direction of the line, horizontal, in the world (3,)."""


def stand(model: mujoco.MjModel, pose: np.ndarray, joint: int, direction: np.ndarray, *, alone: bool = True) -> Support:
    """Let a free robot settle on the floor, its mass above a line through its contacts.

    Args:
        model: The robot with its modules, all joints held that are to be.
        pose: Joint positions at first, (nq,).
        joint: The robot's free joint.
        direction: Approximate direction of the line, horizontal, in the world. Contacts far apart determine the line
            better.
        alone: Whether to see first if it stands by itself in its pose.

    Returns:
        The stance and the line.

    Raises:
        InputError: The robot has nothing to stand on, falls over, or stands by itself.
    """
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET  # physics that fails must say so
    data = posed(model, pose)
    data.act[:], data.ctrl[:] = rest_controls(model, data)  # servos keep the joints where they are
    tree = model.body_rootid == model.body_rootid[model.jnt_bodyid[joint]]
    _touch_down(model, data, tree, model.jnt_qposadr[joint] + 2)
    if alone:
        touching = data.qpos.copy()
        if _rest(model, data, tree, joint, direction, held=False) < LEFT_DEG:
            _support(model, data, tree, data.subtree_com[model.jnt_bodyid[joint]], direction)
        data.qpos[:], data.qvel[:] = touching, 0.0
        mujoco.mj_forward(model, data)
    leaned = 0.0
    for _ in range(MAX_ROUNDS):
        turned = _rest(model, data, tree, joint, direction, held=True)
        if turned > MAX_LEAN_DEG:
            raise InputError(
                f"the robot falls over while it settles, by {turned:.3g} deg, about another line than the one that is "
                "balanced; give a keyframe in which it stands"
            )
        mass = data.subtree_com[model.jnt_bodyid[joint]]
        point, direction = _support(model, data, tree, mass, direction)
        arm = mass - point
        lean = math.atan2(arm @ np.cross(direction, UP), arm[2])
        leaned += lean
        if abs(math.degrees(leaned)) > MAX_LEAN_DEG:
            raise InputError(
                f"the robot falls over: where it stands its mass lies {abs(math.degrees(leaned)):.3g} deg beside the "
                "line that it tilts about; give a keyframe in which it stands"
            )
        if abs(math.degrees(lean)) < UPRIGHT_DEG:
            return Support(data.qpos.copy(), point, direction)
        # Turn the robot back about the line by this angle, and stop it.
        address = model.jnt_qposadr[joint]
        turn_pose(data.qpos[address : address + 7], point, direction, -lean)
        data.qvel[:] = 0.0
        mujoco.mj_forward(model, data)
    raise InputError("the robot does not come to stand upright; give a keyframe in which it stands")


def _touch_down(model: mujoco.MjModel, data: mujoco.MjData, tree: np.ndarray, height: int) -> None:
    """Lower or lift the robot, whose height has this place in qpos, until a contact begins to push it."""

    def touches(at: float) -> bool:
        data.qpos[height] = at
        mujoco.mj_fwdPosition(model, data)
        return any(contact.dist < contact.includemargin for _, contact, _ in _contacts(model, data, tree))

    geoms = tree[model.geom_bodyid]
    level, reach = data.geom_xpos[geoms, 2], model.geom_rbound[geoms]
    step = SEARCH_SHARE * np.ptp([level - reach, level + reach])
    last = at = data.qpos[height]
    lifted = touches(at)
    for _ in range(MAX_SEARCH_STEPS):
        last, at = at, at + (step if lifted else -step)
        if touches(at) != lifted:
            break
    else:
        raise InputError(
            "the robot has nothing to stand on: no geom of its collides with one of the world's; let them (contype, "
            'conaffinity, <exclude>, <flag contact>), or give it a floor: <geom type="plane" size="5 5 0.1"/>'
        )
    free, touching = max(last, at), min(last, at)
    while free - touching > SEARCH_ERROR * step:
        middle = 0.5 * (free + touching)
        free, touching = (free, middle) if touches(middle) else (middle, touching)
    touches(touching)
    mujoco.mj_forward(model, data)


def _contacts(model: mujoco.MjModel, data: mujoco.MjData, tree: np.ndarray) -> Iterator[tuple[int, Any, int]]:
    """Yield the contacts of a tree with other bodies: number, contact, other body."""
    for i, contact in enumerate(data.contact[: data.ncon]):
        bodies = model.geom_bodyid[contact.geom]
        ours = tree[bodies]
        if ours[0] != ours[1]:
            yield i, contact, bodies[int(ours[0])]


def _rest(
    model: mujoco.MjModel, data: mujoco.MjData, tree: np.ndarray, joint: int, direction: np.ndarray, *, held: bool
) -> float:
    """Let the robot come to rest.

    Args:
        model: The robot.
        data: The same, touching the floor.
        tree: Which bodies are the robot's, (nbody,).
        joint: The robot's free joint.
        direction: The line about which a torque damps its motion, in the world.
        held: Whether a torque keeps it from tilting about the line, which vanishes where its mass is above the line.
            Otherwise it may fall, and is left alone when it has turned by `LEFT_DEG`.

    Returns:
        The angle by which it has turned [deg].
    """
    body, dof, step = model.jnt_bodyid[joint], model.jnt_dofadr[joint], model.opt.timestep
    mass, gravity = model.body_subtreemass[body], np.linalg.norm(model.opt.gravity)
    floor = min((contact.pos[2] for _, contact, _ in _contacts(model, data, tree)), default=-math.inf)
    height = max(data.subtree_com[body][2] - floor, MIN_HEIGHT_M)
    stiffness = held * 20.0 * mass * gravity * height
    # By the robot's own height: the inertia about the line is at least mass height^2, and the rate that damping/inertia
    # is stays below 2 sqrt(20 g/height), which a step of 5 ms integrates from a height of 5 mm.
    damping = 2.0 * mass * height * math.sqrt((20.0 if held else 1.0) * gravity * height)
    drag = mass * math.sqrt(gravity / height)
    start, off, turned = data.xquat[body].copy(), np.empty(3), 0.0
    for count in range(math.ceil(MAX_SETTLE_S / step)):
        along = data.xmat[body].reshape(3, 3).T @ direction  # in the body's axes
        mujoco.mju_subQuat(off, start, data.xquat[body])
        torque = stiffness * (off @ along) - damping * (data.qvel[dof + 3 : dof + 6] @ along)
        data.qfrc_applied[dof : dof + 3] = -drag * data.qvel[dof : dof + 3]
        data.qfrc_applied[dof + 3 : dof + 6] = along * torque
        mujoco.mj_step(model, data)
        if not np.isfinite(data.qpos).all():
            raise InputError("the robot's physics fails while it settles on the floor")
        turned = math.degrees(np.linalg.norm(off))
        resting = count * step > 0.3 and np.abs(data.qvel).max() < AT_REST
        if resting or (turned > LEFT_DEG and not held):
            break
    data.qfrc_applied[:] = 0.0
    mujoco.mj_forward(model, data)
    return turned


def _support(
    model: mujoco.MjModel, data: mujoco.MjData, tree: np.ndarray, mass: np.ndarray, direction: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the middle of the contacts, (3,) [m], and the direction of their line, (3,)."""
    points, loads, force, friction = [], [], np.zeros(6), 0.0
    for i, contact, other in _contacts(model, data, tree):
        mujoco.mj_contactForce(model, data, i, force)
        if force[0] > 0.0:
            if model.body_treeid[other] >= 0:
                raise InputError(
                    f"the robot rests on the body {model.body(other).name!r}, which moves: let the two not collide "
                    "(<exclude>), or take that body's joints out of the file"
                )
            points.append(contact.pos.copy())
            loads.append(force[0])
            friction = max(friction, contact.friction[0] * (contact.dim > 1))
    if not points:
        raise InputError("the robot does not come to rest on anything")
    if friction < MIN_FRICTION:
        raise InputError(
            f"the robot stands on contacts with a friction of {friction:.2g}, and would slide: give them "
            f'{MIN_FRICTION:.2g} or more (<geom condim="3" friction="1">, of the feet and the floor)'
        )
    places = np.array(points)
    middle = np.average(places, axis=0, weights=loads)
    # The principal axis of the loads: a line through the two contacts farthest apart would go through opposite corners
    # of flat tyres.
    level = (places - middle)[:, :2]
    along = np.append(np.linalg.eigh(level.T @ (np.array(loads)[:, None] * level))[1][:, 1], 0.0)
    along *= math.copysign(1.0, along @ direction)
    least = 2.0 * math.tan(math.radians(STANDS_DEG)) * (mass[2] - middle[2])
    if np.ptp(places @ along) > least and along @ direction > math.cos(math.radians(MAX_LEAN_DEG)):
        direction = along
    length, width = np.ptp(places @ direction), np.ptp(places @ np.cross(direction, UP))
    if width > least:
        raise InputError(
            f"the robot stands by itself: its support is {width:.3g} m wide across the axis; a pair balances a robot "
            "that stands on a line (another --axis?)"
        )
    if length < least:
        raise InputError(
            f"the robot stands on a point: its support is {length:.3g} m long along the axis, and it would fall "
            f"sideways too; a pair balances a robot that stands on a line, here of {least:.3g} m or more"
        )
    return middle, direction


MAX_TRIES = 5
"""Most rounds of settling on the floor and turning the modules along the contact line."""


def stand_upright(
    spec: mujoco.MjSpec,
    poses: dict[str, np.ndarray],
    place: Place,
    mounts: Sequence[mujoco.MjsFrame],
    others: Sequence[str],
    request: MountRequest,
    path: Path,
) -> tuple[mujoco.MjModel, Support]:
    """Place the modules along the line, and stand the robot up with them.

    The contacts determine the line better than the request, and modules along another line shift the contacts.
    The robot settles on the floor until both agree.

    Args:
        spec: The robot with its modules, all joints held that are to be; the modules are placed in it.
        poses: Where its joints are at first, by name.
        place: Where the modules go.
        mounts: The body that carries each module.
        others: The hinges of other axes, which are to stand upright too.
        request: The body, the modules' scale.
        path: The file, for messages.

    Returns:
        The compiled model and its support.

    Raises:
        InputError: The robot cannot stand upright, or stands by itself.
    """
    model = compile_model(spec, path)
    support, settled = Support(as_qpos(model, poses), np.zeros(3), place.direction), False
    for tries_left in reversed(range(MAX_TRIES + 1)):
        turn = posed(model, support.pose).xmat[model.body(request.body).id].reshape(3, 3)
        unchanged = place_modules(mounts, place.middle, turn.T @ axes_along(support.direction), request.scale)
        if unchanged and settled:
            break
        model = compile_model(spec, path)
        if not place.free:
            return model, _all_balanced(model, support, place.joint, others)
        if tries_left:
            joint = model.joint(place.joint).id
            support = stand(model, support.pose, joint, support.direction, alone=not settled)
            settled = True
    return model, support


def _all_balanced(model: mujoco.MjModel, start: Support, hinge: str, others: Sequence[str]) -> Support:
    """Turn the hinges of all axes so that the mass on each hinge is above it.

    Of several hinges none may turn: the modules of one axis are square to its hinge only while the other hinges rest.
    """
    line, pose = model.joint(hinge).id, start.pose
    several = [*(model.joint(other).id for other in others), line] if others else []
    for joint in several * 2:
        direction = start.direction if joint == line else posed(model, pose).xaxis[joint].copy()
        pose = _balanced(model, pose, joint, direction).pose  # which moves what another carries
    support = _balanced(model, pose, line, start.direction)
    for joint in several:
        turned = math.degrees((support.pose - start.pose)[model.jnt_qposadr[joint]])
        if abs(turned) > TRUE_DEG:
            raise InputError(
                f"to stand upright on all axes the hinge {model.joint(joint).name!r} has to turn by {turned:.3g} deg, "
                "and the modules of another axis would stand crooked: place the modules above both hinges "
                "(--position), or mount the first axis in a keyframe in which its mass is above both"
            )
    return support


def under_and_height(
    model: mujoco.MjModel, data: mujoco.MjData, joint: int, point: np.ndarray, direction: np.ndarray
) -> tuple[np.ndarray, float]:
    """Return the line's point under a robot's mass, in the world (3,) [m], and the robot's height above it [m]."""
    root = model.jnt_bodyid[joint]
    under = point + ((data.subtree_com[root] - point) @ direction) * direction
    tops = []
    for geom in np.flatnonzero(np.isin(model.geom_bodyid, subtree(model, root))):
        turn, aabb = data.geom_xmat[geom].reshape(3, 3), model.geom_aabb[geom]
        tops.append((data.geom_xpos[geom] + turn @ aabb[:3])[2] + np.abs(turn[2]) @ aabb[3:])
    return under, max(tops) - point[2]


def axes_along(direction: np.ndarray) -> np.ndarray:
    """Return a line's axes in the world, by columns: y along the line, z upward."""
    return np.stack([np.cross(direction, UP), direction, UP], axis=1)


def _balanced(model: mujoco.MjModel, qpos: np.ndarray, joint: int, direction: np.ndarray) -> Support:
    """Turn a hinge so that the mass it carries is above it."""
    data, name = posed(model, qpos), model.joint(joint).name
    point = data.xanchor[joint].copy()
    arm = data.subtree_com[model.jnt_bodyid[joint]] - point
    radial = arm - (arm @ direction) * direction
    if np.linalg.norm(radial) < MIN_HEIGHT_M:
        raise InputError(f"the mass on the hinge {name!r} lies on its axis: there is nothing to balance")
    lean = math.atan2(radial @ np.cross(direction, UP), radial @ UP)
    sign = math.copysign(1.0, data.xaxis[joint] @ direction)
    address = model.jnt_qposadr[joint]
    upright = qpos[address] - sign * lean
    low, high = model.jnt_range[joint]
    if model.jnt_limited[joint]:  # whole turns away it is upright too
        upright -= 2.0 * math.pi * round((upright - 0.5 * (low + high)) / (2.0 * math.pi))
    room = min(upright - low, high - upright) - model.jnt_margin[joint]
    if model.jnt_limited[joint] and math.degrees(room) < STANDS_DEG:
        raise InputError(
            f"the hinge {name!r} would stand upright at {upright:.4g} rad, at the end of its range of {low:.4g} to "
            f"{high:.4g}, less a margin of {model.jnt_margin[joint]:.4g}, or beyond its range: widen it, so that "
            f"it can lean by {STANDS_DEG:g} deg either way"
        )
    qpos = qpos.copy()
    qpos[address] = upright
    return Support(qpos, point, direction)


TRIED_DEG = 0.05
"""Tilt at which a robot is released [deg]."""
UNTIL = 4.0
"""Growth of the tilt at which the simulation ends."""
MAX_FALL_S = 3.0
"""Longest simulation; a robot whose tilt has not grown so much by then falls too slowly to judge, or stands [s]."""
SLOWEST = math.acosh(UNTIL) / MAX_FALL_S
"""Slowest fall of a robot that a pair is mounted on [1/s]."""
PUSHED_DEG = 0.5
"""A robot that is pushed like gravity does at such a tilt does not stand upright; the bias that worlds have [deg]."""
MAX_DRAG = 0.05
"""Largest drag on a flywheel, of its motor's force at standstill."""
FALL_TIME_CONSTANTS = 10.0
"""Time constants within which `TRIED_DEG` becomes `LEFT_DEG`; 6 on a rigid robot."""


def simulated_pole(model: mujoco.MjModel, key: int, line: Line, bias: float = 0.0) -> float:
    """Simulate a small tilt's growth cosh(lambda t), flywheels at rest and gimbals held, and return its pole lambda.

    Args:
        model: The plant's model.
        key: The keyframe in which the plant stands.
        line: The tilt line.
        bias: Equilibrium bias e: tilt of the equilibrium, less that of the keyframe [rad].

    Returns:
        lambda [1/s]; 0 if the tilt does not grow, and less than `SLOWEST` if it has not grown enough in time.
    """
    start = math.radians(TRIED_DEG)
    data, growth = _let_go(model, key, line, start - bias), 1.0
    while growth < UNTIL and data.time < MAX_FALL_S:
        mujoco.mj_step(model, data)
        growth = (line.lean(data.qpos) + bias) / start
    return math.acosh(growth) / data.time if growth > 1.0 else 0.0


def _let_go(model: mujoco.MjModel, key: int, line: Line, tilt: float) -> mujoco.MjData:
    """Return data at a keyframe, tilted, its flywheels at rest."""
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, key)
    spinning = data.qvel != 0.0
    data.qvel[spinning] = 0.0
    for motor in range(model.nu):  # whatever drives a joint that turned
        joint = model.actuator_trnid[motor, 0]
        if model.actuator_trntype[motor] == mujoco.mjtTrn.mjTRN_JOINT and spinning[model.jnt_dofadr[joint]]:
            data.ctrl[motor] = 0.0
    line.tilt(data, tilt)
    return data


def check_falls(model: mujoco.MjModel, key: int, axis: Axis) -> None:
    """Check that gravity alone turns a robot about an axis, fast enough for a pair, and that its flywheels turn freely.

    Raises:
        InputError: It is pushed where it should balance, stands by itself, or falls too slowly; or a fluid brakes.
    """
    line, data = axis.line, data_at_keyframe(model, key)
    push = float(line.motion(model, data) @ (data.qfrc_passive + data.qfrc_actuator))
    lean = math.degrees(abs(push) / (axis.reduced.gimbals * axis.reduced.gravity_torque))
    if lean > PUSHED_DEG:
        raise InputError(
            f"with its mass above the line a spring or an actuator pushes the robot by {push:.3g} N m, as "
            f"much as gravity at {lean:.3g} deg: let that be nothing there (springref, biasprm, ctrl)"
        )
    for module in axis.modules:
        drag, motor = abs(data.qfrc_passive[module.flywheel_dof]), model.actuator_gainprm[module.motor, 0]
        if drag > MAX_DRAG * motor * abs(module.speed):
            raise InputError(
                f"<option density={model.opt.density:g} viscosity={model.opt.viscosity:g}>: the fluid brakes flywheels "
                f"by {drag:.3g} N m, too much for their motors; air has a density of 1.2"
            )
    pole = simulated_pole(model, key, line)
    if pole < SLOWEST:
        raise InputError(
            f"the robot falls too slowly from a tilt of {TRIED_DEG:g} deg, with {pole:.2g} 1/s; a pair is for robots "
            f"that fall with {SLOWEST:.2g} 1/s or faster: {_holders(model, data, line)}"
        )
    for side in (TRIED_DEG, -TRIED_DEG) if isinstance(line, SupportLine) else ():
        data = _let_go(model, key, line, math.radians(side))
        while abs(line.lean(data.qpos)) < math.radians(LEFT_DEG):
            mujoco.mj_step(model, data)
            if data.time > FALL_TIME_CONSTANTS / pole:
                raise InputError(
                    f"the robot stands by itself: let go where its mass is above the line, it is still within "
                    f"{LEFT_DEG:g} deg of there after {data.time:.2g} s, as on the edge of a flat foot; take away what "
                    "it comes to rest on"
                )


def _holders(model: mujoco.MjModel, data: mujoco.MjData, line: Line) -> str:
    """Say what may keep a robot from falling, as far as its model has it."""
    driven = np.isin(model.actuator_trntype, ON_A_JOINT) & (model.actuator_trnid[:, 0] == line.joint)
    found = {
        "the joint's frictionloss": model.dof_frictionloss[line.push[0]],
        "the joint's spring": model.jnt_stiffness[line.joint],
        "an actuator of the joint": model.actuator_biasprm[driven],
        "an equality of the joint": (model.eq_type == mujoco.mjtEq.mjEQ_JOINT) & (model.eq_obj1id == line.joint),
        "a tendon": np.append(model.tendon_stiffness, model.tendon_limited),
        "rolling friction (condim 6)": [contact.dim > 4 for contact in data.contact[: data.ncon]],
    }
    if holders := [what for what, values in found.items() if np.any(values)]:
        return f"{' or '.join(holders)} holds it; take that out of the file"
    return (
        "it stands by itself, geoms that overlap hold it (let them not collide: <exclude>), or its mass is far up "
        "(--position is in metres)"
    )
