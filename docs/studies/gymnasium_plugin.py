"""Mounted robots in stock Gymnasium, with the plugin and without: the table of docs/plugin_evidence.md.

    python docs/studies/gymnasium_plugin.py [ROBOT ...] (about eight minutes; ROBOT is a part of a name)

Each robot is mounted as `cmg-mj mount ... --plugin --quick` does it. Then examples/gymnasium_plugin.py, which imports
nothing of cmg_mj, runs ten seeds in a process of its own. The seed is also the world of the sensors' noise.
"""

from __future__ import annotations

import io
import re
import shlex
import subprocess
import sys
import tempfile
from contextlib import redirect_stdout
from pathlib import Path
from typing import NamedTuple

sys.path.insert(0, str(Path(__file__).parents[2]))

from cmg_mj.cli import main as cmg_mj
from cmg_mj.results.tables import markdown_table
from tests.features.mounting.robots import ROBOTS, Robot, gymnasium_asset

EXAMPLE = Path(__file__).parents[2] / "examples" / "gymnasium_plugin.py"
SEEDS = 10


class Case(NamedTuple):
    """A robot in its environment.

    Attributes:
        environment: The environment's name.
        robot: The robot, and how it is mounted.
        noise: Noise of a reset.
        usual_noise: The same, as the environment has it.
        share: Share of the robot's action space that random actions take.
        large_share: A larger one.
    """

    environment: str
    robot: Robot
    noise: float
    usual_noise: float
    share: float
    large_share: float


PENDULUM, HOPPER, WALKER, HUMANOID = "InvertedPendulum-v5", "Hopper-v5", "Walker2d-v5", "Humanoid-v5"
HELD_CART = Robot(gymnasium_asset("inverted_pendulum.xml"), {"body": "pole", "axis": "hinge"})
CASES = {
    f"{PENDULUM}, cart held": Case(PENDULUM, HELD_CART, 0.001, 0.01, 0.01, 1.0),
    f"{PENDULUM}, cart free": Case(PENDULUM, ROBOTS["inverted_pendulum on its free cart"], 0.001, 0.01, 0.01, 0.03),
    f"{HOPPER}, freed": Case(HOPPER, ROBOTS["hopper, freed"], 0.001, 0.005, 0.01, 1.0),
    f"{WALKER}, freed": Case(WALKER, ROBOTS["walker2d, freed"], 0.001, 0.005, 0.01, 1.0),
    HUMANOID: Case(HUMANOID, ROBOTS["humanoid"], 0.0002, 0.01, 0.01, 1.0),
}


def falls(case: Case, model: Path, noise: float, share: float) -> list[int]:
    """After how many steps the robot falls, of the seeds in which it does."""
    command = [sys.executable, EXAMPLE, case.environment, model, str(noise), str(share)]
    done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True)
    return [int(number) for number in re.findall(r"\d+", done.stdout.rpartition("[")[2])]


def stood(fallen: list[int]) -> str:
    """In how many of the seeds the robot stood."""
    return f"{SEEDS - len(fallen)} of {SEEDS}"


def row(name: str, case: Case, folder: Path) -> list[str]:
    """All of one robot."""
    target = folder / f"{case.environment}.xml"
    _, _, _, *options = shlex.split(case.robot.command)
    options += ["--quick", "--plugin", "--json", "--overwrite", "-o", str(target)]
    with redirect_stdout(io.StringIO()):
        cmg_mj(["mount", str(case.robot.path), *options])
    (model,) = (folder / f"{target.stem}_plugin").glob("*.xml")
    alone = falls(case, target, case.noise, case.share)
    return [
        name,
        f"{case.noise:g}",
        stood(falls(case, model, case.noise, 0.0)),
        stood(falls(case, model, case.noise, case.share)),
        f"{stood(alone)} ({min(alone, default=0)} to {max(alone, default=0)} steps)",
        f"{stood(falls(case, model, case.noise, case.large_share))} ({case.large_share:.0%})",
        f"{stood(falls(case, model, case.usual_noise, 0.0))} ({case.usual_noise:g})",
    ]


def main() -> None:
    """Print the table."""
    names = [name for name in CASES if not sys.argv[1:] or any(part in name for part in sys.argv[1:])]
    with tempfile.TemporaryDirectory() as folder:
        rows = [row(name, CASES[name], Path(folder)) for name in names]
    head = ["robot", "noise of a reset", "plugin, no action", "plugin, 1 % random", "no plugin, 1 % random"]
    print(markdown_table([*head, "plugin, more random", "plugin, usual noise"], rows, text_columns=1))


if __name__ == "__main__":
    main()
