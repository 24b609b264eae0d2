"""Pairs on robots: the table of docs/mount_evidence.md.

python docs/studies/mounted_robots.py [ROBOT ...] (about six minutes on a quiet core)
python docs/studies/mounted_robots.py --commands (with what each is mounted)
python docs/studies/mounted_robots.py --homogeneous [ROBOT ...] (`homogeneous` in the loop, beside `gyro_free`)
python docs/studies/mounted_robots.py --public FOLDER [ROBOT ...] (robots whose repositories are cloned into FOLDER)

The robots are those of tests/features/mounting/robots.py; ROBOT is a part of a name. The sensors of the datasheets,
`gyro_free`. The push that a robot stands is what `cmg-mj mount` prints, without the limit of a minute. It, and 1.8
times it, is tried on ten worlds of another seed, to both sides, at 2 s from upright; and 30 s from the tilt that the
scenario starts with, alone, are tried on that seed too. With --homogeneous both observers are pushed with the E
that the reduced model has with `homogeneous` and the papers' parameters, and with 1.2 times it.
"""

import math
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

from cmg_mj import mount
from cmg_mj.features.mounting.limits import PUSH_S, push_limits
from cmg_mj.features.mounting.push import TimeLimit, simulated_push
from cmg_mj.features.mounting.write import write_scenario
from cmg_mj.results.tables import markdown_table
from cmg_mj.runs.experiment import Experiment, prepare
from cmg_mj.scenario.schema import ObserverSettings
from tests.features.mounting.robots import ROBOTS, Robot

WORLDS = 10
SEED = 1
PUBLIC = {
    "dm_control's cart-pole, its cart free": Robot(
        Path("dm_control/dm_control/suite/cartpole.xml"), {"body": "pole_1", "axis": "hinge_1", "release": ["slider"]}
    ),
    "dm_control's hopper, freed": Robot(
        Path("dm_control/dm_control/suite/hopper.xml"),
        {"body": "torso", "axis": "x", "base": "free", "scale": 1.6},
        True,
    ),
    "LimX TRON 1 on point feet": Robot(
        Path("robot-description/pointfoot/PF_TRON1A/xml/robot.xml"),
        {"body": "base_Link", "axis": "y", "scale": 1.6},
        True,
    ),
    "LimX TRON 1 on wheels": Robot(
        Path("robot-description/pointfoot/WF_TRON1A/xml/robot.xml"),
        {"body": "base_Link", "axis": "y", "scale": 1.6},
        True,
    ),
}
"""Robots of github.com/google-deepmind/dm_control (985d094) and github.com/limxdynamics/robot-description (469df8d)."""


def stood(experiment: Experiment, torques: list[float]) -> int:
    """In how many worlds it stands, each with its push [N m]."""
    numbers = [i % WORLDS for i in range(len(torques))]
    vary = {"push.0.torque_n_m": torques}
    return int(experiment.run_many(numbers, settings=vary, keep_trajectory=False).stood.sum())


def row(name: str, robot: Robot, folder: Path) -> list[str]:
    """All of one robot."""
    model = mount(robot.path, **robot.options).save(folder / "balanced.xml")
    upright = write_scenario(model, robot.path, "gyro_free")
    can = push_limits(upright)
    stands = simulated_push(upright, can, time_limit=TimeLimit(math.inf)).impulse
    other = write_scenario(model, robot.path, "gyro_free", can).with_settings({"seed": SEED, "duration_s": 30.0})
    alone = stood(other, [0.0] * WORLDS)
    other = other.with_settings({"duration_s": 14.0, "plant.initial_tilt_deg": 0.0, "push.0.start_s": 2.0})
    signs = [1.0] * WORLDS + [-1.0] * WORLDS
    pushed, more = (stood(other, [share * stands / PUSH_S * sign for sign in signs]) for share in (1.0, 1.8))
    figures = can.figures()
    return [
        name,
        "its feet or wheels" if robot.on_contacts else "a hinge",
        f"{robot.options.get('scale', 1.0):g}",
        f"{figures['inertia_kg_m2']:.3g}",
        f"{can.limit.pole:.2f}, {can.pole:.2f}",
        f"{figures['limit_tilt_deg']:.1f}",
        f"{can.limit_push_impulse:.2f}",
        f"{can.push_margin.median_impulse:.2f} ({can.fraction_of_limit:.0%})",
        f"{stands:.2f} ({stands / can.push_margin.median_impulse:.0%})",
        f"{alone} of {WORLDS}; {pushed}, {more} of {2 * WORLDS}",
    ]


def beside_homogeneous(name: str, robot: Robot, folder: Path) -> list[str]:
    """E with either observer, and the worlds that stand that of `homogeneous`, and 1.2 times it, to both sides."""
    model = mount(robot.path, **robot.options).save(folder / "balanced.xml")
    mounted = write_scenario(model, robot.path, "gyro_free")
    kinds = [ObserverSettings(kind=kind) for kind in ("homogeneous", "gyro_free")]  # with the papers' parameters
    loops = [prepare(mounted.scenario.model_copy(update={"observer": kind}), mounted.plant) for kind in kinds]
    limits = [push_limits(loop) for loop in loops]
    push = limits[0].push_margin.median_impulse / PUSH_S
    upright = {"seed": SEED, "duration_s": 14.0, "plant.initial_tilt_deg": 0.0}
    upright["push"] = [{"start_s": 2.0, "duration_s": PUSH_S, "torque_n_m": push}]
    signs = [1.0] * WORLDS + [-1.0] * WORLDS
    pushed = [loop.with_settings(upright) for loop in loops]
    stand = [[stood(loop, [share * push * sign for sign in signs]) for share in (1.0, 1.2)] for loop in pushed]
    margins = [f"{can.push_margin.median_impulse:.2f}" for can in limits]
    return [name, *margins, *(f"{once}, {more} of {2 * WORLDS}" for once, more in stand)]


def main() -> None:
    """Print the table."""
    parts = [word for word in sys.argv[1:] if not word.startswith("--")]
    robots = ROBOTS
    if "--public" in sys.argv:
        clones = Path(parts.pop(0))
        robots = {name: robot._replace(path=clones / robot.path) for name, robot in PUBLIC.items()}
    wanted = [name for name in robots if not parts or any(part in name for part in parts)]
    if "--homogeneous" in sys.argv:
        with tempfile.TemporaryDirectory() as folder:
            rows = [beside_homogeneous(name, ROBOTS[name], Path(folder)) for name in wanted]
        names = ["robot", "E of homogeneous [N m s]", "E of gyro_free [N m s]"]
        print(
            markdown_table([*names, "homogeneous stands its E, 1.2 E", "gyro_free stands them"], rows, text_columns=1)
        )
        return
    if sys.argv[1:] == ["--commands"]:
        print("\n".join(robot.command for robot in ROBOTS.values()))
        return
    with tempfile.TemporaryDirectory() as folder:
        rows = [row(name, robots[name], Path(folder)) for name in wanted]
    names = ["robot", "tilts about", "scale", "inertia [kg m^2]", "pole: reduced, simulated [1/s]", "ceiling [deg]"]
    names += ["ceiling [N m s]", "E [N m s] (of the ceiling)", "stands [N m s] (of E)"]
    names += ["another seed: alone; pushed so, and 1.8 times so"]
    print(markdown_table(names, rows, text_columns=2))


main()
