"""A gait on two point feet: the section [gait] of a scenario."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field
from pydantic.dataclasses import dataclass

from cmg_mj.inputs.types import STRICT, Latency, NonNegative, Positive, Section


@dataclass(frozen=True, config=STRICT)
class Gait(Section):
    """Steps in open loop: nothing but the gimbals answers to what the robot does.

    Attributes:
        steps: Number of steps; 0: it does not walk.
        step_length_m: How far a step takes a foot beyond the other one [m].
        single_s: Time on one foot [s].
        double_s: Time on both feet, in which the load moves to the other one [s].
        lift_m: Height to which a foot is lifted [m].
        stand_s: Time on both feet at rest, before the first step and after the last one [s].
        width_m: Distance between the lines of both feet, from the first steps on; without it that of the keyframe [m].
        lean_s: Time constant in which the torso is moved until the mass centre stands over the feet, by the equilibrium
            bias that is found; 0: none is looked for [s].
        tiles_m: Largest height of the floor's tiles, each of which has its own [m].
        switch_force_n: Force from which a foot switch is closed [N].
        switch_delay_s: Delay of the foot switches [s].
        switch_bounce_s: Time for which a foot switch bounces after a change [s].
    """

    steps: Annotated[int, Field(ge=0, le=10_000)] = 0
    step_length_m: Annotated[float, Field(ge=-1.0, le=1.0)] = 0.1
    single_s: Annotated[float, Field(ge=0.05, le=10.0)] = 0.5
    double_s: Annotated[float, Field(ge=0.05, le=10.0)] = 0.5
    lift_m: Annotated[float, Field(gt=0.0, le=0.5)] = 0.02
    stand_s: Annotated[float, Field(ge=0.5, le=60.0)] = 1.25
    width_m: Annotated[float, Field(gt=0.0, le=2.0)] | None = None
    lean_s: NonNegative = 1.0
    tiles_m: Annotated[float, Field(ge=0.0, le=0.02)] = 0.0
    switch_force_n: Positive = 5.0
    switch_delay_s: Latency = 0.005
    switch_bounce_s: Latency = 0.005

    @property
    def unmodelled(self) -> str:
        """See `Section`."""
        return "the walk" if self.steps else ""
