"""What a scenario file may say: its sections and fields, their types, limits and defaults."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, PrivateAttr, model_validator
from pydantic.dataclasses import dataclass

from cmg_mj.controllers.controller import AngleSource, Feedback
from cmg_mj.controllers.laws import Law, lqr_gains, make_law, scaled_gains
from cmg_mj.inputs.field_types import STRICT, Duration, Instant, Line, NonNegative, Positive, Rate
from cmg_mj.observers import OBSERVERS, Observer, make_observer
from cmg_mj.observers.reduced_model import ReducedModel
from cmg_mj.scenario.disturbances import Push, Swing
from cmg_mj.scenario.plant_settings import PlantSettings
from cmg_mj.sensors.sampled import Sensors
from cmg_mj.sensors.tilt import TiltNoise

FORBID = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class LqrSettings(BaseModel):
    """Weights of the quadratic cost that the gains minimise."""

    model_config = FORBID
    state_cost: tuple[NonNegative, NonNegative, NonNegative, NonNegative]
    """Weights of x1, x2, x3, x_e."""
    input_cost: Positive = 1.0
    """Weight of u."""


class ControllerSettings(BaseModel):
    """The control law by name or dotted path, and its parameters, which the law itself checks."""

    model_config = ConfigDict(extra="allow", frozen=True, allow_inf_nan=False)
    kind: str = "state_feedback"
    """A name that `cmg-mj list laws` shows, or package.module:Class."""
    rate_hz: Rate = 200.0
    """Control ticks a second; divides the physics rate."""
    gains: tuple[float, float, float, float] | Literal["scaled"] | None = None
    """K_e on [x1, x2, x3, x_e], of a law that takes gains; Table 2's if neither gains nor lqr is given;
    `scaled`: Table 2's by the rig's time scale and authority."""
    lqr: LqrSettings | None = None
    """Weights to solve for the gains instead."""
    rate_limit_rad_s: Positive = 4.7
    """Largest gimbal rate."""
    feedback: Feedback = "observer"
    """Which rate the law uses."""
    angle_source: AngleSource = "measured"
    """Whether the law uses the measured angles, as (8), or the estimated ones, as the text after (10)."""
    compensate_turning: bool = True
    """Several axes: whether the gimbals also turn against what a turn about the vertical couples."""
    bias_trim_s: Instant = 0.0
    """For so long from the start the integrator is held where the observer's bias estimate asks for it."""

    @model_validator(mode="after")
    def _one_source_of_gains(self) -> ControllerSettings:
        if self.gains is not None and self.lqr is not None:
            raise ValueError("give either gains or lqr, not both")
        return self

    @property
    def parameters(self) -> dict[str, Any]:
        """What was given that belongs to the law alone."""
        return dict(self.__pydantic_extra__ or {})

    def law(self, model: ReducedModel, noise: TiltNoise) -> Law:
        """The law for a reduced model and the sensors' noise."""
        parameters = self.parameters
        if self.gains is not None:
            carried = self.gains == "scaled"
            parameters["gains"] = scaled_gains(model) if carried else self.gains
        elif self.lqr is not None:
            parameters["gains"] = lqr_gains(model, self.lqr.state_cost, self.lqr.input_cost)
        return make_law(self.kind, 1.0 / self.rate_hz, self.rate_limit_rad_s, model, noise, **parameters)


COMMON_LAW_FIELDS = tuple(name for name in ControllerSettings.model_fields if name not in ("kind", "gains", "lqr"))
"""Fields of [controller] that every law has."""


class ObserverSettings(BaseModel):
    """An observer by name or dotted path, and its parameters, which the observer itself checks."""

    model_config = ConfigDict(extra="allow", frozen=True)
    kind: str = "homogeneous"
    """A name that `cmg-mj list observers` shows, or package.module:Class."""

    @property
    def parameters(self) -> dict[str, Any]:
        """What was given besides the kind."""
        return dict(self.__pydantic_extra__ or {})

    def make(self, dt: float, model: ReducedModel, noise: TiltNoise) -> Observer:
        """Construct the observer."""
        return make_observer(self.kind, dt, model, noise, **self.parameters)


@dataclass(frozen=True, config=STRICT)
class MetricsSettings:
    """What counts as settled and as fallen, and from when on a bias estimate is judged.

    Attributes:
        settle_band_deg: Settled is |x1| inside this band until the end [deg].
        fall_angle_deg: Fallen is |q_b + pi/4| beyond this angle [deg].
        bias_from_s: A bias estimate is judged from this time on, when it has had time to converge [s].
    """

    settle_band_deg: Positive = 1.0
    fall_angle_deg: Annotated[float, Field(gt=0.0, lt=90.0)] = 30.0
    bias_from_s: Instant = 5.0


class CompareSettings(BaseModel):
    """What `cmg-mj compare` does if it is not told otherwise; other commands do without."""

    model_config = FORBID
    observers: Annotated[list[str], Field(min_length=1)] | Literal["all"] = "all"
    """Observers to compare; the scenario's own with its parameters, the others with their defaults."""
    worlds: Annotated[int, Field(ge=1)] = 20
    """Runs an observer."""

    def names(self) -> list[str]:
        """The observers, spelled out."""
        return list(OBSERVERS) if self.observers == "all" else list(dict.fromkeys(self.observers))


class AxisPlant(BaseModel):
    """What of [plant] an axis may have of its own."""

    model_config = FORBID
    equilibrium_bias_deg: Annotated[float, Field(gt=-45.0, lt=45.0)] | None = None
    """e about this axis."""
    initial_tilt_deg: Annotated[float, Field(gt=-45.0, lt=45.0)] | None = None
    """x1(0) about this axis."""
    accelerometer_inner_m: Positive | None = None
    """Distance of its inner accelerometer."""
    accelerometer_outer_m: Positive | None = None
    """Distance of its outer accelerometer."""


class AxisSettings(BaseModel):
    """What one axis of several has of its own, in the words of the sections that hold for all."""

    model_config = FORBID
    plant: AxisPlant = Field(default_factory=AxisPlant)
    controller: dict[str, Any] = Field(default_factory=dict)
    """Fields of [controller] but rate_hz."""
    observer: dict[str, Any] = Field(default_factory=dict)
    """Fields of [observer]."""
    sensors: dict[str, Any] = Field(default_factory=dict)
    """Sections of [sensors]."""


class Scenario(BaseModel):
    """One experiment."""

    model_config = FORBID
    title: Line = ""
    duration_s: Duration = 15.0
    seed: Annotated[int, Field(ge=0)] = 0
    plant: PlantSettings = Field(default_factory=PlantSettings)
    controller: ControllerSettings = Field(default_factory=ControllerSettings)
    observer: ObserverSettings = Field(default_factory=ObserverSettings)
    open_loop_observers: list[str] | Literal["all"] = Field(default_factory=list)
    """Observers that ride along open loop, with their default parameters."""
    sensors: Sensors = Field(default_factory=Sensors)
    axes: dict[str, AxisSettings] = Field(default_factory=dict)
    """What axes of several have of their own, by name."""
    push: list[Push] = Field(default_factory=list)
    swing: list[Swing] = Field(default_factory=list)
    metrics: MetricsSettings = Field(default_factory=MetricsSettings)
    compare: CompareSettings | None = None
    """Written by `cmg-mj compare`, so that its scenario runs to the same comparison."""
    based_on: str = ""
    """The bundled scenario that this one is told apart from in folders' names, titles and summaries."""
    versions: dict[str, str] = Field(default_factory=dict)
    """Written by a run, not read."""
    _source: str = PrivateAttr("")
    """What to call it in an error: the file, and what was changed in it."""

    def with_observer(self, kind: str) -> Scenario:
        """The same experiment with another observer in the loop; its own keeps the parameters given for it.

        On a rig of several axes it is that of all: what an axis has of another's own goes.
        """
        common = self.observer.kind
        axes = {
            name: own if own.observer.get("kind", common) == kind else own.model_copy(update={"observer": {}})
            for name, own in self.axes.items()
        }
        observer = self.observer if kind == common else ObserverSettings(kind=kind)
        return self.model_copy(update={"observer": observer, "axes": axes})

    def with_law(self, kind: str) -> Scenario:
        """The same experiment with another control law, with its default parameters, on all axes."""
        common = self.controller.kind
        axes = {
            name: own
            if own.controller.get("kind", common) == kind
            else own.model_copy(
                update={"controller": {n: v for n, v in own.controller.items() if n in COMMON_LAW_FIELDS}}
            )
            for name, own in self.axes.items()
        }
        if kind == common:
            return self.model_copy(update={"axes": axes})
        fields: dict[str, Any] = {name: getattr(self.controller, name) for name in COMMON_LAW_FIELDS}
        return self.model_copy(update={"controller": ControllerSettings(**fields, kind=kind), "axes": axes})

    def open_loop_names(self) -> list[str]:
        """The open-loop observers, spelled out, without the observer itself."""
        names = list(OBSERVERS) if self.open_loop_observers == "all" else list(self.open_loop_observers)
        return [name for name in dict.fromkeys(names) if name != self.observer.kind]
