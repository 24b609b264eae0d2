"""The rig: a compiled model with its names resolved once, and the reduced model's parameters read off it."""

from __future__ import annotations

import copy
import math
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from pydantic import ValidationError

from cmg_mj.accelerometer import Accelerometer
from cmg_mj.backlash import ARCMIN_A_DEGREE
from cmg_mj.complaint import complaint
from cmg_mj.controller import CONTROLLER_OPTIONS, Controller
from cmg_mj.elementwise import Scalar
from cmg_mj.engine import control_callback, quiet
from cmg_mj.errors import InputError, nearest
from cmg_mj.grid import fitting_step
from cmg_mj.ideal import Ideal
from cmg_mj.known_rigs import RigFacts
from cmg_mj.law import Law
from cmg_mj.mjcf import compile_model, load_rig, lock_thrust_bearing, parse
from cmg_mj.observers import Observer, make_observer
from cmg_mj.plant_settings import FINEST_STEP_S, PlantSettings
from cmg_mj.processor import Processor, WithProcessor
from cmg_mj.reduced import ReducedModel
from cmg_mj.resources import find
from cmg_mj.rig_check import starts
from cmg_mj.rig_parts import KEYFRAME, Cube
from cmg_mj.sensors import Sensors
from cmg_mj.step_limit import largest_step
from cmg_mj.tilt import RadialTilt
from cmg_mj.variations import at_speed, place_accelerometers, vary

QUARTER_TURN = math.pi / 2.0


class Plant:
    """A compiled rig with its names resolved.

    Attributes:
        settings: What it was made from.
        model: The compiled model, without what is only seen. Do not change it: the plant may be shared.
        reduced: Parameters of the reduced model, read off the file as it is but for the flywheels' speed, which
            the controller knows: without bias or friction, which it does not.
        hints: What on the model is not what the reduced model takes it for, in clauses.
        cubes: Addresses of the modules.
        tilt: Address of q_b in qpos and qvel.
        yaw: Address of q_a, or None if the thrust bearing is locked.
        largest_step: The largest physics step that is accurate enough [s].
        tilt_zero: q_b at which the radial line is upright [rad].
        bias: e [rad].
        backlash: Between the servos' motors and the gimbals [rad].
        radial_tilt: The tilt estimate for this rig's accelerometers.
    """

    def __init__(self, settings: PlantSettings, path: Path, period_s: float | None = None) -> None:
        self.path = path
        self.model, self.hints = load_rig(path, lock=settings.lock_thrust_bearing)
        self._as_filed = self.model
        self._resolve()
        self._cubes_as_filed, self._reduced_as_filed = self.cubes, self._read_reduced()
        self._take(settings, period_s)

    def changed(self, settings: PlantSettings, period_s: float | None = None) -> Plant:
        """The same rig with other settings, without compiling its file again.

        Args:
            settings: They name the same model file, and take the thrust bearing alike.
            period_s: Where they leave the physics step open, what whole steps must fill [s].

        Returns:
            Another plant.

        Raises:
            InputError: With these settings the physics fails.
        """
        other = copy.copy(self)
        other.__dict__.pop("drawn_model", None)
        other._take(settings, period_s)
        return other

    def _take(self, settings: PlantSettings, period_s: float | None) -> None:
        """Change the model as the settings say, and fit the physics step."""
        self.settings = settings
        self.bias = math.radians(settings.equilibrium_bias_deg)
        self.backlash = math.radians(settings.gimbal_backlash_arcmin / ARCMIN_A_DEGREE)
        self.model = copy.copy(self._as_filed)
        self.cubes, self.reduced = self._cubes_as_filed, self._reduced_as_filed
        if settings.flywheel_speed_rad_s is not None:
            self.cubes = at_speed(self.model, self.key, self.cubes, settings.flywheel_speed_rad_s, self.path)
            self.reduced = self._read_reduced()
        self.radial_tilt = place_accelerometers(self.model, settings, self._tilt_as_filed, self.path)
        own = float(self.model.opt.timestep)
        vary(
            self.model,
            settings,
            self.path,
            tilt=self.tilt,
            cubes=self.cubes,
        )
        shaken = max(abs(cube.speed) for cube in self.cubes) if settings.flywheel_imbalance_kg_m else 0.0
        self.largest_step = largest_step(self.model, self.key, own, shaken)
        if settings.timestep_s is None and self.largest_step < FINEST_STEP_S:
            raise InputError(
                f"{self._blamed}: so stiff a rig needs physics steps of {self.largest_step:.2g} s, below "
                f"{FINEST_STEP_S:g} s; soften it, or set plant.timestep_s"
            )
        self.model.opt.timestep = fitting_step(settings, self.largest_step, period_s)
        if not starts(self.model, self.new_data()):
            raise InputError(
                f"{self._blamed}: the physics fails in its first steps of {self.timestep:g} s; masses, friction, "
                "damping and servos must be of sizes that go together"
            )

    @property
    def _blamed(self) -> str:
        """What is wrong if the physics is: the settings that change it, if there are, or else the file."""
        changes = [f"plant.{name} = {value:g}" for name, value in self.settings.changes_of_physics().items()]
        return ", ".join(changes) or str(self.path)

    @cached_property
    def drawn_model(self) -> mujoco.MjModel:
        """The model with all that is only seen: the same bodies and joints, and geoms that physics does without."""
        with control_callback(None), quiet():  # compiling a model runs it
            spec = parse(self.path)
            if self.settings.lock_thrust_bearing:
                lock_thrust_bearing(spec, self.path)
            model = compile_model(spec, self.path)
        place_accelerometers(model, self.settings, self._tilt_as_filed, self.path)
        return model

    # --- names ---------------------------------------------------------------------------------------------

    def _resolve(self) -> None:
        model = self.model
        names = [model.joint(i).name for i in range(model.njnt)]
        self.tilt = self._id("joint", "tilt")
        self.yaw = names.index("yaw") if "yaw" in names else None
        self.key = self._id("key", KEYFRAME)
        self.tilt_zero = float(model.key_qpos[self.key, self.tilt])
        prefixes = [name.removesuffix("/gimbal") for name in names if name.endswith("/gimbal")]
        self.frame = int(model.jnt_bodyid[self.tilt])
        self._accelerometers = [self._accelerometer(f"accelerometer_{which}") for which in ("inner", "outer")]
        self._tilt_as_filed = RadialTilt(*(radius for _, radius in self._accelerometers))
        self._gyro = int(model.sensor_adr[self._id("sensor", "fog")]) + 1  # its y axis
        self.cubes = tuple(self._cube(prefix) for prefix in prefixes)
        self.servos = [cube.servo for cube in self.cubes]
        self.directions = [cube.direction for cube in self.cubes]
        self._shares = [cube.direction / len(self.cubes) for cube in self.cubes]
        self._encoders = [int(model.sensor_adr[self._id("sensor", f"{name}/gimbal_encoder")]) for name in prefixes]
        self._specific_forces = [address + axis for address, _ in self._accelerometers for axis in (0, 2)]

    def _id(self, kind: str, name: str) -> int:
        """Address of an element that `rig_parts.lacks` has found."""
        return int(mujoco.mj_name2id(self.model, getattr(mujoco.mjtObj, f"mjOBJ_{kind.upper()}"), name))

    def _accelerometer(self, name: str) -> tuple[int, float]:
        """Address in sensordata, and distance of the site from the tilt axis."""
        model = self.model
        sensor = self._id("sensor", name)
        x, _, z = model.site_pos[model.sensor_objid[sensor]] - model.jnt_pos[self.tilt]
        return int(model.sensor_adr[sensor]), float(math.hypot(x, z))

    def _cube(self, prefix: str) -> Cube:
        model = self.model
        gimbal = self._id("joint", f"{prefix}/gimbal")
        flywheel = self._id("joint", f"{prefix}/flywheel")
        servo = self._id("actuator", f"{prefix}/gimbal_servo")
        motor = self._id("actuator", f"{prefix}/flywheel_motor")
        zero = float(model.key_qpos[self.key, gimbal])
        speed = float(model.key_ctrl[self.key, motor])
        # A quarter turn back, the flywheel's momentum lies along the tilt axis; u > 0 turns it away from there.
        inertia = self._mass_matrix({gimbal: zero - QUARTER_TURN})
        direction = math.copysign(1.0, inertia[self.tilt, flywheel] * speed)
        return Cube(prefix, gimbal, flywheel, servo, motor, direction, zero, speed)

    # --- the reduced model ---------------------------------------------------------------------------------

    def _mass_matrix(self, angles: dict[int, float]) -> np.ndarray:
        """Mass matrix at the keyframe with some joint angles replaced, (nv, nv)."""
        model = self._as_filed
        data = mujoco.MjData(model)
        mujoco.mj_resetDataKeyframe(model, data, self.key)
        for joint, angle in angles.items():
            data.qpos[joint] = angle
        mujoco.mj_forward(model, data)
        dense = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, dense)
        return dense

    def _read_reduced(self) -> ReducedModel:
        """Read J1, J2, J_d, omega_d and m g l/sqrt(2) off the model's inertia and gravity, a share per cube."""
        n = len(self.cubes)
        upright = self._mass_matrix({})
        turned = self._mass_matrix({c.gimbal: c.gimbal_zero - c.direction * QUARTER_TURN for c in self.cubes})
        J1 = upright[self.tilt, self.tilt] / n
        J2 = turned[self.tilt, self.tilt] / n - J1
        J_d = sum(abs(turned[self.tilt, c.flywheel]) for c in self.cubes) / n
        momentum = sum(turned[self.tilt, c.flywheel] * c.speed for c in self.cubes)
        model = self._as_filed
        data = mujoco.MjData(model)
        mujoco.mj_resetDataKeyframe(model, data, self.key)
        data.qvel[:] = 0.0
        data.qpos[self.tilt] = self.tilt_zero + QUARTER_TURN
        mujoco.mj_forward(model, data)
        gravity_torque = -data.qfrc_bias[self.tilt] / n
        return ReducedModel(float(J1), float(J2), float(J_d), float(momentum / (n * J_d)), float(gravity_torque), n)

    # --- running -------------------------------------------------------------------------------------------

    def controller(
        self,
        observer: Observer | str = "homogeneous",
        *,
        law: Law | None = None,
        sensors: Sensors | None = None,
        tilt: RadialTilt | None = None,
        backlash: Scalar | None = None,
        processor: Processor | None = None,
        **options: Any,
    ) -> Controller:
        """A fresh controller for this rig.

        Args:
            observer: An observer, or its name (or package.module:Class).
            law: The law; by default Table 2's gains at 200 Hz.
            sensors: The sensors; by default those of the datasheets.
            tilt: The tilt estimate; by default that for this rig's accelerometers.
            backlash: Between the servos' motors and the gimbals; by default this rig's [rad].
            processor: What takes the decisions in the controller's place, if anything does.
            **options: Options of `Controller`, such as seed, feedback and companions; whatever else is given is a
                parameter of the observer, if that is given by name.

        Returns:
            The controller.

        Raises:
            InputError: The observer does not exist or refuses a parameter, or a rate does not fit the physics step.
        """
        law = law or Law(dt=0.005)
        sensors = sensors or Sensors()
        parameters = {name: options.pop(name) for name in options.keys() - CONTROLLER_OPTIONS}
        if isinstance(observer, str):
            noise = self.facts.noise(sensors)
            observer = make_observer(observer, law.dt, self.reduced, noise, **parameters)
        elif parameters:
            name = next(iter(parameters))
            known = {"law", "sensors", "tilt", "backlash", "processor", *CONTROLLER_OPTIONS}
            raise InputError(f"controller({name}=...): no such option; {nearest(name, known)}")
        make = Controller if processor is None else partial(WithProcessor, processor)
        return make(
            observer,
            law,
            tilt or self.radial_tilt,
            sensors,
            directions=self.directions,
            gimbal_zero=[cube.gimbal_zero for cube in self.cubes],
            timestep=self.model.opt.timestep,
            backlash=self.backlash if backlash is None else backlash,
            **options,
        )

    @property
    def timestep(self) -> float:
        """The physics step [s]."""
        return float(self.model.opt.timestep)

    @property
    def gravity(self) -> float:
        """[m/s^2]."""
        return float(np.linalg.norm(self.model.opt.gravity))

    @property
    def facts(self) -> RigFacts:
        """What a scenario's controller and observers are made from."""
        cubes = tuple(cube.name for cube in self.cubes)
        return RigFacts(
            self.path, cubes, self.reduced, self.radial_tilt, self.gravity, self.largest_step, tuple(self.hints)
        )

    def apparent_bias(self, accelerometer: Accelerometer) -> float:
        """What an observer of the bias should find: e less the tilt that the accelerometers' constant errors make.

        With y1 = x1 - e + offset, the two cannot be told apart.

        Args:
            accelerometer: The sensors of the tilt.

        Returns:
            The bias at the equilibrium [rad].
        """
        return self.bias - self.radial_tilt.offset(-self.bias, accelerometer.constant_errors(), self.gravity)

    def initialise(self, data: mujoco.MjData) -> None:
        """Put data at the scenario's initial state: flywheels at speed, tilted by initial_tilt_deg."""
        mujoco.mj_resetDataKeyframe(self.model, data, self.key)
        data.qpos[self.tilt] = self.tilt_zero - self.bias + math.radians(self.settings.initial_tilt_deg)
        with control_callback(None):  # the first control tick is the first step's
            mujoco.mj_forward(self.model, data)

    def new_data(self) -> mujoco.MjData:
        """Fresh simulation data at the scenario's initial state."""
        data = mujoco.MjData(self.model)
        self.initialise(data)
        return data

    def ideal(self, sensordata: Any, qvel: Any) -> Ideal:
        """What perfect sensors show.

        Args:
            sensordata: MuJoCo's sensor readings after a forward pass, indexed by address: floats, or an array
                (n_numbers, n_worlds).
            qvel: Joint rates, the same way [rad/s].

        Returns:
            The ideal readings, of the elements' own type (float, or array (n_worlds,)).
        """
        if type(sensordata) is list:
            i, j, k, m = self._specific_forces
            forces: Any = (sensordata[i], sensordata[j], sensordata[k], sensordata[m])
        else:
            forces = sensordata[self._specific_forces]
        encoders = [sensordata[address] for address in self._encoders]
        return Ideal(forces, encoders, sensordata[self._gyro], qvel[self.tilt])

    def gimbal_angle(self, qpos: Any) -> Scalar:
        """True x3: the gimbals' mean angle from upright, each in its own direction [rad]."""
        angle = 0.0
        for cube, share in zip(self.cubes, self._shares, strict=True):
            angle = angle + share * (qpos[cube.gimbal] - cube.gimbal_zero)
        return angle

    @cached_property
    def joint_names(self) -> list[str]:
        """Names of the joints in the order of qpos."""
        return [self.model.joint(i).name for i in range(self.model.njnt)]


@quiet()
def load_plant(
    settings: PlantSettings | None = None,
    beside: Path | None = None,
    period_s: float | None = None,
    **fields: object,
) -> Plant:
    """Load a rig.

    Args:
        settings: Its settings; or give them as keyword arguments.
        beside: A folder that a relative model path may start from.
        period_s: Where the settings leave the physics step open, what whole steps must fill, say a control period [s].
        **fields: Fields of `PlantSettings`.

    Returns:
        The compiled plant.

    Raises:
        InputError: A field is unknown or not allowed; the file does not exist, does not compile, or lacks a joint,
            actuator, sensor or keyframe.
    """
    if settings is None:
        try:
            settings = PlantSettings(**fields)  # type: ignore[arg-type]
        except ValidationError as error:
            raise InputError(f"plant.{complaint(PlantSettings, error.errors()[0], fields)}") from error
    with control_callback(None):  # compiling a model runs it
        return Plant(settings, find("models", settings.model, ".xml", "plant.model =", beside), period_s)
