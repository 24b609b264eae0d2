"""A rig on a base that slide joints drive: what a moving pivot is, without a shift of gravity."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Sequence

import mujoco
import numpy as np

from cmg_mj.core.arrays import Scalar
from cmg_mj.plant.plant import Plant

HEAVY_KG = 1e14
"""The slides' own inertia, so large that the rig's reaction does not show: HEAVY_KG * a is the force that gives a."""
BODY_NUMBERS = ("body_pos", "body_quat", "body_ipos", "body_iquat", "body_inertia", "body_mass", "body_sameframe")
SITE_NUMBERS = ("site_pos", "site_quat", "site_sameframe")
SLIDES = ("slide_x", "slide_y", "slide_z")


class DrivenBase:
    """Physics of one world, as `OneWorld` has it, of a plant whose world stands on three slide joints.

    Args:
        plant: The plant, whose initial state is taken over joint by joint.
    """

    def __init__(self, plant: Plant) -> None:
        tree = ET.fromstring(plant.drawn_spec().to_xml())
        world = tree.find("worldbody")
        assert world is not None
        base = ET.Element("body", name="base")
        for name, axis in zip(SLIDES, ("1 0 0", "0 1 0", "0 0 1"), strict=True):
            ET.SubElement(base, "joint", name=name, type="slide", axis=axis, armature=f"{HEAVY_KG:g}")
        ET.SubElement(base, "inertial", pos="0 0 0", mass="1", diaginertia="1 1 1")
        for body in [*world.findall("body"), *world.findall("frame")]:
            world.remove(body)
            base.append(body)
        world.append(base)
        for keyframe in tree.findall("keyframe"):
            tree.remove(keyframe)
        self.model = model = mujoco.MjModel.from_xml_string(ET.tostring(tree, encoding="unicode"))
        model.opt.timestep = plant.timestep
        model.opt.integrator = plant.model.opt.integrator
        for name in BODY_NUMBERS:  # with the equilibrium bias, and without what XML rounds
            getattr(model, name)[2:] = getattr(plant.model, name)[1:]
        for name in SITE_NUMBERS:
            getattr(model, name)[:] = getattr(plant.model, name)
        mujoco.mj_setConst(model, mujoco.MjData(model))
        self.data = mujoco.MjData(model)
        start = plant.new_data()
        for joint in plant.joint_names:
            self.data.joint(joint).qpos[:] = start.joint(joint).qpos
            self.data.joint(joint).qvel[:] = start.joint(joint).qvel
        self.data.ctrl[:], self.data.act[:] = start.ctrl, start.act
        self._plant = plant

    def accelerate(self, acceleration: Sequence[Scalar]) -> None:
        """Drive the base with an acceleration, x, y, z [m/s^2]."""
        for name, part in zip(SLIDES, acceleration, strict=True):
            self.data.joint(name).qfrc_applied[0] = HEAVY_KG * float(part)

    def joints(self) -> np.ndarray:
        """Angles and rates of the rig's joints."""
        return np.array(
            [[self.data.joint(joint).qpos[0], self.data.joint(joint).qvel[0]] for joint in self._plant.joint_names]
        )

    def sensordata(self) -> np.ndarray:
        """Read perfect sensors at the present state."""
        mujoco.mj_forward(self.model, self.data)
        return self.data.sensordata.copy()

    def travelled(self) -> np.ndarray:
        """Displacement of the base, x, y, z [m]."""
        return np.array([self.data.joint(name).qpos[0] for name in SLIDES])
