"""What pairs do on robots: the table of docs/mount.md.

python docs/studies/mounted_robots.py [ROBOT ...] (about six minutes on a quiet core)
python docs/studies/mounted_robots.py --commands (with what each is mounted)

The robots are those of tests/plant/mounting/robots.py; ROBOT is a part of a name. Ten worlds each, the sensors of the
datasheets, `gyro_free`; from the smaller of a degree and a quarter of the ceiling, 30 s, alone and with a push of
0.6 E at 10 s. The simulated E is the largest push, in steps of 0.05 E, up to which at least half of the worlds stand.
"""

import math
import sys
import tempfile
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2]))

from cmg_mj import mount
from cmg_mj.results.markdown import table
from cmg_mj.simulation.experiment import Experiment
from cmg_mj.studies.push_limits.largest_push import PUSH_S
from cmg_mj.studies.push_limits.mount_files import write_scenario
from cmg_mj.studies.push_limits.prospects import prospects
from tests.plant.mounting.robots import ROBOTS, Robot

WORLDS = 10
SHARES = np.arange(0.6, 1.86, 0.05)


def stood(experiment: Experiment, **settings: float) -> int:
    """In how many worlds it stands, with other settings."""
    fields = {name.replace("__", "."): [value] * WORLDS for name, value in settings.items()}
    return int(experiment.run_many(WORLDS, vary=fields, keep_trajectory=False).stood.sum())


def simulated(experiment: Experiment, torque: float) -> float:
    """The simulated E in shares of what the reduced model says: pushed at 2 s, upright before."""
    scenario = experiment.with_settings({"duration_s": 8.0, "plant.initial_tilt_deg": 0.0, "push.0.start_s": 2.0})
    for last, share in zip([math.nan, *SHARES], SHARES, strict=False):
        if stood(scenario, push__0__torque_n_m=float(share * torque)) < WORLDS / 2:
            return float(last)
    return math.inf


def row(name: str, robot: Robot, folder: Path) -> list[str]:
    """All of one robot."""
    model = mount(robot.path, **robot.options).save(folder / "balanced.xml")
    can = prospects(write_scenario(model, robot.path, "gyro_free"))
    pushed = write_scenario(model, robot.path, "gyro_free", can).with_settings({"duration_s": 30.0})
    torque = can.push_margin.median_impulse / PUSH_S
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
        f"{simulated(pushed, torque):.2f} E",
        f"{stood(pushed, push__0__torque_n_m=0.0)}, {stood(pushed, push__0__torque_n_m=0.6 * torque)}",
    ]


def main() -> None:
    """Print the table."""
    wanted = [name for name in ROBOTS if not sys.argv[1:] or any(part in name for part in sys.argv[1:])]
    if sys.argv[1:] == ["--commands"]:
        print("\n".join(robot.command for robot in ROBOTS.values()))
        return
    with tempfile.TemporaryDirectory() as folder:
        rows = [row(name, ROBOTS[name], Path(folder)) for name in wanted]
    names = ["robot", "tilts about", "scale", "inertia [kg m^2]", "pole: reduced, simulated [1/s]", "ceiling [deg]"]
    names += ["ceiling [N m s]", "E [N m s] (of the ceiling)", "simulated E", "stand 30 s of 10: alone, pushed"]
    print(table(names, rows, text_columns=2))


main()
