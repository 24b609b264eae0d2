"""Settings of the plant in a scenario: the rig, and its differences from its model file. Checked without MuJoCo."""

from __future__ import annotations

import dataclasses
from typing import Annotated, Literal

from pydantic import Field
from pydantic.dataclasses import dataclass

from cmg_mj.inputs.types import STRICT, Batched, NonNegative, PerAxis, Positive

MIN_STEP_S = 1e-6
"""The smallest physics step [s]."""
Integrator = Literal["RK4", "Euler", "implicit", "implicitfast", "discrete"]
NEEDS_COMPILING = ("model", "lock_thrust_bearing", "locked_axes")
"""Settings on which it depends what is compiled; the others change the compiled model."""

Loss = Annotated[NonNegative | None, Batched()]
"""An armature, a friction or a damping that may replace the model's."""
Tilt = Annotated[float, Field(gt=-45.0, lt=45.0), Batched(), PerAxis()]
Place = Annotated[float, Field(ge=-10.0, le=10.0)]
"""Millimetres taken as metres are larger [m]."""
Distance = Annotated[Place | None, Batched(), PerAxis()]
Across = Annotated[Place | None, PerAxis()]
Turn = Annotated[Annotated[float, Field(gt=-360.0, lt=360.0)] | None, PerAxis()]
Misplaced = Annotated[float, Batched(), PerAxis()]


@dataclass(frozen=True, config=STRICT)
class PlantSettings:
    """The rig, and its differences from its model file. The file decides where a field is not set.

    Attributes:
        model: Model file in MJCF: the name of a bundled one, or a path.
        equilibrium_bias_deg: Equilibrium bias e: the mass centre is turned about the pivot by this angle, so that the
            rig does not balance where its sensors show upright [deg].
        initial_tilt_deg: Tilt at the start, measured from the true equilibrium [deg].
        timestep_s: Physics step [s]. Without it, the step is the largest that the model file, the sampling, the pushes
            and the rig's fastest motion allow.
        integrator: MuJoCo's integrator. Fast flywheels need RK4.
        lock_thrust_bearing: Remove the joint that lets the rig turn about the vertical.
        locked_axes: Names of axes whose hinges are removed. Their flywheels turn; their gimbals are held.
        turn_rate_rad_s: Rate at which the rig turns about the vertical, held by its `yaw_servo` [rad/s].
        gimbal_armature_kg_m2: Inertia of each gimbal's gearbox, reflected to the gimbal [kg m^2].
        gimbal_friction_n_m: Dry friction of each gimbal [N m].
        gimbal_damping_n_m_s: Viscous friction of each gimbal [N m s/rad].
        gimbal_backlash_arcmin: Backlash between each gimbal and its servo's motor [arcmin].
        servo_stiffness_n_m_rad: Stiffness of each gimbal servo's position loop [N m/rad].
        servo_damping_n_m_s_rad: Damping of each gimbal servo's position loop [N m s/rad].
        accelerometer_inner_m: Distance of the inner accelerometer from the tilt axis along the radial line, which the
            tilt estimate uses [m].
        accelerometer_outer_m: Distance of the outer accelerometer from the tilt axis along the radial line, which the
            tilt estimate uses [m].
        accelerometer_inner_across_m: Distance of the inner accelerometer from the radial line, on the side that a
            growing tilt leans to, which the tilt estimate uses [m].
        accelerometer_outer_across_m: The same of the outer accelerometer [m].
        accelerometer_inner_angle_deg: Angle of the inner accelerometer's axes in the tilting plane, from across to up,
            which the tilt estimate uses [deg].
        accelerometer_outer_angle_deg: The same of the outer accelerometer [deg].
        accelerometer_inner_misplaced_mm: True distance of the inner accelerometer less the distance that the tilt
            estimate uses [mm].
        accelerometer_outer_misplaced_mm: True distance of the outer accelerometer less the distance that the tilt
            estimate uses [mm].
        pivot_slides: The body below the tilt joint slides freely, as a light cart does. The tilt estimate then counts
            the accelerometers' distances from the common mass centre instead of the pivot.
        tilt_friction_n_m: Dry friction of the tilt joint [N m].
        tilt_damping_n_m_s: Viscous friction of the tilt joint [N m s/rad].
        tilt_inertia_kg_m2: Inertia about the tilt axis, the gimbals upright, which the controller knows: the frame gets
            more or less of it [kg m^2].
        tilt_gravity_n_m: Torque of gravity at a tilt of 90 deg, which the controller knows: the frame's mass centre is
            shifted along the radial line [N m].
        flywheel_momentum_n_m_s: Momentum of an axis' flywheels together, which sets their speed [N m s].
        flywheel_speed_rad_s: Speed of all flywheels, each in its own direction, which the controller uses [rad/s].
        flywheel_imbalance_kg_m: Static imbalance of each flywheel: its mass times the offset of its mass centre [kg m].
    """

    model: str = "scissored_pair.xml"
    equilibrium_bias_deg: Tilt = 0.5
    initial_tilt_deg: Tilt = 1.0
    timestep_s: Annotated[float, Field(ge=MIN_STEP_S, le=0.1)] | None = None
    integrator: Integrator = "RK4"
    lock_thrust_bearing: bool = False
    locked_axes: tuple[str, ...] = ()
    turn_rate_rad_s: float = 0.0
    gimbal_armature_kg_m2: Loss = None
    gimbal_friction_n_m: Loss = None
    gimbal_damping_n_m_s: Loss = None
    gimbal_backlash_arcmin: Annotated[float, Field(ge=0.0, lt=5400.0), Batched()] = 0.0
    servo_stiffness_n_m_rad: Annotated[Positive | None, Batched()] = None
    servo_damping_n_m_s_rad: Loss = None
    accelerometer_inner_m: Distance = None
    accelerometer_outer_m: Distance = None
    accelerometer_inner_across_m: Across = None
    accelerometer_outer_across_m: Across = None
    accelerometer_inner_angle_deg: Turn = None
    accelerometer_outer_angle_deg: Turn = None
    accelerometer_inner_misplaced_mm: Misplaced = 0.0
    accelerometer_outer_misplaced_mm: Misplaced = 0.0
    pivot_slides: Annotated[bool, PerAxis()] = False
    tilt_friction_n_m: Loss = None
    tilt_damping_n_m_s: Loss = None
    tilt_inertia_kg_m2: Positive | None = None
    tilt_gravity_n_m: Positive | None = None
    flywheel_momentum_n_m_s: Positive | None = None
    flywheel_speed_rad_s: Positive | None = None
    flywheel_imbalance_kg_m: Annotated[float, Batched()] = 0.0

    def changes(self) -> dict[str, float]:
        """Return the changed numbers of gimbals, servos, accelerometers, tilt and flywheels: field -> value."""
        prefixes = ("gimbal", "servo", "accelerometer", "tilt", "flywheel")
        fields = [field for field in dataclasses.fields(self) if field.name.startswith(prefixes)]
        return {field.name: value for field in fields if (value := getattr(self, field.name)) != field.default}

    def changes_of_physics(self) -> dict[str, float]:
        """Return those of the `changes` that move masses or make torques."""
        return {
            name: value
            for name, value in self.changes().items()
            if not name.startswith("accelerometer") and name != "gimbal_backlash_arcmin"
        }

    def compiled_alike(self, other: PlantSettings) -> bool:
        """Return whether the same model is compiled with these settings and others."""
        return all(getattr(self, name) == getattr(other, name) for name in NEEDS_COMPILING)
