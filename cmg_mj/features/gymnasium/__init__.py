"""The rig as a Gymnasium environment: whatever decides on the gimbals' rate sees what a real rig's sensors show.

Importing this module registers `cmg_mj/ScissoredPair-v0`.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import Any, Literal

import mujoco
import numpy as np

from cmg_mj.core.axis import passed
from cmg_mj.core.errors import InputError, nearest
from cmg_mj.core.loop import ControlLoop
from cmg_mj.core.noise import Normals
from cmg_mj.core.sensor import SensorState, Site, whole_steps
from cmg_mj.plant.mjcf import posed, quiet
from cmg_mj.plant.physics import OneWorld
from cmg_mj.results.baselines import MEMS_GYRO
from cmg_mj.runs.disturbances import disturbances, outsides
from cmg_mj.runs.experiment import Experiment, prepare
from cmg_mj.scenario.loading import load_scenario
from cmg_mj.scenario.schema import Scenario

try:
    import gymnasium
except ModuleNotFoundError as error:
    raise InputError('environment: gymnasium is not installed: python -m pip install "cmg_mj[gymnasium]"') from error

ID = "cmg_mj/ScissoredPair-v0"
READINGS = ("mems_gyro", "acceleration", "fog")
"""Readings that can be observed beside y1 and y2."""
STATE_COST = (100.0, 1.0, 1.0)
"""Weights of x1, x2, x3 in the reward; that of u is 1."""
MAX_READING = 1e6
"""No reading is larger."""
SIZE = (480, 640)
"""Height and width of a picture [pixels]."""
VIEW = (132.0, -18.0)
"""Camera of a picture: azimuth and elevation [deg]."""


class ScissoredPairEnv(gymnasium.Env):
    """A scenario's rig with its sensors, pushes and noise; the agent takes the observer's and the law's place.

    - **Action** (1,): the gimbal rate, held for a control period, in shares of its limit; [rad/s] with `in_rad_s`.
    - **Observation** (2 + readings,): y1 [rad], y2 [rad], then the readings asked for: `mems_gyro` the cheap gyro
      [rad/s], `acceleration` what two accelerometers say of the angular acceleration [rad/s^2], `fog` the fibre-optic
      gyro [rad/s].
    - **Reward**: -(100 x1^2 + x2^2 + x3^2 + u^2) dt of the true state at the tick and of the action taken there. At a
      fall that of the fallen state is taken at once for all the time that is left: falling early never pays.
    - **End**: terminated by the fall (or a divergence), truncated by the scenario's duration.
    - **Info**: `time_s`, the true state `x1_rad`, `x2_rad_s`, `x3_rad`, and `readings`, what `Controller.decide` takes.

    Seed s is that of `cmg-mj run --seed s`. A reset without one goes on to the seed's next world (`--world`).

    Args:
        scenario: A bundled one's name, a TOML file, or a scenario.
        settings: As with --set, such as "plant.initial_tilt_deg=2.0".
        readings: Which are observed beside y1 and y2.
        in_rad_s: Whether the action is the rate itself.
        render_mode: `rgb_array`, or None.

    Raises:
        InputError: One of them is not allowed.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 200}  # noqa: RUF012  (as Gymnasium has it)

    def __init__(
        self,
        scenario: str | Scenario = "push_recovery",
        settings: Sequence[str] = (),
        readings: Sequence[str] = (),
        in_rad_s: bool = False,
        render_mode: Literal["rgb_array"] | None = None,
    ) -> None:
        if render_mode not in (None, "rgb_array"):
            raise InputError(f"render_mode={render_mode!r}: must be 'rgb_array' or None")
        for name in readings:
            if name not in READINGS:
                raise InputError(f"readings: {name!r}: no such reading; {nearest(name, READINGS)}")
        if isinstance(scenario, str):
            scenario = load_scenario(scenario, settings)
        self.experiment = self._base = prepare(scenario)
        self.render_mode = render_mode
        self.metadata = {**type(self).metadata, "render_fps": round(1.0 / self.experiment.law.dt)}
        self._readings = tuple(readings)
        self._seed: int | None = None
        self._world = 0
        self._renderer: mujoco.Renderer | None = None
        self._running = False
        limit = self.experiment.law.rate_limit
        self._unit = 1.0 if in_rad_s else limit
        most = limit if in_rad_s else 1.0
        self.action_space = gymnasium.spaces.Box(-most, most, (1,), np.float64)
        bounds = np.array([math.pi, *[MAX_READING] * (1 + len(self._readings))])
        self.observation_space = gymnasium.spaces.Box(-bounds, bounds, dtype=np.float64)

    def __getstate__(self) -> dict[str, Any]:
        """Return what is copied and pickled, in the middle of an episode too: all but what draws."""
        return {**self.__dict__, "_renderer": None}

    @quiet()
    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Begin an episode.

        Args:
            seed: Of the sensors' noise.
            options: `world`: which of the seed; `settings`: field -> value for this episode, such as
                {"plant.equilibrium_bias_deg": 1.0}.

        Returns:
            The observation and the info at the first control tick.

        Raises:
            InputError: An option is not allowed.
        """
        super().reset(seed=seed)
        options = dict(options or {})
        world, changed = options.pop("world", None), options.pop("settings", {})
        if options:
            name = next(iter(options))
            raise InputError(f"reset: {name!r}: no such option; {nearest(name, ('world', 'settings'))}")
        if seed is not None or self._seed is None:
            self._seed = int(self.np_random.integers(2**63)) if seed is None else seed
            self._world = 0
        else:
            self._world += 1
        if world is not None:
            if not isinstance(world, int) or world < 0:
                raise InputError(f"reset: world = {world!r}: must be a whole number, 0 or more")
            self._world = world
        experiment, law = self._base.with_settings(changed) if changed else self._base, self._base.law
        if (experiment.law.dt, experiment.law.rate_limit) != (law.dt, law.rate_limit):
            raise InputError("reset: settings: the control rate and the gimbals' limit stay those of the environment")
        self._start(experiment, self._seed)
        return self._observed()

    def _start(self, experiment: Experiment, seed: int) -> None:
        self.experiment, part = experiment, experiment.require_single_axis("an environment")
        scenario = part.scenario.model_copy(update={"seed": seed, "open_loop_observers": []})
        plant, timestep = experiment.plant, experiment.plant.timestep
        acting = disturbances(outsides(scenario), [plant], seed, self._world)
        for one in acting:
            (plant,) = one.placed([plant])
        self._physics = OneWorld(plant)
        self._controller = dataclasses.replace(part.design, scenario=scenario).controller(
            part.plant.interface, world_ids=self._world
        )
        (self._axis,) = self._controller.axes
        self._servos = tuple(stage.init(0.0) for stage in self._axis.servos)
        calibrated = dataclasses.replace(scenario.sensors.mems_gyro, reading="calibrated")
        self._gyro = calibrated.at_work(Site("sensors.mems_gyro", timestep), experiment.law.dt)
        self._noise = {n: Normals(seed, self._world, n, width) for n, width in self._gyro.draws.items()}
        self._gyro_state: SensorState | None = None
        self._fall = np.radians(scenario.metrics.fall_angle_deg).item()
        self._steps = whole_steps(scenario.duration_s, timestep, "duration_s", f"{scenario.duration_s:g} s")
        self._loop = ControlLoop(self._physics, self._controller, self._steps, acting, self._fall)
        self._running = True
        self._to_tick()

    def _to_tick(self) -> Literal["tick", "end", "fall"]:
        """Go on to the next control tick, where the agent decides."""
        loop, how = self._loop, "tick"
        if loop.next_tick() is None:
            if not self._physics.any_running:
                return "fall"
            how = "end"
            loop.step = self._steps
            loop.readings = self._physics.reading(self._physics.state()[1])
        self._controller.sample(loop.step, loop.readings)
        if self._gyro_state is None:
            self._gyro_state = self._gyro.init(loop.readings, self._noise)
        else:
            self._gyro_state = self._gyro.sample(self._gyro_state, loop.step, loop.readings, self._noise)
        return how

    @quiet()
    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """Hold a gimbal rate for a control period.

        Args:
            action: (1,), in the action space; what exceeds it is limited.

        Returns:
            Observation, reward, terminated, truncated, info.

        Raises:
            InputError: The action is not one finite number, or the episode has ended.
        """
        if not self._running:
            raise InputError("step: the episode has ended, or has not begun: call reset() first")
        values = np.asarray(action, dtype=float).ravel()
        if values.size != 1 or not np.isfinite(values[0]):
            raise InputError(f"step: the action must be one finite number, not {action!r}")
        limit = self.experiment.law.rate_limit
        u = min(max(float(values[0]) * self._unit, -limit), limit)
        cost = self._cost(u)
        self._servos, rate = passed(self._axis.servos, self._servos, u)
        self._physics.command(rate)
        self._loop.advance()
        how = self._to_tick()
        self._running = how == "tick"
        if how == "fall":
            cost += self._cost(0.0) * (self._steps - self._loop.step) / self._controller.period
        observation, info = self._observed()
        return observation, -cost, how == "fall", how == "end", info

    def _state(self) -> tuple[float, float, float]:
        """True x; at a divergence what a rig that lies still has."""
        plant = self.experiment.plant
        q, v = self._physics.state()
        x1 = plant.axis.line.lean(q) + plant.bias
        x = (x1, plant.axis.line.rate(v), plant.axis.gimbal_angle(q))
        return x if all(abs(value) < MAX_READING for value in x) else (self._fall, 0.0, 0.0)

    def _cost(self, u: float) -> float:
        squares = [weight * x * x for weight, x in zip(STATE_COST, self._state(), strict=True)]
        return (sum(squares) + u * u) * self.experiment.law.dt

    def _observed(self) -> tuple[np.ndarray, dict[str, Any]]:
        step, axis = self._loop.step, self._axis
        delivered = axis.delivered(self._controller.state.sampled[0], step)
        measured = axis.measure(delivered)
        x1, x2, x3 = self._state()
        assert self._gyro_state is not None
        (gyro,) = self._gyro.read(self._gyro_state, step)
        extra = {MEMS_GYRO: gyro, "acceleration": measured.acceleration, "fog": delivered.fog}
        y = [*measured, *(extra[name] for name in self._readings)]
        high = self.observation_space.high  # pyright: ignore[reportAttributeAccessIssue]
        observation = np.clip(np.array(y, dtype=np.float64), -high, high)
        forces, encoders, fog, own_gyro = delivered
        needed = [own_gyro] if axis.reads_gyro else []
        info = {
            "time_s": step * axis.timestep,
            "x1_rad": x1,
            "x2_rad_s": x2,
            "x3_rad": x3,
            "readings": (step, tuple(forces), tuple(encoders), fog, x2, *needed),
        }
        return observation, info

    def render(self) -> np.ndarray | None:
        """Return a picture of the rig, (480, 640, 3); None without a render mode. MUJOCO_GL names what draws it."""
        if self.render_mode is None:
            return None
        model = self.experiment.plant.drawn_model
        renderer = self._renderer
        if renderer is None or renderer.model is not model:
            self.close()
            renderer = self._renderer = mujoco.Renderer(model, *SIZE)
        camera = mujoco.MjvCamera()
        mujoco.mjv_defaultFreeCamera(model, camera)
        camera.azimuth, camera.elevation = VIEW
        renderer.update_scene(posed(model, self._physics.data.qpos), camera)
        return renderer.render()

    def close(self) -> None:
        """Give the renderer back; may be called again."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None


gymnasium.register(id=ID, entry_point="cmg_mj.features.gymnasium:ScissoredPairEnv")
