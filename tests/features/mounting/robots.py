"""Robots that no one here wrote, and two that are examples: how each is mounted."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

EXAMPLES = Path(__file__).parents[3] / "examples" / "robots"


def gymnasium_asset(name: str) -> Path:
    """One of the robots that Gymnasium brings."""
    package = find_spec("gymnasium")
    assert package is not None
    assert package.origin is not None
    return Path(package.origin).parent / "envs" / "mujoco" / "assets" / name


def _spread(point: tuple[float, ...]) -> str:
    return " ".join(f"{part:g}" for part in point)


class Robot(NamedTuple):
    path: Path
    options: dict[str, Any]
    on_contacts: bool = False

    @property
    def command(self) -> str:
        """The command that mounts it, from the folder that its file is in."""
        options = dict(self.options)
        words = ["cmg-mj mount", self.path.name, f"--body {options.pop('body')}"]
        for name, value in options.items():
            if name == "base":
                words.append("--free-base")
            elif name == "release":
                words += [f"--release {joint}" for joint in value]
            else:
                words.append(f"--{name} " + (f"{value}" if not isinstance(value, tuple) else f"'{_spread(value)}'"))
        return " ".join(words)


ROBOTS = {
    "inverted_pendulum on its free cart": Robot(
        gymnasium_asset("inverted_pendulum.xml"), {"body": "pole", "axis": "hinge", "release": ["slider"]}
    ),
    "inverted_double_pendulum, its joint held": Robot(
        gymnasium_asset("inverted_double_pendulum.xml"), {"body": "pole", "scale": 1.1}
    ),
    "hopper, freed": Robot(
        gymnasium_asset("hopper.xml"), {"body": "torso", "axis": "x", "base": "free", "scale": 2.0}, True
    ),
    "walker2d, freed": Robot(
        gymnasium_asset("walker2d_v5.xml"),
        {"body": "torso", "axis": "x", "base": "free", "scale": 1.6, "position": (0.15, 0.0, 0.0)},
        True,
    ),
    "humanoid": Robot(gymnasium_asset("humanoid.xml"), {"body": "torso", "axis": "y", "scale": 2.2}, True),
    "torso": Robot(EXAMPLES / "torso.xml", {"body": "torso", "axis": "x", "scale": 1.21}, True),
    "bicycle": Robot(EXAMPLES / "bicycle.xml", {"body": "frame", "axis": "x", "position": (0.0, 0.0, 0.3)}, True),
}
