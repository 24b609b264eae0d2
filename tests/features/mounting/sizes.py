"""Robots of one shape and any size: two wheels, two ball feet, a blade."""

from __future__ import annotations

SHAPES = {
    "two wheels": """
      <body pos="0 {b} 0"><joint axis="0 1 0"/><geom type="cylinder" size="{r} {w}" euler="90 0 0" mass="{n}"/></body>
      <body pos="0 -{b} 0"><joint axis="0 1 0"/>
        <geom type="cylinder" size="{r} {w}" euler="90 0 0" mass="{n}"/></body>""",
    "ball feet": '<geom size="{r}" pos="0 {b} 0" mass="{n}"/><geom size="{r}" pos="0 -{b} 0" mass="{n}"/>',
    "a blade": '<geom type="box" size="{w} {b} {r}" mass="{n}"/>',
}
ROBOT = """
<mujoco>
  <option timestep="{step}"/>
  <worldbody>
    <geom type="plane" size="9 9 0.1"/>
    <body name="frame" pos="0 0 {z}"><freejoint/>
      <geom type="box" size="{a} {b} {c}" pos="{o} 0 {h}" mass="{m}"/>{feet}
    </body>
  </worldbody>
</mujoco>
"""
LENGTHS = {"z": 0.27, "a": 0.18, "b": 0.45, "c": 0.35, "o": 0.03, "h": 0.5, "r": 0.25, "w": 0.01}
"""Lengths in shares of the robot's size; its box reaches from 0.4 to 1.1."""


def robot(shape: str, size_m: float, step_s: float = 0.002, density: float = 263.0) -> str:
    """A robot of this size, whose box has a mass of density times the cube of the size [kg]."""
    lengths = {name: share * size_m for name, share in LENGTHS.items()}
    fields = {**lengths, "m": density * size_m**3, "n": density * size_m**3 / 12.0, "step": step_s}
    return ROBOT.format(feet=SHAPES[shape].format(**fields), **fields)
