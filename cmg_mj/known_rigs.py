"""The bundled rigs as MuJoCo has read them, so that a scenario on one of them is checked without MuJoCo.

`models/read_off.json` holds the reduced model of every bundled rig, and the hash of the files it was read off. It is no
source of numbers: where a file has changed since, it does not count, and the model is loaded. `python -m
cmg_mj.read_off` writes it anew.
"""

from __future__ import annotations

import hashlib
import json
import math
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from cmg_mj.plant_settings import PlantSettings
from cmg_mj.reduced import ReducedModel
from cmg_mj.resources import find, folder
from cmg_mj.sensors import Sensors
from cmg_mj.tilt import RadialTilt, TiltNoise

FILE = "read_off.json"


class RigFacts(NamedTuple):
    """What a scenario's controller and observers are made from.

    Attributes:
        path: The model's file.
        cubes: Names of its modules.
        reduced: Its reduced model.
        tilt: The tilt estimate for its accelerometers.
        gravity: [m/s^2].
        largest_step: The largest physics step that is accurate enough [s].
        hints: What on it is not what the reduced model takes it for, in clauses.
    """

    path: Path
    cubes: tuple[str, ...]
    reduced: ReducedModel
    tilt: RadialTilt
    gravity: float
    largest_step: float
    hints: tuple[str, ...]

    def noise(self, sensors: Sensors) -> TiltNoise:
        """The noise of tilt, angular acceleration and y2, the mean of as many encoders as there are gimbals."""
        gimbal = sensors.encoder.deviation / math.sqrt(self.reduced.gimbals)
        return replace(self.tilt.noise(sensors.accelerometer.deviation, self.gravity), gimbal=gimbal)


def name_of(model: str, *, locked: bool) -> str:
    """Under what a rig is kept."""
    return f"{model}, thrust bearing locked" if locked else model


def hash_of_models() -> str:
    """Hash of all bundled models: they include one another."""
    digest = hashlib.sha256()
    for path in sorted(folder("models").glob("*.xml")):
        digest.update(path.name.encode() + b"\0" + path.read_bytes().replace(b"\r\n", b"\n") + b"\0")
    return digest.hexdigest()


def known_rig(settings: PlantSettings) -> RigFacts | None:
    """What is known of a scenario's rig without loading it.

    Args:
        settings: The scenario's plant.

    Returns:
        The facts, if the rig is a bundled one, its files are as they were read and no setting changes them; else None.

    Raises:
        InputError: There is no such file.
    """
    path = find("models", settings.model, ".xml", "plant.model =")
    kept = folder("models") / FILE
    as_filed = not (settings.changes() or settings.locked_axes or settings.turn_rate_rad_s)
    if not as_filed or settings.integrator != PlantSettings.integrator:
        return None  # only MuJoCo can say whether it goes with them, and at which step
    # What a linked model includes, MuJoCo looks for beside the link.
    if path.is_symlink() or path.resolve().parent != folder("models").resolve():
        return None
    try:
        known = json.loads(kept.read_text(encoding="utf-8"))
        rig = known["rigs"][name_of(path.name, locked=settings.lock_thrust_bearing)]
        facts = RigFacts(
            path,
            tuple(rig["cubes"]),
            ReducedModel(**rig["reduced"]),
            RadialTilt(**rig["tilt"]),
            float(rig["gravity_m_s2"]),
            float(rig["largest_step_s"]),
            tuple(rig["hints"]),
        )
        return facts if known["sha256"] == hash_of_models() else None
    except (OSError, ValueError, LookupError, TypeError):  # not there, or not as `read_off` writes it
        return None
