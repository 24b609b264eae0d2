"""Names: what has none and is to be spoken of gets one that nothing else bears."""

from __future__ import annotations

from collections.abc import Collection

import mujoco


def free_name(name: str, taken: Collection[str]) -> str:
    """The name, or the first of `name_2`, `name_3`, ... that nobody bears."""
    number, found = 1, name
    while found in taken:
        number += 1
        found = f"{name}_{number}"
    return found


def name_all(spec: mujoco.MjSpec) -> None:
    """Name every body and every joint: a constraint that holds a ball names the bodies that it ties.

    Args:
        spec: The model, compiled before, which is changed.
    """
    bodies, joints = ({element.name for element in kind} for kind in (spec.bodies, spec.joints))
    for body in spec.bodies:
        if not body.name:
            body.name = free_name(f"body{body.id}", bodies)
            bodies.add(body.name)
        for i, joint in enumerate(body.joints):
            if not joint.name:
                joint.name = free_name(f"{body.name}_joint{i or ''}", joints)
                joints.add(joint.name)
