"""A scenario made ready to run."""

from __future__ import annotations

import dataclasses
import functools
import itertools
import pkgutil
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Unpack

import numpy as np
import tomli_w

from cmg_mj.core.axis import AxisControl
from cmg_mj.core.controller import Controller
from cmg_mj.core.errors import InputError, RunStopped, nearest, shown
from cmg_mj.core.loop import ControlLoop
from cmg_mj.core.rig import AxesStage
from cmg_mj.core.sensor import whole_steps
from cmg_mj.inputs.features import DRIVERS, entries
from cmg_mj.inputs.overrides import assign
from cmg_mj.laws import Law
from cmg_mj.observers import Observer
from cmg_mj.plant.mjcf import quiet
from cmg_mj.plant.physics import ManyWorlds, OneWorld
from cmg_mj.plant.plant import Plant, check_axes, load_scenario_plant
from cmg_mj.plant.tilt_line import HingeLine
from cmg_mj.results.folder import whole_file
from cmg_mj.results.result import Outcome, Result
from cmg_mj.results.summary_keys import combine_axes
from cmg_mj.results.trajectory import Trajectory
from cmg_mj.runs.batch import (
    BatchKey,
    batched,
    batched_open_loop_observers,
    key_parts,
    plant_structure,
    stack_worlds,
)
from cmg_mj.runs.disturbances import Outsides, disturbances, outsides
from cmg_mj.runs.recorder import TickRecorder
from cmg_mj.runs.simulate import SimulationOptions, outcome_of
from cmg_mj.scenario.design import Design, design
from cmg_mj.scenario.resolve import differences, resolved
from cmg_mj.scenario.schema import Scenario, parse_scenario
from cmg_mj.scenario.time_grid import time_grid

if TYPE_CHECKING:
    import control


@dataclasses.dataclass(frozen=True)
class ExperimentAxis:
    """One axis of an experiment.

    Attributes:
        plant: The rig as this axis sees it.
        design: The law and the observers, of the scenario of this axis.
    """

    plant: Plant
    design: Design

    @property
    def scenario(self) -> Scenario:
        """The scenario with what this axis has of its own."""
        return self.design.scenario

    @property
    def name(self) -> str:
        """The axis' name; of a rig's only one it may be empty."""
        return self.plant.axis.name

    @property
    def law(self) -> Law:
        """The control law."""
        return self.design.law

    @property
    def observer_names(self) -> list[str]:
        """The observer in the loop, then the open-loop observers."""
        return [self.scenario.observer.kind, *self.scenario.open_loop_names()]

    def linear_closed_loop(self, plant: Literal["rig", "reduced"] = "rig") -> control.StateSpace:
        """Make the closed loop of this axis a linear system: see `Experiment.linear_closed_loop`."""
        from cmg_mj.linear.loop import linear_closed_loop  # no run needs it

        with self.scenario.named_in_errors():
            return linear_closed_loop(self.design, self.plant, plant)

    @property
    def hints(self) -> list[str]:
        """Clauses on what is no mistake and yet likely to make the plant fall."""
        from cmg_mj.linear.verdict import hints  # no run needs it

        judgements = [judge(self.design, self.plant) for judge in entries("judge").values()]
        return [*hints(self.design, self.plant), *(hint for judged in judgements for hint in judged.hints)]


@dataclasses.dataclass(frozen=True)
class Experiment:
    """A scenario made ready to run: its plant is loaded, everything in it has been constructed once and fits.

    Attributes:
        scenario: What it was made from.
        plant: The rig.
        axes: The axes, one or more.
    """

    scenario: Scenario
    plant: Plant
    axes: tuple[ExperimentAxis, ...]

    @property
    def design(self) -> Design:
        """The law and the observers, of several axes the first one's."""
        return self.axes[0].design

    @property
    def law(self) -> Law:
        """The control law, of several axes the first one's."""
        return self.design.law

    @property
    def observer_title(self) -> str:
        """The observer in the loop; of several axes with observers of their own, each with its axis."""
        kinds = [part.scenario.observer.kind for part in self.axes]
        if len(set(kinds)) == 1:
            return kinds[0]
        return ", ".join(f"{part.name} {kind}" for part, kind in zip(self.axes, kinds, strict=True))

    @property
    def observer_names(self) -> list[str]:
        """The observer in the loop, then the open-loop observers; of several axes the first one's."""
        return self.axes[0].observer_names

    def controller(self, world_ids: int | Sequence[int] = 0, observer: Observer | None = None) -> Controller:
        """Make a fresh controller.

        Args:
            world_ids: The number of one world, or the numbers of many: their noise depends on (seed, number) alone.
            observer: Instead of the scenario's, on all axes.

        Returns:
            The controller.
        """
        controls = self._controls(observer)
        return Controller(controls, self.between(controls), seed=self.scenario.seed, world_ids=world_ids)

    def _controls(self, observer: Observer | None = None) -> list[AxisControl]:
        return [
            part.design.axis_control(part.plant.interface, axis=i, observer=observer)
            for i, part in enumerate(self.axes)
        ]

    def stages(self) -> list[AxesStage]:
        """Make the stages between the axes, to be looked at."""
        return self.between(self._controls())

    def axis_controller(
        self, what: str = "one controller", world_ids: int | Sequence[int] = 0, observer: Observer | None = None
    ) -> Controller:
        """Make a fresh controller of the only axis.

        Args:
            what: The operation that takes one axis, for the message.
            world_ids: The number of one world, or the numbers of many.
            observer: Instead of the scenario's.

        Returns:
            The controller.

        Raises:
            InputError: The plant has several axes.
        """
        self.require_single_axis(what)
        return self.controller(world_ids, observer)

    def between(self, controls: Sequence[AxisControl]) -> list[AxesStage]:
        """Make the stages between the axes, from the controls of the axes; none for a single one."""
        if len(controls) == 1:
            return []
        makers = entries("between").items()
        made = (make(self.scenario.section(name), self.plant, controls) for name, make in makers)
        stages = [stage for stage in made if stage is not None]
        if self.scenario.controller.compensate_turning:
            from cmg_mj.stages.turning import compensation  # most rigs have one axis

            gyro = self.scenario.sensors.mems_gyro.turn_gyro(controls[0].law.dt)
            stages.append(compensation(self.plant.turning, gyro, controls))
        return stages

    def run(self, driver: str = "native", world: int = 0, **options: Unpack[SimulationOptions]) -> Result:
        """Run one world. Options are those of `simulate`.

        Args:
            driver: What calls the controller: `native`, `callback`, or a feature's, such as `board` or `plugin`.
            world: The world's number.
            **options: Those of `simulate`.

        Returns:
            The result.

        Raises:
            InputError: There is no such driver, or it does not take the scenario.
        """
        if driver in ("native", "callback"):
            return self.simulate(self.plant, self.controller(int(world)), driver=driver, **options)
        if driver not in DRIVERS:
            known = nearest(driver, ["native", "callback", *DRIVERS])
            raise InputError(f"driver = {shown(driver)}: no such driver; {known}")
        return pkgutil.resolve_name(DRIVERS[driver])(self, int(world), **options)

    def run_many(
        self,
        worlds: int | Sequence[int],
        plants: Sequence[Plant] | None = None,
        settings: Mapping[str, Sequence[Any] | np.ndarray] | None = None,
        **options: Unpack[SimulationOptions],
    ) -> Result:
        """Run many worlds at once.

        Args:
            worlds: How many, or their numbers: world i has the same noise wherever it stands.
            plants: A plant a world, if they differ.
            settings: The same by settings: a field -> its value in each world, {"equilibrium_bias_deg": [0.0, 0.5],
                "push.0.torque_n_m": [1.0, 2.0]}. Only numbers that worlds of a batch may differ in: see `batch.py`.
            **options: Those of `simulate`.

        Returns:
            The result of all worlds.

        Raises:
            InputError: There is no world, or the plants do not fit the worlds or each other.
        """
        numbers = [int(number) for number in (range(worlds) if isinstance(worlds, int) else worlds)]
        if settings is not None and plants is not None:
            raise InputError("run_many: give plants or settings, not both")
        experiments = [self] * len(numbers) if settings is None else self.with_varied(settings)
        return run_batch(experiments, numbers, plants, **options)

    @functools.cached_property
    def batch_key(self) -> BatchKey:
        """Key that its worlds share with all worlds that may run in one batch with them."""
        prefixes = [f"axes.{part.name}." for part in self.axes] if self._names_axes else [""]
        of_axes = [key_parts(part.scenario, part.design, name) for part, name in zip(self.axes, prefixes, strict=True)]
        return ("the plant's structure", False, plant_structure(self.plant)), *itertools.chain(*of_axes)

    @property
    def _names_axes(self) -> bool:
        """Whether its axes have names that a scenario can use."""
        return len(self.axes) > 1 or bool(self.scenario.axes)

    def with_varied(self, settings: Mapping[str, Sequence[Any] | np.ndarray]) -> list[Experiment]:
        """Return the scenario with other settings in each world; worlds with equal settings share one.

        Args:
            settings: Field -> its value in each world. A field is named as with `--set`; one of [plant] by itself too.

        Returns:
            An experiment a world.

        Raises:
            InputError: There is no such field, a value is not allowed, or the lists differ in length.
        """
        lists = [values.tolist() if isinstance(values, np.ndarray) else values for values in settings.values()]
        are_lists = all(isinstance(values, Sequence) and not isinstance(values, str) for values in lists)
        if not lists or not are_lists or len({len(values) for values in lists}) != 1:
            raise InputError(
                f"settings: {', '.join(settings)}: must be lists of values by field, as many values each, one a world, "
                'such as {"equilibrium_bias_deg": [0.0, 0.5]}'
            )
        of_plant = {field.name for field in dataclasses.fields(self.scenario.plant)}
        for name in settings:
            if "." not in name and name not in (*of_plant, *Scenario.model_fields):
                raise InputError(f"settings: {name!r}: no field of [plant]; {nearest(name, of_plant)}")
        names = [f"plant.{name}" if name in of_plant else name for name in settings]
        rows = [dict(zip(names, row, strict=True)) for row in zip(*lists, strict=True)]
        experiments = {key: self.with_settings(row) for key, row in {repr(row): row for row in rows}.items()}
        return [experiments[repr(row)] for row in rows]

    def with_settings(self, values: Mapping[str, Any]) -> Experiment:
        """Return the experiment with other values of some fields.

        Args:
            values: By field, named as with `--set`.

        Returns:
            Another experiment; a model file that stays the same is not compiled again.

        Raises:
            InputError: There is no such field, or a value is not allowed.
        """
        fields = self.scenario.as_fields()
        for name, value in values.items():
            assign(fields, name, value, f"settings: {name!r}")
        settings = ", ".join(f"{name}={value}" for name, value in values.items())
        return prepare(parse_scenario(fields, f"{self.scenario.source} with {settings}".strip()), like=self.plant)

    @quiet()
    def simulate(
        self,
        plant: Plant | Sequence[Plant],
        controller: Controller,
        outside: Outsides | None = None,
        driver: str = "native",
        loop: type[ControlLoop] = ControlLoop,
        **options: Unpack[SimulationOptions],
    ) -> Result:
        """Run a controller on one rig or several, for the scenario's time and judged by its settings.

        Args:
            plant: The rig; or one a world, which may differ in numbers but not in structure.
            controller: A fresh one, made for one world or for as many as there are rigs.
            outside: What acts from outside, instead of what the scenario has.
            driver: Name of what calls the controller: `native`: the loop, `callback`: MuJoCo (one world only).
            loop: Advances physics and controller, if it is not these two.
            **options: See `SimulationOptions`.

        Returns:
            The outcomes, summaries and the trajectory. Whatever stops a run, what was recorded until then is there.

        Raises:
            InputError: A time or rate does not fit the physics step, or the callback was asked to drive many worlds.
        """
        single = isinstance(plant, Plant)
        plants = [plant] if single else list(plant)
        if driver != "native" and not single:
            raise InputError(f"driver = {driver!r}: drives one world, not a batch")
        settings, keep = self.scenario.metrics, options.get("keep_trajectory", True)
        outside = outsides(self.scenario) if outside is None else outside
        acting = disturbances(outside, plants, controller.seed, controller.world_ids)
        for one in acting:
            plants = list(one.placed(plants))
        timestep, duration_s = plants[0].timestep, self.scenario.duration_s
        steps = whole_steps(duration_s, timestep, "duration_s", f"{duration_s:g} s")
        recorders = {
            name: TickRecorder(
                [rig.single_axis(name) for rig in plants],
                self.axes[i].observer_names,
                controller,
                i,
                outside,
                settings,
                keep=keep,
            )
            for i, name in enumerate(plants[0].axis_names)
        }

        def since(tick: int) -> Trajectory:
            return Trajectory.joined({name: recorder.since(tick) for name, recorder in recorders.items()})

        if on_start := options.get("on_start"):
            on_start(since)
        physics = OneWorld(plants[0]) if single else ManyWorlds(plants, options.get("threads", 0))
        driving: AbstractContextManager = nullcontext()
        if driver == "callback":
            from cmg_mj.runs.callback import CallbackLoop, control_callback  # the loop needs no callback of MuJoCo's

            loop, driving = CallbackLoop, control_callback(plants[0], controller)
        counted = [stage.sums(plants[0], len(plants)) for stage in controller.rig.between]
        sums = [one for one in counted if one is not None]
        ticks = loop(physics, controller, steps, acting, np.radians(settings.fall_angle_deg).item())
        rest, on_progress = Outcome("done", duration_s), options.get("on_progress")
        try:
            with driving:
                for tick in ticks.ticks():
                    ticks.decide()
                    ticks.advance()
                    running = None if physics.running is None else physics.running.copy()
                    for recorder, torque in zip(recorders.values(), tick.torques, strict=True):
                        recorder.add(tick.q, tick.v, torque, running)
                    for one in sums:
                        one.add(tick.step * timestep, tick.q, physics.power(), running)
                    if on_progress:
                        on_progress((tick.step + tick.steps) * timestep)
        except RunStopped as error:
            rest = Outcome("stopped", ticks.step * timestep, str(error), len(plants) > 1)
        except KeyboardInterrupt:
            rest = Outcome("interrupted", ticks.step * timestep)
        for recorder in recorders.values():
            recorder.flush()
        endings = ticks.endings
        outcomes = [outcome_of(endings[world], timestep) if world in endings else rest for world in range(len(plants))]
        summaries = [
            combine_axes({name: one.metrics.summary(world, outcome.kind == "done") for name, one in recorders.items()})
            | {key: value for one in sums for key, value in one.figures(world).items()}
            for world, outcome in enumerate(outcomes)
        ]
        return Result(
            outcomes,
            summaries,
            since(0) if keep else None,
            tuple(self.observer_names),
            controller.seed,
            (controller.world_ids,) if isinstance(controller.world_ids, int) else tuple(controller.world_ids),
            driver,
        )

    def require_single_axis(self, what: str) -> ExperimentAxis:
        """Return the only axis, and refuse a plant of several.

        Args:
            what: The operation that takes one axis, for the message.

        Returns:
            The axis.

        Raises:
            InputError: The rig has several.
        """
        only, *others = self.axes
        if others:
            names = self.plant.axis_names
            several = f"{self.plant.path}: tilts about several axes ({', '.join(names)}), and {what} takes one"
            if not isinstance(self.plant.axes[-1].line, HingeLine):
                raise InputError(several)
            raise InputError(f'{several}; lock the others, as with --set plant.locked_axes=["{names[-1]}"]')
        return only

    def linear_closed_loop(self, plant: Literal["rig", "reduced"] = "rig") -> control.StateSpace:
        """Make the closed loop, with the observer in it, a linear system for python-control.

        The system is discrete at the control period. The plant is sampled exactly with the command held. Sensors,
        observer and law are the scenario's own code, whose slopes at rest are taken by differences. The loop is linear
        about upright at e = 0.

        - Covered: sample rates, latencies, skew, low-pass, means and constant errors of the sensors, and where they
          are; notch, `feedback`, `angle_source`, laws and observers of one's own.
        - Left out: dry friction, range, resolution, noise, the rate limit, `bias_trim_s`, and what an observer learns
          from noise. Means of accelerometers above a pivot that slides have its own acceleration at the instant.
        - Refused: observers without a slope at rest (`homogeneous`, `homogeneous_adaptive`, `super_twisting`),
          backlash, several axes, sensors slower than the controller, and with `rig` a robot that stands on contacts.

        A gain that varies, as of `ltv` or `kalman`, counts with the value it has at rest.

        Inputs, each held for a period:

        - `push_n_m`: a tilting torque on the rig [N m].
        - `y1_noise_rad`, `acceleration_noise_rad_s2`, `y2_noise_rad`, `fog_noise_rad_s`: added to a measurement [rad,
          rad/s^2, rad, rad/s]. An equilibrium bias e acts as a constant `y1_noise_rad` of -e.
        - `gimbal_rate_noise_rad_s`: gimbal rate beside the command [rad/s]. The observer does not know it. The loop
          transfer at the gimbals is L = -H/(1 + H), where H is the system from here to `u_rad_s`.

        Outputs at the tick, after its decision:

        - `x1_rad`, `x2_rad_s`, `x3_rad`: true tilt, tilt rate and gimbal angle [rad, rad/s, rad].
        - `u_rad_s`: the command [rad/s].
        - `estimated_x1_rad`, `estimated_x2_rad_s`, `estimated_x3_rad`, and the observer's extra signals.

        Args:
            plant: `rig`: the rig as it is simulated, linearised at its keyframe, with its servos, viscous friction, and
                a bend or a pivot that slides. `reduced`: the reduced model (6), whose gimbals turn as commanded.

        Returns:
            A `control.StateSpace` with these names. States that no output depends on, or that no input reaches, are
            left out.

        Raises:
            InputError: Something in the loop is not linear, or not covered; the message names it.
        """
        return self.require_single_axis("linear_closed_loop").linear_closed_loop(plant)

    @property
    def hints(self) -> list[str]:
        """Clauses on what is no mistake and yet likely to make the plant fall; what holds for all axes once."""
        said: dict[str, list[str]] = {}
        for part in self.axes:
            for hint in part.hints:
                said.setdefault(hint, []).append(part.name)
        return [hint if len(names) == len(self.axes) else f"{', '.join(names)}: {hint}" for hint, names in said.items()]

    def resolved(self) -> dict[str, Any]:
        """Return the scenario with every default written out, and the versions it ran with, as TOML can hold it."""
        return resolved(self.scenario, {part.name: part.design for part in self.axes})

    @functools.cached_property
    def differences(self) -> dict[str, Any]:
        """Differences from the bundled scenario it is based on: `section.field` -> its value.

        Title, seed and observer are ignored; a scenario of the user's own differs from none.
        """
        from cmg_mj.scenario.loading import base_of

        base = base_of(self.scenario)
        if base is None:
            return {}
        law = self.scenario.controller.kind
        law_change = {} if law == base.controller.kind else {"controller.kind": law}
        other = base.with_observer(self.scenario.observer.kind).with_kind("controller", law)
        if other.model_dump(mode="json") == self.scenario.model_dump(mode="json"):
            return law_change
        try:
            bundled = prepare(other)
        except InputError:  # it does not suit this observer
            bundled = prepare(base)
        return law_change | differences(bundled.resolved(), self.resolved())

    def as_toml(self, driver: str = "native", world: int = 0) -> str:
        """Return the resolved scenario: running it again gives the same run; its head says if that needs options."""
        why, command = "", "cmg-mj run scenario.toml"
        if driver == "board":
            why += "Run on the emulated board (docs/board.md), whose numbers are not quite the host's. "
            command += " --driver board"
        if world:
            why += f"World {world}: its noise is not that of world 0. "
            command += f" --world {world}"
        head = f"# {why}To the same numbers it runs with\n#     {command}\n\n" if why else ""
        return head + tomli_w.dumps(self.resolved())

    def save(self, path: Path) -> None:
        """Write it as TOML."""
        with whole_file(path) as temporary:
            temporary.write_text(self.as_toml(), encoding="utf-8")


def prepare(scenario: Scenario, plant: Plant | None = None, like: Plant | None = None) -> Experiment:
    """Load the plant and construct everything, so that what does not fit is found before a run.

    Args:
        scenario: The scenario.
        plant: Its plant, if that has been loaded already.
        like: A plant that may be of the same model file, which then is not compiled again.

    Returns:
        The experiment.

    Raises:
        InputError: Something in the scenario does not fit.
    """
    with scenario.named_in_errors():
        grid = time_grid(scenario)
        plant = plant or load_scenario_plant(scenario, grid, like)
        check_axes(scenario, plant)
        for check in entries("check").values():
            check(scenario, plant)
        parts = [(scenario, plant)]
        if len(plant.axes) > 1 or scenario.axes:
            parts = [(scenario.axis_scenario(name), plant.single_axis(name)) for name in plant.axis_names]
    axes = []
    for part, rig in parts:
        with part.named_in_errors():
            if part.sensors.accelerometer.averaged and not rig.axis.motion:
                raise InputError(
                    f"sensors.accelerometer.averaged = true: {rig.path} has no sensors accelerometer_inner_velocity, "
                    "accelerometer_inner_x and so on, which show means; leave it out"
                )
            axes.append(ExperimentAxis(rig, design(part, rig.parameters)))
    return Experiment(scenario, plant, tuple(axes))


def run_batch(
    experiments: Sequence[Experiment],
    world_ids: Sequence[int],
    plants: Sequence[Plant] | None = None,
    observer: Observer | None = None,
    **options: Unpack[SimulationOptions],
) -> Result:
    """Run worlds of different experiments in one batch: every number that differs is an array (n_worlds,).

    Args:
        experiments: One a world.
        world_ids: The worlds' numbers: world i has the same noise in every experiment.
        plants: A plant a world, instead of the experiments'.
        observer: The observer of all worlds instead of the first experiment's; then it is not looked whether they fit.
        **options: Options of `simulate`.

    Returns:
        The result of all worlds, each as if it had run alone, bit for bit.

    Raises:
        InputError: They differ in something that worlds of one batch have in common.
    """
    plants = [experiment.plant for experiment in experiments] if plants is None else list(plants)
    if not plants or len(plants) != len(world_ids):
        raise InputError(
            f"run_many: {len(world_ids)} worlds and {len(plants)} plants; give at least one, and as many of each"
        )
    if len({plant_structure(plant) for plant in {*plants, *(experiment.plant for experiment in experiments)}}) > 1:
        raise InputError(
            "run_many: the plants must have the scenario's joints and timestep_s, and one integrator in common"
        )
    first = experiments[0]
    key = first.batch_key
    for another in () if observer else (experiment.batch_key for experiment in experiments):
        if another != key:
            words = next(part[0] for part in (*key, *another) if part not in key or part not in another)
            raise InputError(
                f"run_many: {words} differs, which worlds of one batch must have in common; call run_many once for "
                "each value"
            )
    controls, outside = [], outsides(first.scenario)
    for i, part in enumerate(first.axes):
        parts = [experiment.axes[i] for experiment in experiments]
        law, sensors, outside = batched([(one.design.fresh_law(), one.scenario) for one in parts])
        tilt = stack_worlds([plant.axes[i].pair_tilt for plant in plants])
        gap = stack_worlds([plant.backlash for plant in plants])
        controls.append(
            part.design.axis_control(
                part.plant.interface._replace(tilt=tilt, backlash=gap),
                axis=i,
                observer=observer,
                open_loop_observers=list(batched_open_loop_observers([one.design for one in parts]).values()),
                law=law,
                sensors=sensors,
            )
        )
    controller = Controller(controls, first.between(controls), seed=first.scenario.seed, world_ids=world_ids)
    return first.simulate(plants, controller, outside, **options)
