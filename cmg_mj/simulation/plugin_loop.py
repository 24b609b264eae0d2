"""The loop of a run in which an engine plugin controls the rig: MuJoCo decides, the loop records."""

from __future__ import annotations

import mujoco

from cmg_mj.core.controller import Controller
from cmg_mj.core.loop import ControlLoop
from cmg_mj.core.runners import as_estimate
from cmg_mj.errors import RunStopped
from cmg_mj.plant.plugin_model import INSTANCE
from cmg_mj.plant.plugin_state import FAILED, STATUS, instance_states
from cmg_mj.simulation.physics import OneWorld


class PluginLoop(ControlLoop):
    """The loop of a run in which a plugin in the plant's model decides.

    The Python controller is led along the plugin's decisions, for what the plugin does not have: the gyro's readings
    and the open-loop observers.
    """

    def decide(self) -> None:
        """Record the plugin's decision, which it takes in every forward pass."""
        assert isinstance(self.physics, OneWorld)
        model, data = self.physics.model, self.physics.data
        if any(state[STATUS] == FAILED for state in instance_states(model, data)):
            raise RunStopped(f"the plugin has stopped at t = {data.time:g} s")
        self.controller.control(self.step)
        for name, part in zip(self.physics.axis_names, self.controller.parts, strict=True):
            _take_over(part, data, "/".join(filter(None, (INSTANCE, name))))


def _take_over(part: Controller, data: mujoco.MjData, prefix: str) -> None:
    """Give a controller's last tick the plugin's numbers."""
    assert part.tick is not None

    def shown(quantity: str) -> list[float]:
        return data.sensor(f"{prefix}/{quantity}").data.tolist()

    (y1,), (y2,), (acceleration,) = shown("tilt"), shown("gimbal_angle"), shown("acceleration")
    (u,), (x_e,) = shown("command"), shown("integrator")
    estimates = [as_estimate(shown("estimate")), *part.tick.estimates[1:]]
    part.tick = part.tick._replace(y1=y1, y2=y2, acceleration=acceleration, u=u, x_e=x_e, estimates=estimates)
