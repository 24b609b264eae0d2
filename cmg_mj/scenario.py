"""TOML -> the objects of a run, every field checked."""

from __future__ import annotations

import dataclasses
import math
import platform
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Annotated, Any, Literal

import tomli_w
from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError, model_validator

from cmg_mj.controller import TABLE_2_GAINS, Angles, Controller, Feedback, Law, lqr_gains
from cmg_mj.errors import InputError, nearest
from cmg_mj.metrics import MetricsSettings
from cmg_mj.observers import OBSERVERS, Observer, make_observer
from cmg_mj.plant import Plant, PlantSettings, load_plant
from cmg_mj.push import Push
from cmg_mj.reduced import ReducedModel
from cmg_mj.resources import find
from cmg_mj.sensors import Sensors
from cmg_mj.simulate import Driver, Result, simulate
from cmg_mj.trajectory import whole_file

Positive = Annotated[float, Field(gt=0.0)]
NonNegative = Annotated[float, Field(ge=0.0)]
FORBID = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class LqrSettings(BaseModel):
    """Weights of the quadratic cost that the gains minimise."""

    model_config = FORBID
    state_cost: tuple[NonNegative, NonNegative, NonNegative, NonNegative]
    """Weights of x1, x2, x3, x_e."""
    input_cost: Positive = 1.0
    """Weight of u."""


class ControllerSettings(BaseModel):
    """The control law."""

    model_config = FORBID
    rate_hz: Positive = 200.0
    """Control ticks a second; divides the physics rate."""
    gains: tuple[float, float, float, float] | None = None
    """K_e on [x1, x2, x3, x_e]; Table 2's if neither gains nor lqr is given."""
    lqr: LqrSettings | None = None
    """Weights to solve for the gains instead."""
    rate_limit_rad_s: Positive = 4.7
    """Largest gimbal rate."""
    feedback: Feedback = "observer"
    """Which rate the law uses."""
    angles: Angles = "measured"
    """Whether the law uses the measured angles, as (8), or the estimated ones, as the text after (10)."""

    @model_validator(mode="after")
    def _one_source_of_gains(self) -> ControllerSettings:
        if self.gains is not None and self.lqr is not None:
            raise ValueError("give either gains or lqr, not both")
        return self

    def law(self, model: ReducedModel) -> Law:
        """The law for a reduced model."""
        gains = self.gains or TABLE_2_GAINS
        if self.lqr is not None:
            gains = lqr_gains(model, self.lqr.state_cost, self.lqr.input_cost)
        return Law(1.0 / self.rate_hz, tuple(gains), self.rate_limit_rad_s)  # type: ignore[arg-type]


class ObserverSettings(BaseModel):
    """An observer by name or dotted path, and its parameters, which the observer itself checks."""

    model_config = ConfigDict(extra="allow", frozen=True)
    kind: str = "homogeneous"
    """A name that `cmg-mj list observers` shows, or package.module:Class."""

    @property
    def parameters(self) -> dict[str, Any]:
        """What was given besides the kind."""
        return dict(self.__pydantic_extra__ or {})

    def make(self, dt: float, model: ReducedModel) -> Observer:
        """Construct the observer."""
        return make_observer(self.kind, dt, model, **self.parameters)


class Scenario(BaseModel):
    """One experiment."""

    model_config = FORBID
    title: str = ""
    duration_s: Positive = 15.0
    seed: Annotated[int, Field(ge=0)] = 0
    plant: PlantSettings = Field(default_factory=PlantSettings)
    controller: ControllerSettings = Field(default_factory=ControllerSettings)
    observer: ObserverSettings = Field(default_factory=ObserverSettings)
    companions: list[str] | Literal["all"] = Field(default_factory=list)
    """Observers that ride along open loop, with their default parameters."""
    sensors: Sensors = Field(default_factory=Sensors)
    push: list[Push] = Field(default_factory=list)
    metrics: MetricsSettings = Field(default_factory=MetricsSettings)
    versions: dict[str, str] = Field(default_factory=dict)
    """Written by a run, not read."""

    def with_observer(self, kind: str) -> Scenario:
        """The same experiment with another observer in the loop; its own keeps the parameters given for it."""
        if kind == self.observer.kind:
            return self
        return self.model_copy(update={"observer": ObserverSettings(kind=kind)})

    def companion_names(self) -> list[str]:
        """The companions, spelled out, without the observer itself."""
        names = list(OBSERVERS) if self.companions == "all" else list(self.companions)
        return [name for name in dict.fromkeys(names) if name != self.observer.kind]


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
            companions={name: make_observer(name, dt, model) for name in scenario.companion_names()},
        )

    def run(self, driver: Driver = "native", world: int = 0, **options: Any) -> Result:
        """Run one world. Options are those of `simulate`."""
        return self._simulate(self.plant, self.controller(world), driver=driver, **options)

    def run_many(self, worlds: int | Sequence[int], plants: Sequence[Plant] | None = None, **options: Any) -> Result:
        """Run many worlds at once.

        Args:
            worlds: How many, or their numbers.
            plants: A plant a world, if they differ.
            **options: Those of `simulate`.

        Returns:
            The result of all worlds.
        """
        numbers = range(worlds) if isinstance(worlds, int) else worlds
        return self._simulate(list(plants or [self.plant] * len(numbers)), self.controller(list(numbers)), **options)

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

    def resolved(self) -> dict[str, Any]:
        """The scenario with every default written out, and the versions it ran with, as TOML can hold it."""
        fields = TypeAdapter(Scenario).dump_python(self.scenario, mode="json", exclude_none=True)
        if (
            self.scenario.plant.model not in (self.plant.path.name, self.plant.path.stem)
            or Path(self.scenario.plant.model).is_file()
        ):
            fields["plant"]["model"] = str(self.plant.path.resolve())
        fields["controller"]["gains"] = list(self.law.gains)
        fields["controller"].pop("lqr", None)
        fields["companions"] = self.scenario.companion_names()
        fields["observer"] = {"kind": self.scenario.observer.kind, **self._observer_parameters()}
        names = ("cmg_mj", "mujoco", "numpy", "scipy")
        fields["versions"] = {name: version(name) for name in names} | {"python": platform.python_version()}
        return _plain(fields)

    def _observer_parameters(self) -> dict[str, Any]:
        observer: Any = self.scenario.observer.make(self.law.dt, self.plant.reduced)
        if not dataclasses.is_dataclass(observer):
            return self.scenario.observer.parameters
        names = [f.name for f in dataclasses.fields(observer) if f.init and f.name not in ("dt", "model")]
        return {name: getattr(observer, name) for name in names}

    def save(self, path: Path) -> None:
        """Write the resolved scenario as TOML: running that file again gives the same run."""
        with whole_file(path) as temporary:
            temporary.write_text(tomli_w.dumps(self.resolved()))


def _plain(value: Any) -> Any:
    """Tuples to lists, as TOML wants them."""
    if isinstance(value, Mapping):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    return value


def load_scenario(name: str, overrides: Iterable[str] = ()) -> Scenario:
    """Read a scenario.

    Args:
        name: A bundled scenario's name, or the path of a TOML file.
        overrides: Settings `section.field=value` that replace those of the file.

    Returns:
        The scenario, its fields checked.

    Raises:
        InputError: The file does not exist, is no TOML, or has a field that is unknown or not allowed.
    """
    path = find("scenarios", name, ".toml", "scenario")
    try:
        fields = tomllib.loads(path.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: not valid TOML: {error}") from error
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from error
    for override in overrides:
        _override(fields, override)
    scenario = parse_scenario(fields, str(path))
    model = path.parent / scenario.plant.model
    if model.is_file() and not Path(scenario.plant.model).is_file():
        # A model beside the scenario file, named relative to it.
        plant = dataclasses.replace(scenario.plant, model=str(model))
        scenario = scenario.model_copy(update={"plant": plant})
    return scenario


def parse_scenario(fields: Mapping[str, Any], where: str = "scenario") -> Scenario:
    """Check a scenario given as a mapping.

    Args:
        fields: The TOML file's content.
        where: What to call it in the error.

    Returns:
        The scenario.

    Raises:
        InputError: A field is unknown or not allowed. All wrong fields are named, on one line.
    """
    try:
        return Scenario.model_validate(fields)
    except ValidationError as error:
        complaints = [_complaint(detail, fields) for detail in error.errors()]
        raise InputError(f"{where}: " + "; ".join(dict.fromkeys(complaints))) from error


def prepare(scenario: Scenario) -> Experiment:
    """Load the plant and construct everything once, so that what does not fit is found before a run.

    Args:
        scenario: The scenario.

    Returns:
        The experiment.

    Raises:
        InputError: Something in the scenario does not fit.
    """
    plant = load_plant(scenario.plant)
    experiment = Experiment(scenario, plant, scenario.controller.law(plant.reduced))
    experiment.controller()
    for i, push in enumerate(scenario.push):
        if push.start_s >= scenario.duration_s:
            raise InputError(
                f"push.{i}.start_s = {push.start_s:g}: the run ends at duration_s = {scenario.duration_s:g}"
            )
    return experiment


def _override(fields: dict[str, Any], setting: str) -> None:
    name, equals, text = setting.partition("=")
    parts = name.strip().split(".")
    if not equals or not all(parts):
        raise InputError(f"--set {setting!r}: write section.field=value, for example plant.equilibrium_bias_deg=1.0")
    try:
        value = tomllib.loads(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        value = text.strip()  # a bare word is a string
    *sections, field = parts
    place: Any = fields
    for section in sections:
        if isinstance(place, list) and section.isdigit() and int(section) < len(place):
            place = place[int(section)]
        elif isinstance(place, dict):
            place = place.setdefault(section, {})
        else:
            raise InputError(f"--set {setting!r}: there is no {'.'.join(sections)} to set a field of")
    if not isinstance(place, dict):
        raise InputError(
            f"--set {setting!r}: {'.'.join(sections)} is not a section; write for example push.0.torque_n_m=2.0"
        )
    place[field] = value


def _complaint(detail: Mapping[str, Any], fields: Mapping[str, Any]) -> str:
    """One wrong field in words: where, what was given, what is allowed."""
    location = [
        part for part in detail["loc"] if not str(part).startswith(("tuple[", "list[", "literal[", "function-"))
    ]
    where = ".".join(str(part) for part in location)
    kind = detail["type"]
    if kind in ("extra_forbidden", "unexpected_keyword_argument"):
        return f"{where}: no such field; {nearest(str(location[-1]), _siblings(location[:-1]))}"
    if kind in ("missing", "missing_argument"):
        return f"{where}: missing"
    message = detail["msg"].removeprefix("Value error, ")
    message = message[0].lower() + message[1:]
    given = detail["input"]
    shown = "" if isinstance(given, (dict, list, BaseModel)) or dataclasses.is_dataclass(given) else f" = {given!r}"
    if isinstance(given, float) and not math.isfinite(given):
        shown = f" = {given}"
    return f"{where}{shown}: {message}" if where else message


def _siblings(location: Sequence[Any]) -> list[str]:
    """Names of the fields of the section at a place of the scenario."""
    place: Any = Scenario
    for part in location:
        if isinstance(part, int):
            continue
        annotation = _fields(place)[part]
        for candidate in _types_in(annotation):
            if _fields(candidate):
                place = candidate
                break
    return [name for name in _fields(place) if name != "versions"]


def _fields(place: Any) -> dict[str, Any]:
    if isinstance(place, type) and issubclass(place, BaseModel):
        return {name: info.annotation for name, info in place.model_fields.items()}
    if dataclasses.is_dataclass(place):
        return {name: info.annotation for name, info in place.__pydantic_fields__.items()}  # type: ignore[attr-defined]
    return {}


def _types_in(annotation: Any) -> list[Any]:
    arguments = getattr(annotation, "__args__", None)
    return [annotation] if not arguments else [t for argument in arguments for t in _types_in(argument)]
