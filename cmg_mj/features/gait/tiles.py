"""A floor of tiles whose heights nobody knows: boxes in the model, and their heights in each world."""

from __future__ import annotations

from collections.abc import Callable

import mujoco
import numpy as np

from cmg_mj.core.noise import NoiseStream
from cmg_mj.features.gait import Gait
from cmg_mj.plant.axis import ResolvedModel
from cmg_mj.plant.plant import Plant
from cmg_mj.scenario.plant_settings import PlantSettings

SIDE_M, BESIDE = 0.1, 3
"""Side of a tile [m]; how many lie beside the middle, and before the first step and after the last one."""
DEPTH_M = 0.1


def lay_tiles(
    spec: mujoco.MjSpec, rig: ResolvedModel, settings: PlantSettings, section: Gait
) -> Callable[[mujoco.MjModel], None] | None:
    """Lay tiles along the walk, all of the largest height; where the robot starts there are none.

    Args:
        spec: The parsed robot, which is changed.
        rig: The robot, compiled.
        settings: The plant's settings.
        section: The gait.

    Returns:
        A finish that has nothing to do; None without tiles.
    """
    if not section.tiles_m:
        return None
    last = round(section.steps * section.step_length_m / SIDE_M)
    size = [SIDE_M / 2.0, SIDE_M / 2.0, DEPTH_M / 2.0]
    for i in range(min(0, last) - BESIDE, max(0, last) + BESIDE + 1):
        for j in range(-BESIDE, BESIDE + 1) if i else ():
            place = [i * SIDE_M, j * SIDE_M, section.tiles_m - DEPTH_M / 2.0]
            box = mujoco.mjtGeom.mjGEOM_BOX
            spec.worldbody.add_geom(
                name=f"tile/{i}/{j}", type=box, pos=place, size=size, contype=0, conaffinity=1, rgba=[0.0] * 4
            )
    return lambda model: None


def with_heights(gait: Gait, plant: Plant, seed: int, world: int) -> Plant:
    """Return the plant with the tiles' heights of a world, each between 0 and the largest."""
    if not gait.tiles_m:
        return plant
    own = plant.with_own_model()
    tiles = [i for i in range(own.model.ngeom) if own.model.geom(i).name.startswith("tile/")]
    generator = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(world, NoiseStream.FLOOR)))
    own.model.geom_pos[tiles, 2] = generator.uniform(0.0, gait.tiles_m, len(tiles)) - DEPTH_M / 2.0
    return own
