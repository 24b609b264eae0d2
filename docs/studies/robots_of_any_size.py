"""Robots of 5 cm to 3 m in plain MuJoCo: what docs/mount_evidence.md says of them.

python docs/studies/robots_of_any_size.py [SIZE ...] (ten minutes on a quiet core)

`cmg-mj mount --plugin` mounts each. MuJoCo alone then steps the model with its plugin, in ten worlds of another seed,
and pushes the frame to both sides with the torque that `mount` printed, and with 1.8 times it.
"""

import itertools
import math
import os
import sys
import tempfile
from pathlib import Path

import mujoco

sys.path.insert(0, str(Path(__file__).parents[2]))

from cmg_mj.features.mounting.limits import PUSH_S
from cmg_mj.features.mounting.push import TimeLimit
from cmg_mj.features.mounting.write import PUSHED_AT_S, MountResult, mount_and_write
from cmg_mj.results.tables import markdown_table
from tests.features.mounting.sizes import SHAPES, robot

SIZES = [0.05, 0.07, 0.1, 0.15, 0.25, 0.4, 0.7, 1.2, 2.0, 3.0]
STEPS = [0.002, 0.005]
SEED, WORLDS = 1, 10
AFTER_S = 12.0
FALLEN = math.cos(math.radians(30.0))
REQUEST = {"axis": "y", "modules": 2, "name": "", "keyframe": None, "hold": "constraints", "release": []}


def mounted(shape: str, size: float, step: float) -> MountResult:
    """Mount a pair on a robot, in the current folder: a larger one for its size on a small robot, which falls fast."""
    name = f"robot_{1000 * size:.0f}"
    Path(f"{name}.xml").write_text(robot(shape, size, step), encoding="utf-8")
    request = {**REQUEST, "body": "frame", "base": "as_is", "scale": size * (6.0 if size < 0.2 else 4.0)}
    limit = TimeLimit(math.inf)
    request["position"] = [0.0, 0.0, 0.7 * size]
    return mount_and_write(
        f"{name}.xml", f"{name}_pair.xml", "gyro_free", time_limit=limit, with_plugin=True, **request
    )


def stand(model: mujoco.MjModel, torque: float) -> int:
    """Count the worlds, of ten and two sides, in which the frame stands a push [N m]."""
    stood, frame = 0, model.body("frame").id
    for world, side in itertools.product(range(WORLDS), (1.0, -1.0)):
        data = mujoco.MjData(model)
        mujoco.mj_resetDataKeyframe(model, data, model.key("start").id)
        data.plugin_state[:2] = SEED, world
        mujoco.mj_forward(model, data)
        turn = data.site("tilt").xmat  # a view; row by row
        axis, end = turn[1::3].copy(), PUSHED_AT_S + PUSH_S + AFTER_S
        while data.time < end and turn[8] > FALLEN:
            pushed = PUSHED_AT_S <= data.time + 1e-9 < PUSHED_AT_S + PUSH_S
            data.xfrc_applied[frame, 3:] = axis * (torque * side * pushed)
            mujoco.mj_step(model, data)
        stood += data.time >= end
    return stood


def row(shape: str, size: float, step: float) -> list[str]:
    """All of one robot."""
    result = mounted(shape, size, step)
    assert result.plugin is not None
    assert result.simulated is not None
    library = next(result.plugin.model.parent.glob("lib*"))
    mujoco.mj_loadPluginLibrary(str(library.resolve()))
    model = mujoco.MjModel.from_xml_path(str(result.plugin.model))
    figures, torque = result.figures(), result.simulated.impulse / PUSH_S
    counts = [stand(model, share * torque) for share in (1.0, 1.8)]
    return [
        f"{size:g}",
        shape,
        f"{1e3 * step:g}",
        f"{figures['pole_1_s']:.3g}",
        f"{figures['limit_tilt_deg']:.2g}",
        f"{torque:.3g}",
        ", ".join(f"{count}" for count in counts),
    ]


def main() -> None:
    """Print the table."""
    chosen = [float(word) for word in sys.argv[1:]]
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        for size, shape, step in zip(SIZES, itertools.cycle(SHAPES), itertools.cycle(STEPS), strict=False):
            if not chosen or size in chosen:
                rows.append(row(shape, size, step))
                print(" | ".join(rows[-1]), file=sys.stderr)
    names = ["size [m]", "it stands on", "file's step [ms]", "falls with [1/s]", "ceiling [deg]"]
    names += ["printed push [N m]", f"stand it, and 1.8 times it (of {2 * WORLDS})"]
    print(markdown_table(names, rows, text_columns=2))


main()
