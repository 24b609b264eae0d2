"""`python -m cmg_mj.read_off` writes what MuJoCo reads off the bundled models, for `known_rigs.py`."""

from __future__ import annotations

import dataclasses
import json
from typing import Any

from cmg_mj.errors import InputError
from cmg_mj.known_rigs import FILE, hash_of_models, name_of
from cmg_mj.plant import load_plant
from cmg_mj.resources import bundled, folder
from cmg_mj.trajectory import whole_file


def read_off() -> dict[str, Any]:
    """Cubes and reduced model of every bundled rig, with its thrust bearing free and locked."""
    rigs = {}
    for model in bundled("models"):
        for locked in (False, True):
            name = f"{model}.xml"
            try:
                plant = load_plant(model=name, lock_thrust_bearing=locked)
            except InputError:  # a module, which is no rig by itself
                continue
            if len(plant.axes) > 1:
                continue
            cubes = [cube.name for cube in plant.cubes]
            rigs[name_of(name, locked=locked)] = {
                "cubes": cubes,
                "largest_step_s": plant.largest_step,
                "hints": plant.hints,
                "gravity_m_s2": plant.gravity,
                "reduced": dataclasses.asdict(plant.reduced),
                "tilt": dataclasses.asdict(plant.radial_tilt),
            }
    return {"sha256": hash_of_models(), "rigs": rigs}


if __name__ == "__main__":
    with whole_file(folder("models") / FILE) as temporary:
        temporary.write_text(json.dumps(read_off(), indent=2) + "\n", encoding="utf-8")
