"""Stages between the axes: each orders beside what those before have ordered, and no two move one actuator."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import pytest

from cmg_mj.core.axis import Known, Tick
from cmg_mj.core.controller import Controller
from cmg_mj.core.errors import InputError
from cmg_mj.core.loop import ControlLoop, Disturbance, Outside
from cmg_mj.core.rig import AxesOrders, AxesStage
from cmg_mj.core.straight_line import Tables
from cmg_mj.core.types import MultiAxisReading
from cmg_mj.plant.physics import OneWorld
from cmg_mj.runs.experiment import prepare
from cmg_mj.scenario.loading import load_scenario

TWO_AXES = prepare(load_scenario("two_axes", ["controller.feedback=truth"]))


@dataclass(frozen=True)
class Walk(AxesStage):
    """Turns the gimbals faster by a rate [rad/s], knows a tilt and a bias, and moves actuators."""

    rate: float = 0.0
    servos: Sequence[int] = ()

    @property
    def actuators(self) -> Sequence[int]:
        return self.servos

    def step(
        self,
        memory: Any,
        step: int,
        orders: AxesOrders,
        ticks: Sequence[Tick],
        readings: MultiAxisReading,
        tables: Tables,
    ) -> tuple[Any, AxesOrders]:
        rates = [rate + self.rate for rate in orders.rates]
        known = [before._replace(tilt=0.1, bias=0.2) for before in orders.known]
        setpoints = [*orders.setpoints, *(float(actuator) for actuator in self.servos)]
        return memory, orders._replace(rates=rates, known=known, setpoints=setpoints)


def first_tick(*between: AxesStage) -> Controller:
    """Take a decision with these stages, on a rig that turns and tilts with turned gimbals."""
    controller = Controller(TWO_AXES.controller().axes, between)
    physics = OneWorld(TWO_AXES.plant)
    for joint, rate in (("yaw", 1.0), ("roll", 0.1), ("pitch", 0.2)):
        physics.data.joint(joint).qvel[0] = rate
    for module in (module for axis in TWO_AXES.plant.axes for module in axis.modules):
        physics.data.qpos[module.gimbal] += 0.3 * module.direction
    controller.update(0, physics.reading(physics.state()[1]))
    return controller


def known(controller: Controller) -> Known:
    """Return what the first axis knows of its next measurement."""
    assert controller.state.deciding is not None
    before, _ = controller.state.deciding.axes
    assert before.known is not None
    return before.known


def test_turning_after_a_gait_is_the_sum_of_both() -> None:
    (turning,) = TWO_AXES.controller().rig.between
    alone, walk, both = (first_tick(*between) for between in ([turning], [Walk(0.01)], [Walk(0.01), turning]))
    laws = [tick.u for tick in walk.ticks]
    assert [tick.u for tick in both.ticks] == laws == [tick.u for tick in alone.ticks]  # observers are told of neither
    turned = [rate - u for rate, u in zip(alone.gimbal_rates, laws, strict=True)]
    assert min(map(abs, turned)) > 1e-3
    sums = [u + 0.01 + rate for u, rate in zip(laws, turned, strict=True)]
    assert both.gimbal_rates == pytest.approx(sums, rel=1e-12)
    of_both, of_turning = (known(each) for each in (both, alone))
    assert of_both == of_turning._replace(tilt=0.1, bias=0.2)
    assert abs(of_both.acceleration) > 0.1


def test_every_stage_moves_its_own_actuators() -> None:
    controller = first_tick(Walk(servos=(7, 3)), Walk(servos=(5,)))
    assert controller.setpoints == ([7, 3, 5], [7.0, 3.0, 5.0])
    with pytest.raises(InputError, match="two stages between the axes move the same actuator"):
        first_tick(Walk(servos=(7, 3)), Walk(servos=(3,)))


class Track(Disturbance):
    actuators = (3,)

    def at(self, step: int, steps: int) -> Outside:
        return Outside()


def test_a_track_and_a_stage_do_not_move_the_same_actuator() -> None:
    for moved in (5, 3):
        controller = first_tick(Walk(servos=(moved,)))
        arguments = OneWorld(TWO_AXES.plant), controller, 100, [Track()], 1.0
        if moved == 5:
            ControlLoop(*arguments)
            continue
        with pytest.raises(InputError, match="actuator 3: is moved by a stage between the axes and from outside"):
            ControlLoop(*arguments)
