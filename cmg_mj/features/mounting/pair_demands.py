"""Demands of a pair on the robot that carries it: weight, servos, power of the wheels."""

from __future__ import annotations

from typing import NamedTuple

from cmg_mj.plant.plant import Plant

SPIN_UP_S = 60.0
"""Time in which the wheels come up to speed [s]."""
BEARINGS = 2
"""Bearings of a wheel."""
FRICTION = 0.0015
"""Coefficient of friction of deep groove ball bearings without contact seals: M = 0.5 mu P d, for loads P of about a
tenth of the rating C and good lubrication. SKF, catalogue Rolling bearings, chapter Friction, "Estimating the
frictional moment", table 1."""
BORE_M, RATING_N = 0.008, 3300.0
"""Bore d and dynamic load rating C of a 608 (makers give 3.3 to 3.45 kN), which fits the shaft of a wheel of the
papers' size. That its load, the preload, is a tenth of C is an assumption too. A module of scale s has bearings of s
times the bore and s^2 times the rating."""


class PairDemands(NamedTuple):
    """Demands of a pair on its robot."""

    mass_kg: float
    """Mass of the modules."""
    robot_mass_kg: float
    """Mass of the robot without them."""
    servo_torque_n_m: float
    """Largest torque that a gimbal servo has."""
    servo_rate_rad_s: float
    """Largest rate that the gimbals are commanded."""
    spin_up_energy_j: float
    """Energy of the wheels at their speed, J w^2/2 each."""
    holding_power_w: float
    """Power that keeps the wheels turning: assumed friction of their bearings, since the model's have none; no drag of
    the air."""

    @property
    def spin_up_power_w(self) -> float:
        """Mean power of a spin-up in a minute, against inertia alone."""
        return self.spin_up_energy_j / SPIN_UP_S

    def figures(self) -> dict[str, float]:
        """Return the figures by name."""
        return {
            "pair_mass_kg": self.mass_kg,
            "robot_mass_kg": self.robot_mass_kg,
            "servo_limit_torque_n_m": self.servo_torque_n_m,
            "servo_limit_rate_rad_s": self.servo_rate_rad_s,
            "wheels_energy_j": self.spin_up_energy_j,
            "wheels_spin_up_power_w": self.spin_up_power_w,
            "wheels_holding_power_assumed_w": self.holding_power_w,
        }


def pair_demands(plant: Plant, rate_limit: float, scale: float) -> PairDemands:
    """Read the demands of a pair off its plant.

    Args:
        plant: The robot, as the pair's axis sees it.
        rate_limit: Largest rate that the law commands [rad/s].
        scale: Scale of the modules' lengths.

    Returns:
        The demands.
    """
    model, modules = plant.model, plant.axis.modules
    mass = sum(float(model.body_subtreemass[model.body(f"{module.name}/half").id]) for module in modules)
    robot = float(model.body_subtreemass[model.body_rootid[plant.axis.frame]]) - mass
    speeds = [abs(module.speed) for module in modules]
    moment = BEARINGS * 0.5 * FRICTION * 0.1 * RATING_N * BORE_M * scale**3
    return PairDemands(
        mass,
        robot,
        min(float(model.actuator_forcerange[module.servo, 1]) for module in modules),
        rate_limit,
        sum(0.5 * plant.axis.reduced.J_d * speed**2 for speed in speeds),
        sum(moment * speed for speed in speeds),
    )
