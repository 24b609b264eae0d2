"""A scenario made ready to run."""

from __future__ import annotations

import dataclasses
import functools
import json
import math
import platform
from collections.abc import Callable, Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w
from pydantic import ConfigDict, TypeAdapter, ValidationError

from cmg_mj.complaint import fields_of, not_allowed
from cmg_mj.controller import Controller
from cmg_mj.errors import InputError
from cmg_mj.law import Law
from cmg_mj.observers import Observer, make_observer
from cmg_mj.observers.registry import observer_class
from cmg_mj.plant import Plant, load_plant
from cmg_mj.rehearsal import rehearse
from cmg_mj.resources import folder
from cmg_mj.scenario import as_json, located
from cmg_mj.schema import ControllerSettings, Scenario
from cmg_mj.simulate import Driver, Result, simulate
from cmg_mj.timing import whole_steps
from cmg_mj.trajectory import whole_file


@dataclasses.dataclass(frozen=True)
class Experiment:
    """A scenario made ready to run: its plant is loaded, everything in it has been constructed once and fits.

    Attributes:
        scenario: What it was made from.
        plant: The rig.
        law: The control law.
    """

    scenario: Scenario
    plant: Plant
    law: Law

    @property
    def observer_names(self) -> list[str]:
        """The observer in the loop, then the companions."""
        return [self.scenario.observer.kind, *self.scenario.companion_names()]

    def controller(self, worlds: int | Sequence[int] = 0) -> Controller:
        """A fresh controller.

        Args:
            worlds: The number of one world, or the numbers of many: their noise depends on (seed, number) alone.

        Returns:
            The controller.
        """
        scenario, plant = self.scenario, self.plant
        dt, model = self.law.dt, plant.reduced
        return plant.controller(
            scenario.observer.make(dt, model),
            law=self.law,
            sensors=scenario.sensors,
            seed=scenario.seed,
            worlds=worlds,
            feedback=scenario.controller.feedback,
            angles=scenario.controller.angles,
            trim_s=scenario.controller.trim_s,
            companions={name: make_observer(name, dt, model) for name in scenario.companion_names()},
        )

    def run(self, driver: Driver = "native", world: int = 0, **options: Any) -> Result:
        """Run one world. Options are those of `simulate`."""
        return self._simulate(self.plant, self.controller(int(world)), driver=driver, **options)

    def run_many(
        self,
        worlds: int | Sequence[int],
        plants: Sequence[Plant] | None = None,
        vary: Mapping[str, Sequence[Any]] | None = None,
        **options: Any,
    ) -> Result:
        """Run many worlds at once.

        Args:
            worlds: How many, or their numbers: world i has the same noise wherever it stands.
            plants: A plant a world, if they differ.
            vary: The same by settings: a field of [plant] -> its value in each world, such as
                {"equilibrium_bias_deg": [0.0, 0.5]}.
            **options: Those of `simulate`.

        Returns:
            The result of all worlds.

        Raises:
            InputError: There is no world, or the plants do not fit the worlds or each other.
        """
        numbers = [int(number) for number in (range(worlds) if isinstance(worlds, int) else worlds)]
        if vary is not None:
            plants = self.rigs(vary)
        rigs = [self.plant] * len(numbers) if plants is None else list(plants)
        if not numbers or len(rigs) != len(numbers):
            raise InputError(
                f"run_many: {len(numbers)} worlds and {len(rigs)} plants; give at least one, and as many of each"
            )
        alike = {(rig.model.opt.timestep, int(rig.model.opt.integrator), *rig.joint_names) for rig in set(rigs)}
        if len(alike) > 1:
            raise InputError("run_many: the plants must have the same joints, timestep_s and integrator")
        return self._simulate(rigs, self.controller(numbers), **options)

    def rigs(self, vary: Mapping[str, Sequence[Any]]) -> list[Plant]:
        """The scenario's rig with other settings in each world; equal settings share one rig.

        Args:
            vary: Field of [plant] -> its value in each world.

        Returns:
            A rig a world.

        Raises:
            InputError: There is no such field, a value is not allowed, or the lists differ in length.
        """
        given = dataclasses.asdict(self.scenario.plant)
        made: dict[tuple, Plant] = {}
        rigs = []
        try:
            rows = list(zip(*vary.values(), strict=True))
        except ValueError as error:
            raise InputError(f"vary: {', '.join(vary)} must have as many values each, one a world") from error
        for row in rows:
            if row not in made:
                made[row] = load_plant(**given | dict(zip(vary, row, strict=True)))
            rigs.append(made[row])
        return rigs

    def _simulate(self, plant: Plant | Sequence[Plant], controller: Controller, **options: Any) -> Result:
        scenario = self.scenario
        return simulate(
            plant,
            controller,
            scenario.duration_s,
            observers=self.observer_names,
            pushes=scenario.push,
            settings=scenario.metrics,
            **options,
        )

    def rehearse(self, worlds: int | None = None) -> None:
        """Try every observer once, so that one that cannot work is found before a run and not at its first sample.

        Args:
            worlds: Try it on arrays of so many worlds; None for floats.

        Raises:
            InputError: An observer raised an exception or returned something else than a state and an estimate.
        """
        with np.errstate(all="ignore"):
            for i, (kind, observer) in enumerate(zip(self.observer_names, self._observers(), strict=True)):
                try:
                    rehearse(observer, worlds)
                except InputError as error:
                    raise InputError(f"{'companions:' if i else 'observer.kind ='} {kind!r}: {error}") from error

    def _observers(self) -> list[Observer]:
        controller = self.controller()
        return [controller.observer, *controller.companions.values()]

    def resolved(self) -> dict[str, Any]:
        """The scenario with every default written out, and the versions it ran with, as TOML can hold it."""
        fields = TypeAdapter(Scenario).dump_python(self.scenario, mode="json", exclude_none=True)
        path = self.plant.path.resolve()
        fields["plant"]["model"] = path.name if path.parent == folder("models").resolve() else str(path)
        controller = fields["controller"] | {"gains": list(self.law.gains), "lqr": None}
        fields["controller"] = {
            name: controller[name] for name in ControllerSettings.model_fields if controller[name] is not None
        }
        fields["companions"] = self.scenario.companion_names()
        fields["observer"] = {"kind": self.scenario.observer.kind, **self._observer_parameters()}
        fields["versions"] = _versions()
        return _plain(fields)

    def _observer_parameters(self) -> dict[str, Any]:
        """What was given, and the defaults of the rest as far as they can be known and TOML can hold them."""
        given = self.scenario.observer.parameters
        observer: Any = self.scenario.observer.make(self.law.dt, self.plant.reduced)
        if not dataclasses.is_dataclass(observer):
            return given
        names = [f.name for f in dataclasses.fields(observer) if f.init and f.name not in ("dt", "model")]
        kept = {name: _plain(getattr(observer, name, None)) for name in names if name not in given}
        return {name: value for name, value in kept.items() if _is_toml(value)} | given

    def save(self, path: Path) -> None:
        """Write the resolved scenario as TOML: running that file again gives the same run."""
        with whole_file(path) as temporary:
            temporary.write_text(tomli_w.dumps(self.resolved()))


@functools.cache
def _versions() -> dict[str, str]:
    """What a run depends on (read once: that takes longer than to simulate a second)."""
    names = ("cmg_mj", "mujoco", "numpy", "scipy")
    return {name: version(name) for name in names} | {"python": platform.python_version()}


def _plain(value: Any) -> Any:
    """Tuples and arrays to lists, as TOML wants them."""
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, Mapping):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    return value


def _is_toml(value: Any) -> bool:
    try:
        tomli_w.dumps({"value": value})
    except TypeError:
        return False
    return True


def prepare(scenario: Scenario) -> Experiment:
    """Load the plant, construct everything and try the observers once, so that what does not fit is found before a run.

    Args:
        scenario: The scenario.

    Returns:
        The experiment.

    Raises:
        InputError: Something in the scenario does not fit.
    """
    try:
        _check_times(scenario)
        _check_observers(scenario)
        plant = load_plant(scenario.plant)
        experiment = Experiment(scenario, plant, scenario.controller.law(plant.reduced))
        experiment.controller()
        experiment.rehearse()
    except InputError as error:
        raise InputError(located(scenario._where, str(error))) from error
    return experiment


def _check_times(scenario: Scenario) -> None:
    """Rates must divide the physics rate, times be multiples of the physics step, and pushes begin within the run."""
    timestep = scenario.plant.timestep_s
    sensors = {kind: getattr(scenario.sensors, kind) for kind in ("accelerometer", "encoder", "fog")}
    rates = {"controller.rate_hz": scenario.controller.rate_hz}
    rates |= {f"sensors.{kind}.rate_hz": sensor.rate_hz for kind, sensor in sensors.items()}
    times = {"duration_s": scenario.duration_s}
    times |= {f"sensors.{kind}.latency_s": sensor.latency_s for kind, sensor in sensors.items()}
    if scenario.controller.trim_s:
        times["controller.trim_s"] = scenario.controller.trim_s
    for i, push in enumerate(scenario.push):
        times |= {f"push.{i}.start_s": push.start_s, f"push.{i}.duration_s": push.duration_s}
    for field, rate in rates.items():
        _check_grid(1.0 / rate, timestep, field, f"{rate:g} Hz", lambda steps: f"{1.0 / (steps * timestep):g} Hz")
    for field, time in times.items():
        _check_grid(time, timestep, field, f"{time:g} s", lambda steps: f"{steps * timestep:g} s")
    for i, push in enumerate(scenario.push):
        if push.start_s >= scenario.duration_s:
            raise InputError(
                f"push.{i}.start_s = {push.start_s:g}: must be less than duration_s = {scenario.duration_s:g}, "
                "where the run ends"
            )


def _check_grid(time: float, timestep: float, field: str, given: str, show: Callable[[int], str]) -> None:
    try:
        whole_steps(time, timestep, field, given)
    except InputError as error:
        around = {max(1, math.floor(time / timestep)), max(1, math.ceil(time / timestep))}
        raise InputError(f"{error} (nearest: {' or '.join(show(steps) for steps in sorted(around))})") from error


def _check_observers(scenario: Scenario) -> None:
    """The observers exist, and the parameters of the one in the loop are of their types: no text for a number."""
    for name in scenario.companion_names():
        try:
            observer_class(name)
        except InputError as error:
            raise InputError(str(error).replace("observer.kind = ", "companions: ", 1)) from error
    kind, parameters = scenario.observer.kind, scenario.observer.parameters
    types = fields_of(observer_class(kind))
    for name, value in parameters.items():
        if name in ("dt", "model"):
            raise InputError(f"observer.{name}: set by the bench, which gives it to every observer")
        if name not in types:
            continue  # a name that the class does not have, or no class of pydantic's: its constructor decides
        adapter = TypeAdapter(types[name], config=ConfigDict(strict=True, allow_inf_nan=False))
        try:
            adapter.validate_json(json.dumps(value, default=as_json))
        except ValidationError as error:
            finite = all(detail["type"] != "finite_number" for detail in error.errors())
            wrong = not_allowed(f"observer.{name}", value, types[name], finite=finite)
            raise InputError(f"{wrong} (observer {kind})") from error
