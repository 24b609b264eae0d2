"""The schema of scenario files: sections and fields, their types, limits, defaults and checks."""

from __future__ import annotations

import functools
import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Annotated, Any, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, PrivateAttr, ValidationError, create_model, model_validator
from pydantic.dataclasses import dataclass

from cmg_mj.core.axis import AngleSource, Feedback
from cmg_mj.core.errors import InputError
from cmg_mj.core.reduced_model import ReducedModel
from cmg_mj.core.tilt import MeasurementNoise
from cmg_mj.inputs.features import FEATURES, entries
from cmg_mj.inputs.messages import complaints, fields_of, out_of_size
from cmg_mj.inputs.types import (
    STRICT,
    Batched,
    GridDuration,
    Instant,
    Line,
    NoEffect,
    NonNegative,
    OfOneLaw,
    OnAllAxes,
    PerAxis,
    Positive,
    Rate,
    Section,
    marked_fields,
)
from cmg_mj.inputs.user_classes import as_json
from cmg_mj.laws import LAW_CLASSES, LAWS, Law, lqr_gains, make_law, scaled_gains
from cmg_mj.observers import OBSERVERS, Observer, make_observer
from cmg_mj.scenario.plant_settings import PlantSettings
from cmg_mj.sensors import Sensors
from cmg_mj.stages.push import Push
from cmg_mj.stages.swing import Swing

FORBID = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)
MAX_CLAUSES = 20
"""So many wrong fields are named in one line."""


class LqrSettings(BaseModel):
    """Weights of the quadratic cost that the gains minimise."""

    model_config = FORBID
    state_cost: tuple[NonNegative, NonNegative, NonNegative, NonNegative]
    """Weights of x1, x2, x3, x_e."""
    input_cost: Positive = 1.0
    """Weight of u."""


class _OfUserClass(BaseModel):
    """A section whose `kind` names a class; the class checks its parameters."""

    model_config = ConfigDict(extra="allow", frozen=True, allow_inf_nan=False)

    @property
    def parameters(self) -> dict[str, Any]:
        """The section's fields that belong to the class alone."""
        return dict(self.__pydantic_extra__ or {})


class ControllerSettings(_OfUserClass):
    """The control law by name or dotted path, and its parameters, which the law itself checks."""

    kind: Annotated[str, OfOneLaw()] = "state_feedback"
    """A name that `cmg-mj list laws` shows, or package.module:Class."""
    rate_hz: Annotated[Rate, OnAllAxes()] = 200.0
    """Updates of the controller a second; the physics rate is a whole multiple of this rate."""
    gains: Annotated[
        tuple[float, float, float, float] | Literal["scaled"] | None, Batched(law_field="gains"), OfOneLaw()
    ] = None
    """The gains K_e on [x1, x2, x3, x_e]. `scaled` carries Table 2's gains over to the rig's time scale and authority.
    Without `gains` and `lqr` the law takes Table 2's gains."""
    lqr: Annotated[LqrSettings | None, Batched(law_field="gains"), OfOneLaw()] = None
    """Weights of a quadratic cost; the law then solves for its gains, instead of `gains`."""
    rate_limit_rad_s: Annotated[Positive, Batched(law_field="rate_limit")] = 4.7
    """Largest gimbal rate that the law commands."""
    feedback: Feedback = "observer"
    """Tilt rate that the law uses: the observer's estimate, the fibre-optic gyro's reading, or the exact rate."""
    angle_source: AngleSource = "measured"
    """Angles that the law uses: measured, as in (8), or the observer's, as in the text after (10)."""
    compensate_turning: Annotated[bool, OnAllAxes()] = True
    """On a rig of several axes, compensate the torques that a turn about the vertical couples into each axis."""
    bias_trim_s: Instant = 0.0
    """Time from the start in which the law holds its integrator at the value for the estimated bias."""
    notch_hz: NonNegative = 0.0
    """Centre frequency of a notch filter on the command, for a frame that bends; 0 for no notch."""

    @model_validator(mode="after")
    def _one_source_of_gains(self) -> ControllerSettings:
        if self.gains is not None and self.lqr is not None:
            raise ValueError("give either gains or lqr, not both")
        return self

    def law(self, model: ReducedModel, noise: MeasurementNoise) -> Law:
        """The law for a reduced model and the sensors' noise."""
        parameters = self.parameters
        if self.gains is not None:
            carried = self.gains == "scaled"
            parameters["gains"] = scaled_gains(model) if carried else self.gains
        elif self.lqr is not None:
            parameters["gains"] = lqr_gains(model, self.lqr.state_cost, self.lqr.input_cost)
        return make_law(self.kind, 1.0 / self.rate_hz, self.rate_limit_rad_s, model, noise, **parameters)


COMMON_LAW_FIELDS = [
    name for name in ControllerSettings.model_fields if name not in marked_fields(ControllerSettings, OfOneLaw)
]
"""Fields of [controller] that every law has."""
ALL_AXES_LAW_FIELDS = tuple(marked_fields(ControllerSettings, OnAllAxes))
"""Fields of [controller] that are the same on all axes."""


class ObserverSettings(_OfUserClass):
    """An observer by name or dotted path, and its parameters, which the observer itself checks."""

    kind: str = "homogeneous"
    """A name that `cmg-mj list observers` shows, or package.module:Class."""

    def make(self, dt: float, model: ReducedModel, noise: MeasurementNoise) -> Observer:
        """Construct the observer."""
        return make_observer(self.kind, dt, model, noise, **self.parameters)


@dataclass(frozen=True, config=STRICT)
class MetricsSettings:
    """Limits that count as settled and as fallen, and the time from which a bias estimate is judged.

    Attributes:
        settle_band_deg: The rig has settled once |x1| stays below this angle until the end [deg].
        fall_angle_deg: The rig has fallen once it is farther than this from upright [deg].
        bias_from_s: Time from which a bias estimate is scored, after it has converged [s].
    """

    settle_band_deg: Positive = 1.0
    fall_angle_deg: Annotated[float, Field(gt=0.0, lt=90.0)] = 30.0
    bias_from_s: Instant = 5.0


class CompareSettings(BaseModel):
    """Defaults of `cmg-mj compare`; other commands ignore this section."""

    model_config = FORBID
    observers: Annotated[list[str], Field(min_length=1)] | Literal["all"] = "all"
    """Observers to compare. The scenario's observer keeps its parameters; the others have their defaults."""
    worlds: Annotated[int, Field(ge=1)] = 20
    """Number of runs of each observer, each with its own noise."""

    def names(self) -> list[str]:
        """The observers, spelled out."""
        return list(OBSERVERS) if self.observers == "all" else list(dict.fromkeys(self.observers))


_PER_AXIS: dict[str, Any] = {
    name: (fields_of(PlantSettings)[name] | None, None) for name in marked_fields(PlantSettings, PerAxis)
}


class AxisPlant(create_model("AxisPlant", __config__=FORBID, **_PER_AXIS)):
    """The fields of [plant] of which an axis may have its own value: those that `PerAxis` marks."""


class AxisSettings(BaseModel):
    """Settings of one axis of several, in the same sections as those of all axes."""

    model_config = FORBID
    plant: AxisPlant = Field(default_factory=AxisPlant)
    controller: dict[str, Any] = Field(default_factory=dict)
    """Fields of [controller] but those that are the same on all axes."""
    observer: dict[str, Any] = Field(default_factory=dict)
    """Fields of [observer]."""
    sensors: dict[str, Any] = Field(default_factory=dict)
    """Sections of [sensors]."""

    def as_fields(self) -> dict[str, Any]:
        """The content of the axis' section, without empty sections."""
        return {name: section for name, section in self.model_dump(mode="json", exclude_none=True).items() if section}


class Sections(BaseModel):
    """Sections of a scenario and fields above them, without those of features."""

    model_config = FORBID
    title: Annotated[Line, NoEffect()] = ""
    """Name shown in tables, plots and recordings."""
    duration_s: GridDuration = 15.0
    """Simulated time [s]."""
    seed: Annotated[int, Field(ge=0)] = 0
    """Seed of the random numbers, such as the sensors' noise."""
    plant: PlantSettings = Field(default_factory=PlantSettings)
    controller: ControllerSettings = Field(default_factory=ControllerSettings)
    observer: ObserverSettings = Field(default_factory=ObserverSettings)
    open_loop_observers: list[str] | Literal["all"] = Field(default_factory=list)
    """Observers that run in open loop: the law does not use their estimates. They have their default parameters."""
    sensors: Sensors = Field(default_factory=Sensors)
    axes: dict[str, AxisSettings] = Field(default_factory=dict)
    """Settings of single axes, by name."""
    push: list[Push] = Field(default_factory=list)
    swing: list[Swing] = Field(default_factory=list)
    metrics: MetricsSettings = Field(default_factory=MetricsSettings)
    compare: Annotated[CompareSettings | None, NoEffect()] = None
    """Written by `cmg-mj compare`, so that its scenario runs to the same comparison."""
    based_on: Annotated[str, NoEffect()] = ""
    """Bundled scenario that this one changes; folder names, titles and summaries say so."""
    versions: Annotated[dict[str, str], NoEffect()] = Field(default_factory=dict)
    """Versions of the packages of a run; the run writes this field, and no command reads it."""


_OF_FEATURES: dict[str, Any] = {
    name: (list[cls], Field(default_factory=list)) if FEATURES[name].is_list else (cls, Field(default_factory=cls))
    for name, cls in entries("section").items()
}


class Scenario(create_model("Scenario", __base__=Sections, **_OF_FEATURES)):
    """One experiment."""

    _source: str = PrivateAttr("")

    def section(self, feature: str) -> Any:
        """The settings of a feature; of one that may have several sections a list."""
        return getattr(self, feature)

    @property
    def feature_sections(self) -> dict[str, list[Section]]:
        """The settings of all features, by name."""
        sections = {name: getattr(self, name) for name in _OF_FEATURES}
        return {name: section if FEATURES[name].is_list else [section] for name, section in sections.items()}

    @property
    def source(self) -> str:
        """The scenario's name in an error: the file, and what was changed in it."""
        return self._source

    def with_source(self, source: str) -> Scenario:
        """The same scenario by another name in errors."""
        scenario = self.model_copy()
        scenario._source = source
        return scenario

    @contextmanager
    def named_in_errors(self) -> Iterator[None]:
        """Put the scenario's source before the message of an `InputError`.

        Raises:
            InputError: That of the block, with the source before its message.
        """
        try:
            yield
        except InputError as error:
            raise InputError(located(self._source, str(error))) from error

    def as_fields(self) -> dict[str, Any]:
        """The content of a TOML file: what `parse_scenario` takes."""
        return self.model_dump(mode="json", exclude_none=True)

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """Copy the scenario, as pydantic does; the copy makes the scenarios of its axes anew."""
        scenario = super().model_copy(update=update, deep=deep)
        vars(scenario).pop("axis_scenarios", None)
        return scenario

    @functools.cached_property
    def axis_scenarios(self) -> dict[str, Scenario]:
        """The scenario of each axis in [axes], by the axis' name: that of the plant with the axis' own fields in it.

        Where an axis names another observer or law, no parameter of the common one is left.

        Raises:
            InputError: A field is unknown or not allowed.
        """
        return {name: self._with_fields_of(name, axis.as_fields()) for name, axis in self.axes.items()}

    def axis_scenario(self, axis: str) -> Scenario:
        """The scenario of one axis, whether it has fields of its own or not."""
        return self.axis_scenarios[axis] if axis in self.axes else self.model_copy(update={"axes": {}})

    def _with_fields_of(self, axis: str, sections: Mapping[str, Mapping[str, Any]]) -> Scenario:
        source = f"{self._source}, [axes.{axis}]".removeprefix(", ")
        for name in ALL_AXES_LAW_FIELDS:
            if name in sections.get("controller", {}):
                raise InputError(located(source, f"controller.{name}: is the same on all axes; set it in [controller]"))
        fields = self.model_copy(update={"axes": {}}).as_fields()
        for name, section in sections.items():
            common = fields.setdefault(name, {})
            if section.get("kind", common.get("kind")) != common.get("kind"):
                shared = COMMON_LAW_FIELDS if name == "controller" else ()
                common = {field: common[field] for field in shared if field in common}
            if name == "controller" and {"gains", "lqr"} & section.keys():
                common = {field: value for field, value in common.items() if field not in ("gains", "lqr")}
            fields[name] = _merged(common, section)
        return parse_scenario(fields, source)

    def with_observer(self, kind: str) -> Scenario:
        """The same experiment with another observer in the loop; its own keeps the parameters given for it.

        On a rig of several axes it is that of all: what an axis has of another's own goes.
        """
        return self.with_kind("observer", kind)

    def with_kind(self, section: Literal["controller", "observer"], kind: str) -> Scenario:
        """The same experiment with another law or observer, with its default parameters, on all axes."""
        own, axes = getattr(self, section), dict(self.axes)
        shared = COMMON_LAW_FIELDS if section == "controller" else ()
        for name, settings in self.axes.items():
            fields = getattr(settings, section)
            if fields.get("kind", own.kind) != kind:
                fields = {field: value for field, value in fields.items() if field in shared}
                axes[name] = settings.model_copy(update={section: fields})
        if own.kind != kind:
            own = type(own)(**{name: getattr(own, name) for name in shared}, kind=kind)
        return self.model_copy(update={section: own, "axes": axes})

    def open_loop_names(self) -> list[str]:
        """The open-loop observers, spelled out, without the observer itself."""
        names = list(OBSERVERS) if self.open_loop_observers == "all" else list(self.open_loop_observers)
        return [name for name in dict.fromkeys(names) if name != self.observer.kind]


def parse_scenario(fields: Mapping[str, Any], source: str = "") -> Scenario:
    """Check a scenario given as a mapping.

    Args:
        fields: The TOML file's content.
        source: The scenario's name in an error.

    Returns:
        The scenario, with those of its axes.

    Raises:
        InputError: A field is unknown or not allowed. All wrong fields are named, on one line.
    """
    fields = _moved(fields)
    try:
        # By way of JSON, pydantic takes a list for a tuple and still no text or true for a number.
        scenario = Scenario.model_validate_json(json.dumps(fields, default=as_json), strict=True).with_source(source)
        wrong = out_of_size(fields)
    except ValidationError as error:
        scenario, wrong = None, complaints(Scenario, error.errors(), fields)
    except RecursionError as error:
        raise InputError(located(source, "tables in too many tables")) from error
    clauses = list(dict.fromkeys([*wrong, *_unknown_to_bench_law(fields)]))
    if len(clauses) > MAX_CLAUSES:
        clauses[MAX_CLAUSES:] = [f"and {len(clauses) - MAX_CLAUSES} more"]
    if clauses or scenario is None:
        raise InputError(located(source, "; ".join(clauses)))
    _ = scenario.axis_scenarios  # their fields are checked, too
    return scenario


def _unknown_to_bench_law(fields: Mapping[str, Any]) -> list[str]:
    """Find fields that one of the bench's laws does not have; no code of a user's is run to read a file."""
    section = fields.get("controller")
    if not isinstance(section, Mapping):
        return []
    kind = section.get("kind", ControllerSettings().kind)
    is_bench_law = isinstance(kind, str) and kind in LAWS
    return LAW_CLASSES.unknown(kind, section, ControllerSettings.model_fields) if is_bench_law else []


def _merged(common: Mapping[str, Any], overrides: Mapping[str, Any]) -> dict[str, Any]:
    """A section with another's fields in the place of its own, down to the last."""
    both = {
        name: _merged(common[name], overrides[name])
        for name in common.keys() & overrides.keys()
        if isinstance(common[name], Mapping) and isinstance(overrides[name], Mapping)
    }
    return {**common, **overrides, **both}


def _moved(fields: Mapping[str, Any]) -> Mapping[str, Any]:
    """Move what a file written by a run of version 0.2.0 has in [plant] to the features' own sections: `bend_share`."""
    plant, moved = fields.get("plant"), dict(fields)
    if "versions" not in fields or not isinstance(plant, Mapping):
        return fields
    for section, cls in entries("section").items():
        old = {f"{section}_{name}": name for name in fields_of(cls)}
        if found := {old[name]: value for name, value in plant.items() if name in old}:
            moved[section] = found
            plant = {name: value for name, value in plant.items() if name not in old}
    return {**moved, "plant": plant}


def located(source: str, wrong: str) -> str:
    """A message with its source before it."""
    return f"{source}: {wrong}" if source else wrong
