"""The rig of sokolov2019 on MuJoCo, with the parameters of Table II and, where asked for, another gimbal servo."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

from cmg_mj.observers import Observer, make_observer
from cmg_mj.papers.sokolov2019.paper import TABLE_II
from cmg_mj.plant.plant import Plant, load_plant
from cmg_mj.runs.experiment import Experiment, prepare
from cmg_mj.scenario.loading import load_scenario
from cmg_mj.scenario.plant_settings import PlantSettings

NO_NOISE = (
    "sensors.accelerometer.noise_density_ug_rthz=0.0",
    "sensors.accelerometer.counts_per_g=0.0",
    "sensors.encoder.counts_per_revolution=0.0",
    "sensors.fog.angle_random_walk_deg_rth=0.0",
)

PUSH_AND_NOISE = {"push": "0.5 N m for 0.1 s", "noise": "400 ug/rtHz"}
"""Data of its experiments that the paper does not give, beside e: the scenario single_gimbal."""

FINE = "plant.timestep_s=0.001"
"""A servo that is slow because of its damping is stiff: it asks for a smaller step than the rig's own."""


class Servo(NamedTuple):
    """A gimbal's position loop; its setpoint is the integral of the commanded rate."""

    kp: float
    """Stiffness [N m/rad]."""
    kv: float
    """Damping [N m s/rad]."""
    inertia: float
    """I_c + I_d [kg m^2]."""

    @property
    def lag_s(self) -> float:
        """Delay of the angle behind a setpoint that moves steadily [s]."""
        return self.kv / self.kp

    def damp(self, lag_s: float) -> Servo:
        """Return a servo as stiff, with another lag: more damping."""
        return self._replace(kv=lag_s * self.kp)

    def soften(self, lag_s: float) -> Servo:
        """Return a critically damped servo with another lag: less stiffness."""
        kp = 4.0 * self.inertia / lag_s**2
        return Servo(kp, lag_s * kp, self.inertia)


def experiment(settings: Sequence[str] = (), observer: str = "homogeneous", feedback: str = "observer") -> Experiment:
    """Prepare the scenario `single_gimbal`, which comes with Table II.

    Args:
        settings: Settings `section.field=value` that differ.
        observer: Observer in the loop.
        feedback: Rate that the law uses: `observer`, `fog` or `truth`.

    Returns:
        The experiment, ready to run.
    """
    return prepare(load_scenario("single_gimbal", [f"controller.feedback={feedback}", *settings], observer))


def estimator(name: str, prepared: Experiment, **changes: Any) -> Observer:
    """Make an observer with Table II's parameters or others, for an experiment's rig and control period."""
    return make_observer(name, prepared.law.dt, prepared.plant.reduced, **TABLE_II[name] | changes)


def read_servo(plant: Plant) -> Servo:
    """Read the gimbal servo off the model file."""
    (servo,) = plant.axis.servos
    (module,) = plant.axis.modules
    dof = plant.model.jnt_dofadr[module.gimbal]
    return Servo(
        float(plant.model.actuator_gainprm[servo, 0]),
        float(-plant.model.actuator_biasprm[servo, 2]),
        float(plant.model.dof_M0[dof]),
    )


def make_rig(settings: PlantSettings, servo: Servo) -> Plant:
    """Load the rig with another servo."""
    return load_plant(replace(settings, servo_stiffness_n_m_rad=servo.kp, servo_damping_n_m_s_rad=servo.kv))
