"""Small robots such as others publish: a pole on a cart, a pendulum, wheels, tyres, a leg."""

from __future__ import annotations

from functools import partial
from typing import Any

import pytest

from cmg_mj.features.mounting.push import TimeLimit

CART_POLE = """
<mujoco>
  <option timestep="0.005" integrator="RK4"/>
  <worldbody>
    {rails}
    <body name="cart" pos="0 0 1"><joint name="slider" type="slide" axis="1 0 0" damping="5e-4"/>
      <geom name="cart" type="box" size="0.2 0.15 0.1" mass="1"/>
      <body name="pole"><joint name="hinge" axis="0 1 0" damping="2e-6"/>
        <geom type="capsule" fromto="0 0 0 0 0 1" size="0.045" mass="0.1"/></body></body>
  </worldbody>
</mujoco>
"""
RAIL = '<geom name="rail" type="capsule" pos="0 0.07 1" zaxis="1 0 0" size="0.02 2"/>'
PENDULUM = """
<mujoco>
  <option timestep="0.01"><flag contact="disable"/></option>
  <worldbody>
    <body name="pole" pos="0 0 0.6"><joint name="hinge" axis="0 1 0" damping="0.1"/>
      <geom size="0.05" pos="0 0 0.5" mass="1"/></body>
  </worldbody>
</mujoco>
"""
TWO_WHEELS = """
<mujoco>
  <worldbody>
    <geom type="plane" size="5 5 0.1"/>
    <body name="frame" pos="0 0 0.1"><freejoint/>
      <geom type="box" size="0.08 0.1 0.15" pos="0 0 0.3" mass="3"/>
      <body pos="0 0.15 0"><joint axis="0 1 0"/>
        <geom type="cylinder" size="0.1 0.015" euler="90 0 0" mass="0.4"/></body>
      <body pos="0 -0.15 0"><joint axis="0 1 0"/>
        <geom type="cylinder" size="0.1 0.015" euler="90 0 0" mass="0.4"/></body>
    </body>
  </worldbody>
</mujoco>
"""
BICYCLE = """
<mujoco>
  <default><geom condim="4" friction="1 0.01 0.001"/>
    <default class="tyre">
      <geom type="cylinder" size="{radius} {half_width}" euler="90 0 0" mass="1.2" {tyre}/></default>
  </default>
  <worldbody>
    <geom type="plane" size="5 5 0.1"/>
    <body name="frame" pos="0 0 {start}"><freejoint/>
      <geom type="box" size="0.3 0.02 0.1" pos="{ahead} {beside} {height}" mass="{mass}"/>
      <body pos="-0.5 0 0"><joint axis="0 1 0"/><geom class="tyre"/></body>
      <body pos="0.5 0 0"><joint name="steering" axis="-0.3 0 1"/>
        <geom type="capsule" fromto="0 0 0.1 -0.05 0 0.5" size="0.015" mass="0.6"/>
        <body><joint axis="0 1 0"/><geom class="tyre"/></body></body>
    </body>
  </worldbody>
</mujoco>
"""
LEG = """
<mujoco>
  <default><joint damping="0.05" armature="0.2"/></default>
  <option timestep="0.005"/>
  <worldbody>
    <geom type="plane" size="5 5 0.1"/>
    <body name="torso" pos="0 0 1">
      <joint name="x" type="slide" axis="1 0 0"/><joint name="z" type="slide" axis="0 0 1"/>
      <joint name="y" axis="0 1 0"/>
      <geom type="capsule" fromto="0 0 -0.05 0 0 0.2" size="0.065"/>
      <body pos="0 0 -0.05"><joint name="hip" axis="0 1 0"/>
        <geom type="capsule" fromto="0 0 0 0 0 -0.45" size="0.05"/>
        <body pos="0 0 -0.45"><joint name="knee" axis="0 1 0"/>
          <geom type="capsule" fromto="0 0 0 0 0 -0.4" size="0.03"/>
          <body pos="0 0 -0.4"><joint name="ankle" axis="0 1 0"/>
            <geom type="capsule" fromto="-0.12 0 0 0.13 0 0" size="0.04"/></body></body></body>
    </body>
  </worldbody>
</mujoco>
"""


def cart_pole(mass: float = 1.0, friction: float = 0.0, damping: float = 5e-4) -> str:
    """A cart-pole of dm_control's sizes: mass of the cart [kg], friction [N] and damping [N s/m] of its slider."""
    text = CART_POLE.format(rails="").replace('mass="1"', f'mass="{mass}"', 1)
    return text.replace('damping="5e-4"', f'damping="{damping}" frictionloss="{friction}"')


def bicycle(
    half_width: float = 0.01,
    tyre: str = "",
    *,
    radius: float = 0.34,
    height: float = 0.3,
    ahead: float = 0.0,
    beside: float = 0.0,
    mass: float = 8.0,
    start: float | None = None,
) -> str:
    """A bicycle whose tyres are flat [m, kg]; `height` is that of its frame above the axles."""
    places = {"radius": radius, "height": height, "ahead": ahead, "beside": beside, "start": start or radius}
    return BICYCLE.format(half_width=half_width, tyre=tyre, mass=mass, **places)


ROBOTS: dict[str, tuple[str, dict[str, Any]]] = {
    "cart-pole, held": (CART_POLE.format(rails=""), {"body": "pole"}),
    "pendulum": (PENDULUM, {"body": "pole"}),
    "two wheels": (TWO_WHEELS, {"body": "frame", "position": (0.0, 0.0, 0.3)}),
    "bicycle": (
        bicycle(half_width=0.003, tyre='margin="0.02"'),
        {"body": "frame", "axis": "x", "position": (0.0, 0.0, 0.4), "scale": 1.4},
    ),
    "leg": (LEG, {"body": "torso", "axis": "x", "base": "free", "scale": 1.6}),
}
"""Name -> MJCF and how it is mounted."""


def without_time_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the search for a push take the time that it takes: this machine may be busy."""
    unlimited = partial(TimeLimit, clock=lambda: 0.0)
    monkeypatch.setattr("cmg_mj.features.mounting.push.TimeLimit", unlimited)
