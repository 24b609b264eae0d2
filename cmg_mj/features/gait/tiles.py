"""A floor of tiles whose heights nobody knows: boxes in the model, and their heights in each world."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import mujoco
import numpy as np

from cmg_mj.core.loop import Disturbance, Outside
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


class TiledFloor(Disturbance):
    """A floor whose tiles have heights of their own in each world, each between 0 and the largest.

    Args:
        largest_m: Largest height [m].
        seed: The run's seed.
        worlds: The worlds' numbers.
    """

    def __init__(self, largest_m: float, seed: int, worlds: Sequence[int]) -> None:
        self._largest, self._seed, self._worlds = largest_m, seed, worlds

    def placed(self, plants: Sequence[Plant]) -> Sequence[Plant]:
        """See `Disturbance`."""
        return [self._laid(plant, world) for plant, world in zip(plants, self._worlds, strict=True)]

    def _laid(self, plant: Plant, world: int) -> Plant:
        own = plant.with_own_model()
        tiles = [i for i in range(own.model.ngeom) if own.model.geom(i).name.startswith("tile/")]
        generator = np.random.default_rng(np.random.SeedSequence(self._seed, spawn_key=(world, NoiseStream.FLOOR)))
        own.model.geom_pos[tiles, 2] = generator.uniform(0.0, self._largest, len(tiles)) - DEPTH_M / 2.0
        return own

    def at(self, step: int, steps: int) -> Outside:
        """See `Disturbance`: nothing moves."""
        return Outside()


def tiled_floor(
    gaits: Sequence[Gait], plants: Sequence[Plant], seed: int, world_ids: int | Sequence[int]
) -> TiledFloor | None:
    """Make the floor; None without tiles."""
    worlds = [world_ids] if isinstance(world_ids, int) else world_ids
    return next((TiledFloor(gait.tiles_m, seed, worlds) for gait in gaits if gait.tiles_m), None)
