"""Writes the pages of scenario fields and of commands: python docs/reference_pages.py (a second).

Units, defaults, limits and meanings come from the schema, the observers and the laws; options come from click's
parameters. Only examples, durations and the pages' own sentences stand here.
"""

from __future__ import annotations

import ast
import functools
import inspect
import re
import textwrap
import tomllib
import types
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple, Union, get_args, get_origin

import click
from pydantic import BaseModel
from pydantic_core import PydanticUndefined

from cmg_mj.cli import HELP, Commands, cli
from cmg_mj.features.bend import Bend
from cmg_mj.features.export.constants import attribute_descriptions
from cmg_mj.features.gait import Gait
from cmg_mj.features.pivot import FIELDS_OF, Pivot
from cmg_mj.features.track import Track
from cmg_mj.inputs.files import bundled, folder
from cmg_mj.inputs.messages import fields_of
from cmg_mj.inputs.types import OnAllAxes, OnGrid, PerAxis, marked_fields
from cmg_mj.inputs.user_classes import UserClassKind
from cmg_mj.laws import LAW_CLASSES
from cmg_mj.observers import OBSERVER_CLASSES
from cmg_mj.scenario.plant_settings import PlantSettings
from cmg_mj.scenario.schema import CompareSettings, ControllerSettings, LqrSettings, MetricsSettings, Scenario
from cmg_mj.sensors.accelerometer import Accelerometer, Encoder
from cmg_mj.sensors.gyros import Fog, MemsGyro
from cmg_mj.stages.push import Push
from cmg_mj.stages.swing import Swing

DOCS = Path(__file__).resolve().parent
WRITTEN = "<!-- Written by `python docs/reference_pages.py`; edit that file or the docstrings it reads. -->"
WIDTH = 100
NONE = "-"

# --- scenarios -----------------------------------------------------------------------------------------------

UNITS = {
    "_ug_rthz": "ug/rtHz",
    "_per_revolution": "counts/rev",
    "_per_deg_s": "counts/(deg/s)",
    "_per_g": "counts/g",
    "_deg_s_rthz": "deg/s/rtHz",
    "_deg_s_k": "deg/s/K",
    "_k_min": "K/min",
    "_deg_rth": "deg/rt(h)",
    "_deg_h": "deg/h",
    "_deg_s": "deg/s",
    "_rad_s": "rad/s",
    "_kg_m2": "kg m^2",
    "_kg_m": "kg m",
    "_n_m_s_rad": "N m s/rad",
    "_n_m_rad": "N m/rad",
    "_n_m_s": "N m s/rad",
    "_n_m": "N m",
    "_m_s2": "m/s^2",
    "_arcmin": "arcmin",
    "_deg": "deg",
    "_hz": "Hz",
    "_mm": "mm",
    "_mg": "mg",
    "_ug": "ug",
    "_g": "g",
    "_m": "m",
    "_s": "s",
}
"""The end of a field's name -> its unit; the first that fits."""

EXAMPLES = {
    "title": '"A harder push"',
    "duration_s": "10.0",
    "seed": "7",
    "open_loop_observers": '["linear", "gyro_free"]',
    "based_on": '"push_recovery"',
    "versions": '{ cmg_mj = "0.1.0" }',
    "plant.model": '"my_pair.xml"',
    "plant.equilibrium_bias_deg": "1.0",
    "plant.initial_tilt_deg": "2.0",
    "plant.timestep_s": "0.001",
    "plant.integrator": '"implicitfast"',
    "plant.lock_thrust_bearing": "true",
    "plant.locked_axes": '["pitch"]',
    "plant.turn_rate_rad_s": "1.0",
    "plant.gimbal_armature_kg_m2": "0.002",
    "plant.gimbal_friction_n_m": "0.1",
    "plant.gimbal_damping_n_m_s": "0.01",
    "plant.gimbal_backlash_arcmin": "20.0",
    "plant.servo_stiffness_n_m_rad": "50.0",
    "plant.servo_damping_n_m_s_rad": "1.0",
    "plant.accelerometer_inner_m": "0.05",
    "plant.accelerometer_outer_m": "0.3",
    "plant.accelerometer_inner_across_m": "0.02",
    "plant.accelerometer_outer_across_m": "-0.02",
    "plant.accelerometer_inner_angle_deg": "90.0",
    "plant.accelerometer_outer_angle_deg": "180.0",
    "plant.tilt_inertia_kg_m2": "0.3",
    "plant.tilt_gravity_n_m": "7.0",
    "plant.flywheel_momentum_n_m_s": "0.5",
    "plant.accelerometer_inner_misplaced_mm": "1.0",
    "plant.accelerometer_outer_misplaced_mm": "-1.0",
    "plant.pivot_slides": "true",
    "plant.tilt_friction_n_m": "0.01",
    "plant.tilt_damping_n_m_s": "0.02",
    "plant.flywheel_speed_rad_s": "300.0",
    "plant.flywheel_imbalance_kg_m": "1e-6",
    "gait.steps": "22",
    "gait.step_length_m": "0.15",
    "gait.single_s": "0.4",
    "gait.double_s": "0.3",
    "gait.lift_m": "0.03",
    "gait.stand_s": "2.0",
    "gait.width_m": "0.08",
    "gait.lean_s": "0.5",
    "gait.tiles_m": "0.002",
    "gait.switch_force_n": "10.0",
    "gait.switch_delay_s": "0.01",
    "gait.switch_bounce_s": "0.01",
    "track.file": '"nod.csv"',
    "track.start_s": "1.0",
    "bend.frequency_hz": "25.0",
    "bend.damping_ratio": "0.02",
    "bend.share": "0.3",
    "bend.beyond": '"both"',
    "controller.kind": '"lqg"',
    "controller.rate_hz": "100.0",
    "controller.gains": '"scaled"',
    "controller.lqr": "see below",
    "controller.lqr.state_cost": "[400.0, 2.0, 0.2, 0.1]",
    "controller.lqr.input_cost": "2.0",
    "controller.rate_limit_rad_s": "3.0",
    "controller.feedback": '"truth"',
    "controller.angle_source": '"estimated"',
    "controller.compensate_turning": "false",
    "controller.bias_trim_s": "1.0",
    "controller.notch_hz": "25.0",
    "observer.kind": '"gyro_free"',
    "sensors.accelerometer.rate_hz": "100.0",
    "sensors.accelerometer.noise_density_ug_rthz": "100.0",
    "sensors.accelerometer.bias_mg": "[5.0, -5.0]",
    "sensors.accelerometer.range_g": "4.0",
    "sensors.accelerometer.counts_per_g": "8192.0",
    "sensors.accelerometer.latency_s": "0.005",
    "sensors.accelerometer.scale_error": "[0.01, -0.01]",
    "sensors.accelerometer.misalignment_deg": "[0.5, 0.0]",
    "sensors.accelerometer.cross_axis": "[0.02, 0.0]",
    "sensors.accelerometer.skew_s": "0.0025",
    "sensors.accelerometer.bias_instability_ug": "40.0",
    "sensors.accelerometer.bandwidth_hz": "94.0",
    "sensors.accelerometer.vibration_mg": "30.0",
    "sensors.accelerometer.vibration_band_hz": "[10.0, 80.0]",
    "sensors.accelerometer.wheel_harmonics_mg": "[20.0, 5.0]",
    "sensors.encoder.rate_hz": "100.0",
    "sensors.encoder.counts_per_revolution": "1024.0",
    "sensors.encoder.latency_s": "0.002",
    "sensors.fog.rate_hz": "100.0",
    "sensors.fog.angle_random_walk_deg_rth": "0.1",
    "sensors.fog.bias_deg_h": "5.0",
    "sensors.fog.bandwidth_hz": "50.0",
    "sensors.fog.range_deg_s": "300.0",
    "sensors.fog.latency_s": "0.001",
    "sensors.mems_gyro.reading": '"calibrated"',
    "sensors.mems_gyro.noise_density_deg_s_rthz": "0.01",
    "sensors.mems_gyro.bias_instability_deg_h": "40.0",
    "sensors.mems_gyro.scale_error": "0.01",
    "sensors.mems_gyro.bias_deg_s": "0.2",
    "sensors.mems_gyro.calibration_s": "0.0",
    "sensors.mems_gyro.as_bought_offset_deg_s": "5.0",
    "sensors.mems_gyro.as_bought_drift_deg_s_k": "0.1",
    "sensors.mems_gyro.warming_k_min": "0.0",
    "sensors.mems_gyro.range_deg_s": "500.0",
    "sensors.mems_gyro.counts_per_deg_s": "65.5",
    "push.start_s": "2.0",
    "push.duration_s": "0.2",
    "push.torque_n_m": "-1.5",
    "push.axis": '"roll"',
    "swing.frequency_hz": "2.0",
    "swing.amplitude_n_m": "0.3",
    "swing.phase_deg": "90.0",
    "swing.start_s": "1.0",
    "swing.duration_s": "4.0",
    "swing.axis": '"roll"',
    "pivot.kind": '"sine"',
    "pivot.direction": '"vertical"',
    "pivot.acceleration_m_s2": "0.5",
    "pivot.frequency_hz": "1.0",
    "pivot.phase_deg": "90.0",
    "pivot.corner_hz": "2.0",
    "pivot.file": '"cart.csv"',
    "pivot.column": '"ax"',
    "pivot.scale": "0.5",
    "pivot.start_s": "1.0",
    "pivot.duration_s": "4.0",
    "pivot.axis": '"roll"',
    "metrics.settle_band_deg": "0.5",
    "metrics.fall_angle_deg": "20.0",
    "metrics.bias_from_s": "3.0",
    "compare.observers": '["linear", "gyro_free"]',
    "compare.worlds": "50",
}
"""Field -> a value other than its default, as TOML has it."""

OBSERVER_EXAMPLES = {
    "linear": "tau=0.01",
    "ltv": "Q=[1,1e7,1]",
    "homogeneous": "k1=25",
    "luenberger": "L=[[30,0],[200,0],[0,30]]",
    "kalman": "torque_walk=0.1",
    "gyro_free": "bias_start=1.0",
    "free_pivot": "pivot_hz=2",
    "mems_fused": "walk_factor=2",
    "super_twisting": "L=20",
    "linear_high_gain": "epsilon=0.02",
    "high_gain": "d_inf=0.5",
    "adaptive": "torque=true",
    "homogeneous_adaptive": "alpha=0.9",
}
"""Observer -> a parameter other than its default."""
GAINS_ARE_COMMON = "Its gains are the fields `gains` and `lqr` of [`[controller]`](scenario.md#controller)."
LAW_EXAMPLES = {"state_feedback": "controller.gains=[40,4,-1,0.3]", "lqg": "torque_walk=0.1"}
"""Law -> a parameter other than its default."""

SCENARIO_HEAD = """
# Scenario fields

A scenario is a TOML file that describes one experiment: the rig, its sensors, the controller, the observer and what
pushes the rig. Every field has a default, so a file holds only what differs:

```toml
title = "A harder push"
duration_s = 10.0

[plant]
equilibrium_bias_deg = 1.0

[observer]
kind = "gyro_free"

[[push]]
start_s = 2.0
torque_n_m = 1.5
```

Save the text as `harder.toml`. `cmg-mj check harder.toml` names every wrong field, and
`cmg-mj run harder.toml` runs the scenario in two seconds. The folder of a run has a `scenario.toml` with all
fields written out.

One field changes on the command line with its section before its name: `--set plant.equilibrium_bias_deg=1.0`. Lists of
sections have a number: `--set push.0.torque_n_m=1.5`. Quote values with brackets for the shell:
`--set 'open_loop_observers=["ltv"]'`. A whole list replaces the file's:
`--set 'push=[{start_s=2.0},{start_s=6.0,torque_n_m=0.5}]'`.

How to read the tables:

- An example is a value as it stands in the file after `field = `.
- A default of `-` means that the field is not set. For a plant, the model file then decides.
- *On the step grid*: a rate or a time that is a whole number of physics steps. Without `plant.timestep_s` the step is
  chosen to fit.
- Symbols such as x1, u and K_e are those of the [glossary](glossary.md).
"""
BUNDLED_HEAD = """
## Bundled scenarios

`cmg-mj run NAME` runs one in about two seconds. `cmg-mj list scenarios` prints the names.
"""
SECTION_NOTES = {
    "": "These fields stand before the first section.",
    "controller": "A law has further parameters of its own: [observers and laws](scenario_observers.md).",
    "controller.lqr": "Example: `--set 'controller.lqr.state_cost=[1,1,1,1]'`.",
    "observer": "An observer has further parameters of its own: [observers and laws](scenario_observers.md).",
    "push": "A scenario may have several pushes. Each stands under its own heading `[[push]]`.",
    "swing": "Each swing stands under its own heading `[[swing]]`.",
    "pivot": "Each motion of the pivot stands under its own heading `[[pivot]]`.",
}
AXES = """
## `[axes.NAME]`

A rig of several axes, such as `two_axes`, may have settings for one axis. They stand in the same sections below the
axis' name:

```toml
[axes.pitch.plant]
equilibrium_bias_deg = -0.3

[axes.pitch.observer]
kind = "gyro_free"

[axes.pitch.sensors.accelerometer]
noise_density_ug_rthz = 100.0
```

| section | fields | default | allowed values | example |
| --- | --- | --- | --- | --- |
| `axes.NAME.plant` | {plant} | those of `[plant]` | those of `[plant]` | `equilibrium_bias_deg = -0.3` |
| `axes.NAME.controller` | all of `[controller]` but {all_axes} | those of `[controller]` | those of `[controller]` | \
`rate_limit_rad_s = 3.0` |
| `axes.NAME.observer` | all of `[observer]` | those of `[observer]` | those of `[observer]` | `kind = "ltv"` |
| `axes.NAME.sensors` | all of [`[sensors]`](scenario_sensors.md) | those of `[sensors]` | those of `[sensors]` | \
`accelerometer = {{ rate_hz = 100.0 }}` |

[two_axes.md](two_axes.md) explains rigs of several axes.
"""
MORE = """
## More

- Sensors, swings and motions of the pivot: [scenario_sensors.md](scenario_sensors.md)
- Parameters of observers and laws: [scenario_observers.md](scenario_observers.md)
- Your own laws: [laws.md](laws.md)
"""
PIVOT_KINDS = """
Each kind needs its own fields:

| kind | fields | example |
| --- | --- | --- |
"""
PIVOT_EXAMPLES = {
    "sine": 'kind = "sine", acceleration_m_s2 = 0.5, frequency_hz = 1.0',
    "step": 'kind = "step", acceleration_m_s2 = 0.2, start_s = 3.0',
    "track": 'kind = "track", file = "cart.csv", column = "ax"',
    "noise": 'kind = "noise", acceleration_m_s2 = 0.1, corner_hz = 2.0',
}
SENSORS_HEAD = """
# Scenario fields: sensors, swings, pivot

These sections belong to a [scenario](scenario.md), which explains the tables. Sensor errors beyond noise, range and
resolution are off by default. [sensor_errors.md](sensor_errors.md) shows the effect of each error on the observers,
[real_rigs.md](real_rigs.md) that of a moving pivot.

```toml
[sensors.accelerometer]
noise_density_ug_rthz = 100.0
skew_s = 0.0025
```
"""
OWN_TABLES = (
    "plant",
    "bend",
    "gait",
    "controller",
    "observer",
    "sensors",
    "axes",
    "push",
    "track",
    "swing",
    "pivot",
    "metrics",
    "compare",
)
"""Sections of a scenario."""
SENSOR_SECTIONS: dict[str, type] = {
    "sensors.accelerometer": Accelerometer,
    "sensors.encoder": Encoder,
    "sensors.fog": Fog,
    "sensors.mems_gyro": MemsGyro,
    "swing": Swing,
    "pivot": Pivot,
}
"""Sections of the second page: name -> class."""
OBSERVERS_HEAD = """
# Scenario fields: observers and laws

`observer.kind` and `controller.kind` select an observer and a control law by name, or your own class as
`package.module:Class`. The other fields of these sections are the parameters of that class. A file has them below the
kind:

```toml
[observer]
kind = "linear"
tau = 0.01
```

On the command line the observer has an option of its own:
`cmg-mj run push_recovery --observer linear --set observer.tau=0.01`. Parameters whose default is a table of numbers
need quotes: `--set 'observer.Q=[1,1e7,1]'`.

`cmg-mj list observers` and `cmg-mj list laws` print names and defaults. The equations are in the
[API reference](api/observers.md). [Which observer?](which_observer.md) says where each leads and where it fails.
"""


class Row(NamedTuple):
    """A field's row in a table.

    Attributes:
        field: Its name, with its sections.
        unit: Its unit, or `-`.
        default: Its default, as TOML has it.
        allowed: Allowed values.
        example: An example, as TOML has it; empty for none.
        meaning: One line.
    """

    field: str
    unit: str
    default: str
    allowed: str
    example: str
    meaning: str


def scenario_sections() -> dict[str, type]:
    """Return the sections of the first page: name -> class."""
    return {
        "": Scenario,
        "plant": PlantSettings,
        "bend": Bend,
        "gait": Gait,
        "controller": ControllerSettings,
        "controller.lqr": LqrSettings,
        "observer": type(Scenario().observer),
        "push": Push,
        "track": Track,
        "metrics": MetricsSettings,
        "compare": CompareSettings,
    }


def section_class(annotation: Any) -> type | None:
    """Return the class of a section that a field is, may be, or lists; None for a value."""
    for part in get_args(annotation):
        if found := section_class(part):
            return found
    return annotation if isinstance(annotation, type) and fields_of(annotation) else None


def rows_of(section: str, cls: type, examples: Mapping[str, str] = EXAMPLES) -> Iterator[Row]:
    """Make the rows of a section's fields; sections below it have tables of their own."""
    descriptions, grid = _descriptions(cls), marked_fields(cls, OnGrid)
    defaults = _defaults(cls)
    for name, annotation in fields_of(cls).items():
        field = f"{section}.{name}".lstrip(".")
        if not section and name in OWN_TABLES:
            continue
        allowed = allowed_values(annotation) + (", on the step grid" if name in grid else "")
        meaning, unit = _without_unit(descriptions.get(name, ""), name)
        default = defaults[name]
        required = default is PydanticUndefined
        yield Row(field, unit, "required" if required else _toml(default), allowed, examples.get(field, ""), meaning)


def parameter_rows(classes: UserClassKind, kind: str) -> Iterator[Row]:
    """Make the rows of the parameters that an observer or a law has for itself."""
    cls = classes.find(kind)
    types, descriptions, own = fields_of(cls), attribute_descriptions(cls.__doc__ or ""), classes.own(kind)
    for name in own:
        meaning, unit = _without_unit(descriptions.get(name, ""), name)
        allowed = allowed_values(types[name]) if name in types else ""
        default = classes.takes(kind)[name].default
        yield Row(name, unit, _toml(default), allowed, "", meaning)


def expected(annotation: Any) -> str:
    """Say what a field takes, from its type: `a number greater than 0`.

    Args:
        annotation: The field's type, with its bounds.

    Returns:
        A noun phrase.
    """
    base, bounds = _unwrapped(annotation)
    origin, arguments = get_origin(base), get_args(base)
    if origin in (Union, types.UnionType):
        return " or ".join(expected(part) for part in arguments if part is not types.NoneType)
    if origin is Literal:
        choices = ", ".join(repr(choice) for choice in arguments)
        return choices if len(arguments) == 1 else f"one of {choices}"
    if origin is list or arguments[1:] == (...,):
        return f"a list of {_plural(expected(arguments[0]))}"
    if origin is tuple:
        return f"a list of {len(arguments)} {_plural(expected(arguments[0]))}"
    if base is bool:
        return "true or false"
    if base is str:
        return " ".join(["text in quotes", *_text_bounds(bounds)])
    if base in (int, float):
        kind = "a whole number" if base is int else "a number"
        return " ".join([kind, " and ".join(_bounds(bounds))]).strip()
    return "a section"


def _unwrapped(annotation: Any) -> tuple[Any, list[Any]]:
    """Return a type without `Annotated`, and all bounds on it."""
    bounds: list[Any] = []
    while get_origin(annotation) is Annotated:
        annotation, *extra = get_args(annotation)
        for item in extra:
            bounds += getattr(item, "metadata", None) or [item]  # pydantic's FieldInfo keeps the bounds in a list
    return annotation, bounds


def _bounds(metadata: Iterable[Any]) -> list[str]:
    names = (("gt", "greater than"), ("ge", "greater than or equal to"), ("lt", "less than"), ("le", "at most"))
    return [
        f"{words} {getattr(bound, name):g}"
        for bound in metadata
        for name, words in names
        if getattr(bound, name, None) is not None
    ]


def _text_bounds(metadata: Iterable[Any]) -> list[str]:
    longest = [f"of at most {bound.max_length} characters" for bound in metadata if hasattr(bound, "max_length")]
    return [*longest, *(["without control characters"] if any(hasattr(bound, "pattern") for bound in metadata) else [])]


def _plural(phrase: str) -> str:
    """Turn `a number greater than 0` into `numbers greater than 0`."""
    for one, many in (
        ("a whole number", "whole numbers"),
        ("a number", "numbers"),
        ("a list", "lists"),
        ("a section", "sections"),
        ("text in quotes", "names in quotes"),
    ):
        if phrase.startswith(one):
            return many + phrase[len(one) :]
    return phrase


def allowed_values(annotation: Any) -> str:
    """Say what a field takes, shorter than an error message does."""
    text = expected(annotation)
    for long, short in (
        ("greater than or equal to ", "≥ "),
        ("greater than ", "> "),
        ("less than ", "< "),
        ("at most ", "≤ "),
        ("text in quotes of ≤ ", "text of at most "),
        ("e+0", "e"),
        ("e-0", "e-"),
    ):
        text = text.replace(long, short)
    text = re.sub(r"\ba number ([≥>≤<])", r"\1", text)
    text = re.sub(r"one of ", "", text)
    text = re.sub(r"'([^']*)'", r'`"\1"`', text)
    text = re.sub(r"\btrue or false", "`true` or `false`", text)
    return text.replace("text in quotes", "text").replace("names in quotes", "names")


def _descriptions(cls: type) -> dict[str, str]:
    """Read what a class says of its fields: under `Attributes:`, or below each field."""
    texts: dict[str, str] = {}
    for base in reversed(cls.__mro__):
        texts |= attribute_descriptions(base.__doc__ or "")
    models = [base for base in reversed(cls.__mro__) if issubclass(base, BaseModel) and base is not BaseModel]
    for model in models:
        body = ast.parse(textwrap.dedent(inspect.getsource(model))).body[0]
        assert isinstance(body, ast.ClassDef)
        for field, below in zip(body.body, body.body[1:], strict=False):
            if isinstance(field, ast.AnnAssign) and isinstance(field.target, ast.Name) and isinstance(below, ast.Expr):
                assert isinstance(below.value, ast.Constant)
                texts[field.target.id] = " ".join(str(below.value.value).split())
    return texts


def _defaults(cls: type) -> dict[str, Any]:
    infos = cls.__pydantic_fields__  # pyright: ignore[reportAttributeAccessIssue]
    return {name: info.get_default(call_default_factory=True, validated_data={}) for name, info in infos.items()}


def _without_unit(text: str, name: str) -> tuple[str, str]:
    """Take the unit out of a description, or find it by the end of the field's name."""
    units = re.findall(r" \[((?:\d|\(|[a-zA-Z]+\b(?!_))[^\],_]*)\]", text)
    units = [unit for unit in units if unit not in SECTION_WORDS]
    if len(units) == 1:
        return text.replace(f" [{units[0]}]", ""), units[0]
    by_name = next((unit for ending, unit in UNITS.items() if name.endswith(ending)), NONE)
    return text, "see meaning" if units else by_name


SECTION_WORDS = ("plant", "controller", "observer", "sensors", "compare", "axes")
"""Words in brackets that are no units."""


def _toml(value: Any) -> str:
    """Write a value as TOML has it."""
    if value is None or value == "" or isinstance(value, dict):
        return NONE
    if isinstance(value, bool):
        return f"`{str(value).lower()}`"
    if isinstance(value, str):
        return f'`"{value}"`'
    if isinstance(value, (tuple, list)):
        return f"`[{', '.join(_toml(part).strip('`') for part in value)}]`"
    if hasattr(value, "tolist"):
        return _toml(value.tolist())
    return f"`{_number(value)}`"


def _number(value: float) -> str:
    text = repr(value) if isinstance(value, int) else f"{value:.6g}"
    text = re.sub(r"e([+-])0*", lambda sign: "e" + sign[1].replace("+", ""), text)
    return text if isinstance(value, int) or "." in text or "e" in text else f"{text}.0"


def _cell(text: str) -> str:
    return _links(text).replace("|", r"\|") or NONE


def _links(text: str) -> str:
    """Turn the names of documents into links."""
    text = re.sub(r"(?<![\w/\[`])(?<!\]\()docs/(\w+\.md)", r"[\1](\1)", text)
    return re.sub(r"(?<![\w/(\[`])(docs/[\w/]+\.py|\w+\.py)", r"`\1`", text)


def _table(head: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    lines = [list(head), ["---" for _ in head], *map(list, rows)]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in lines)


def _field_table(rows: Iterable[Row], *, with_examples: bool = True, full_names: bool = False) -> str:
    head = ["field", "unit", "default", "allowed values", "example", "meaning"]
    cells = []
    for row in rows:
        name = row.field if full_names else row.field.rpartition(".")[2]
        example = f"`{row.example}`" if row.example and not row.example.startswith("see") else row.example
        cells.append([f"`{name}`", row.unit, row.default, _cell(row.allowed), example, _cell(row.meaning)])
    if not with_examples:
        head, cells = ["parameter", *head[1:4], head[5]], [[*row[:4], row[5]] for row in cells]
    return _table(head, cells)


def _about(cls: type) -> str:
    """Return what a section's class says of itself, without its attributes."""
    return _prose(_links(inspect.cleandoc(cls.__doc__ or "").split("\nAttributes:\n")[0]))


def _prose(text: str) -> str:
    """Wrap paragraphs and lists; code blocks, tables and headings stay."""
    parts = []
    for part in re.split(r"\n\n(?=(?:[^`]|`(?!``))*(?:```(?:[^`]|`(?!``))*```(?:[^`]|`(?!``))*)*$)", text.strip()):
        if part.startswith(("```", "|", "#")):
            parts.append(part)
        elif part.startswith("- "):
            items = re.split(r"\n(?=- )", part)
            parts.append("\n".join(_wrapped(item[2:], "- ", "  ") for item in items))
        else:
            parts.append(_wrapped(part))
    return "\n\n".join(parts)


def _wrapped(paragraph: str, first: str = "", rest: str = "") -> str:
    """Wrap one paragraph at 100 columns; code and links stay in one piece."""
    whole = re.sub(r"`[^`]*`|\[[^\]]*\]\([^)]*\)", lambda m: m[0].replace(" ", "\0"), " ".join(paragraph.split()))
    filled = textwrap.fill(
        whole, WIDTH, initial_indent=first, subsequent_indent=rest, break_long_words=False, break_on_hyphens=False
    )
    return filled.replace("\0", " ")


def _bundled_table() -> str:
    rows = []
    for name in bundled("scenarios"):
        text = (folder("scenarios") / f"{name}.toml").read_text(encoding="utf-8")
        comment = " ".join(line.lstrip("# ") for line in text.split("\n\n")[0].splitlines() if line.startswith("#"))
        rows.append([f"`{name}`", tomllib.loads(text)["title"], _cell(comment)])
    return _table(["scenario", "title", "what it is"], rows)


def _section(section: str, cls: type) -> str:
    heading = {
        "": "Top of the file",
        "push": "`[[push]]`",
        "track": "`[[track]]`",
        "swing": "`[[swing]]`",
        "pivot": "`[[pivot]]`",
    }.get(section, f"`[{section}]`")
    parts = [f"## {heading}", "" if cls is Scenario else _about(cls)]
    parts += [_prose(SECTION_NOTES.get(section, "")), _field_table(rows_of(section, cls))]
    if cls is Pivot:
        kinds = [
            [f"`{kind}`", ", ".join(f"`{name}`" for name in names), f"`{PIVOT_EXAMPLES[kind]}`"]
            for kind, names in FIELDS_OF.items()
        ]
        parts.append(PIVOT_KINDS.strip() + "\n" + "\n".join(f"| {' | '.join(cells)} |" for cells in kinds))
    return "\n\n".join(part for part in parts if part)


def scenario_page() -> str:
    """Write the page of a scenario's fields."""
    axes = AXES.format(
        plant=", ".join(f"`{name}`" for name in marked_fields(PlantSettings, PerAxis)),
        all_axes=" and ".join(f"`{name}`" for name in marked_fields(ControllerSettings, OnAllAxes)),
    )
    sections = [_section(section, cls) for section, cls in scenario_sections().items()]
    text = "\n\n".join([_prose(SCENARIO_HEAD), BUNDLED_HEAD.strip(), _bundled_table(), *sections])
    return _page(text, _prose(axes), _prose(MORE))


def sensors_page() -> str:
    """Write the page of the sensors' fields."""
    return _page(_prose(SENSORS_HEAD), *(_section(section, cls) for section, cls in SENSOR_SECTIONS.items()))


def observers_page() -> str:
    """Write the page of the parameters of observers and laws."""
    parts = [_prose(OBSERVERS_HEAD)]
    for title, classes, examples, option in (
        ("Observer", OBSERVER_CLASSES, OBSERVER_EXAMPLES, "--observer {kind} --set 'observer.{example}'"),
        ("Law", LAW_CLASSES, LAW_EXAMPLES, "--set controller.kind={kind} --set 'controller.{example}'"),
    ):
        for kind in classes.known:
            rows = [row for row in parameter_rows(classes, kind) if row.field not in ControllerSettings.model_fields]
            about = _wrapped(_links((classes.find(kind).__doc__ or "").partition("\n")[0]))
            parts += [f"## {title} `{kind}`", about]
            if rows:
                example = option.format(kind=kind, example=examples[kind])
                parts += [
                    _field_table(rows, with_examples=False),
                    f"Example: `cmg-mj run push_recovery {example}`",
                ]
            elif kind in examples:
                parts.append(f"{GAINS_ARE_COMMON}\n\nExample: `cmg-mj run push_recovery --set '{examples[kind]}'`")
            else:
                parts.append("This class has no parameters.")
    return _page(*parts)


def _page(*parts: str) -> str:
    return "\n\n".join([WRITTEN, *parts]) + "\n"


# --- commands ------------------------------------------------------------------------------------------------


class Notes(NamedTuple):
    """What a command's section says beyond its help.

    Attributes:
        takes: How long it takes on two cores.
        examples: Command lines.
        more: Page to read on.
    """

    takes: str
    examples: tuple[str, ...]
    more: str = ""


LOG = "examples/data/stepper_encoder_gyro.csv"
COLUMNS = "--columns time=time_s,tilt=encoder_rad,rate=gyr_y_rad_s"
TORSO = "examples/robots/torso.xml --body torso --axis x --scale 1.21"
COMMANDS: dict[str, Notes] = {
    "run": Notes(
        "about two seconds for a bundled scenario.",
        (
            "cmg-mj run push_recovery",
            "cmg-mj run push_recovery --observer gyro_free --set plant.equilibrium_bias_deg=1.0 --plot",
        ),
        "python.md",
    ),
    "compare": Notes(
        "about 30 seconds for all observers in 20 worlds, about six seconds for two.",
        ("cmg-mj compare push_recovery --observers homogeneous,gyro_free", "cmg-mj compare push_recovery --plot"),
        "results.md",
    ),
    "list": Notes("less than a second.", ("cmg-mj list", "cmg-mj list observers")),
    "check": Notes(
        "about a second.",
        ("cmg-mj check push_recovery --set controller.rate_hz=100", "cmg-mj check scissored_pair.xml"),
        "scenario.md",
    ),
    "studio": Notes(
        "a few seconds to open; it stays open until you close it.",
        ("cmg-mj studio push_recovery --browser",),
        "studio.md",
    ),
    "sweep": Notes(
        "about 15 seconds for 200 trials; `--dry-run` estimates the time of yours.",
        ("cmg-mj sweep push_recovery --vary plant.equilibrium_bias_deg=-1:1:5 --observers linear,gyro_free",),
        "sweep.md",
    ),
    "tune": Notes(
        "about three seconds for `linear`, a minute for `kalman`, two for `free_pivot`.",
        ("cmg-mj tune observer_tuning --observer linear",),
        "api/tools.md",
    ),
    "tune-log": Notes(
        "about four seconds for a log of 40 seconds.",
        (f"cmg-mj tune-log {LOG} {COLUMNS} --observer linear",),
        "replay.md",
    ),
    "replay": Notes("about four seconds for a log of 40 seconds.", (f"cmg-mj replay {LOG} {COLUMNS}",), "replay.md"),
    "identify": Notes(
        "about five seconds for a log of 40 seconds.", (f"cmg-mj identify {LOG} {COLUMNS}",), "identify.md"
    ),
    "mount": Notes(
        "up to a minute, or two seconds with `--quick`.",
        (f"cmg-mj mount {TORSO} -o balanced.xml", "cmg-mj run balanced.toml"),
        "mount.md",
    ),
    "export": Notes("about two seconds.", ("cmg-mj export gyro_free --out firmware --precision single",), "export.md"),
    "plugin": Notes(
        "about three seconds.",
        ("cmg-mj plugin gyro_free --out balance && python balance/gyro_free_example.py",),
        "plugin.md",
    ),
    "reproduce": Notes(
        "about half a minute for `dao2023`, three minutes for `all`.",
        ("cmg-mj reproduce dao2023",),
        "reproduced.md",
    ),
}
"""Command -> examples and durations."""
NEEDS = {
    "plugin": "This command needs a C compiler.",
    "reproduce": 'This command needs the extra `papers`: `python -m pip install ".[papers]"`.',
}
"""Command -> what must be installed."""
COMMAND_PAGES = {
    "commands.md": ("run", "compare", "list", "check", "sweep", "tune", "studio"),
    "commands_tools.md": ("replay", "tune-log", "identify", "mount", "export", "plugin", "reproduce", "bench"),
}
"""Page -> its commands."""
ORDER = [name for names in COMMAND_PAGES.values() for name in names]
COMMON_FROM = 3
"""An option that means the same in so many commands stands in the table of common options."""
COMMANDS_HEAD = """
# Commands

`cmg-mj COMMAND --help` prints the same text in a terminal. `cmg-mj --version` prints the version. Times are those of
two cores of a desktop machine.

Files of the repository appear in some examples, such as `examples/robots/torso.xml`. Run these examples in a clone.
"""
TOOLS_HEAD = """
# Commands: logs, robots, code, papers

This page goes on from [commands.md](commands.md).
"""
COMMON_HEAD = """
## Common options
"""
OPTION_HEAD = ("option", "value", "default", "meaning")
TABLE_HEAD = """
## All commands

| command | what it is for | time |
| --- | --- | --- |
"""


@functools.cache
def leaf_commands() -> dict[str, click.Command]:
    """Return every command by its name."""
    context = click.Context(cli)
    commands = {name: cli.get_command(context, name) for name in cli.list_commands(context)}
    return {name: command for name, command in commands.items() if command is not None}


def option_row(option: click.Option) -> tuple[str, str, str, str]:
    """Return an option's row: names, value, default, meaning."""
    return f"`{', '.join(option.opts)}`", _value(option), _default(option), _meaning(option)


@functools.cache
def common_options() -> tuple[tuple[str, str, str, str], ...]:
    """Return the rows of options that mean the same in several commands."""
    rows = [option_row(option) for command in leaf_commands().values() for option in _options(command)]
    return tuple(row for row in dict.fromkeys(rows) if rows.count(row) >= COMMON_FROM)


def commands_page(page: str) -> str:
    """Write one of the pages of commands."""
    commands = leaf_commands()
    is_first = page == next(iter(COMMAND_PAGES))
    parts = [_prose(COMMANDS_HEAD if is_first else TOOLS_HEAD)]
    if is_first:
        rows = [
            [f"[`cmg-mj {words}`]({_page_of(words)}#cmg-mj-{words.replace(' ', '-')})", _short(words), _takes(words)]
            for words in sorted(commands, key=lambda words: ORDER.index(words.split()[0]))
        ]
        parts.append(TABLE_HEAD.strip() + "\n" + "\n".join(f"| {' | '.join(cells)} |" for cells in rows))
        parts += [_wrapped(text) for text in HELP.split("\n\n") if text.startswith(("Ctrl-C", "Exit status", "A scen"))]
        parts += [COMMON_HEAD.strip(), _table(OPTION_HEAD, common_options())]
    here = [words for words in commands if _page_of(words) == page]
    parts += [
        _command(words, commands[words]) for words in sorted(here, key=lambda words: ORDER.index(words.split()[0]))
    ]
    return _page(*parts)


def _page_of(words: str) -> str:
    return next(page for page, names in COMMAND_PAGES.items() if words.split()[0] in names)


def _short(words: str) -> str:
    return _cell(Commands.table[words].help)


def _takes(words: str) -> str:
    """Return how long a command takes, without the sentence's end."""
    return COMMANDS[words].takes.rstrip(".")


def _command(words: str, command: click.Command) -> str:
    notes = COMMANDS[words]
    usage = [f"cmg-mj {words}", "[OPTIONS]"] if _options(command) else [f"cmg-mj {words}"]
    usage += [_argument(parameter) for parameter in command.params if isinstance(parameter, click.Argument)]
    parts = [f"## `cmg-mj {words}`", f"```text\n{' '.join(usage)}\n```", *help_parts(command.help or "")]
    parts += [NEEDS[words]] if words in NEEDS else []
    examples = "\n".join(notes.examples)
    parts.append(f"Examples. Time: {notes.takes}" if len(notes.examples) > 1 else f"Example. Time: {notes.takes}")
    parts.append(f"```sh\n{examples}\n```")
    rows = [option_row(option) for option in _options(command)]
    if own := [row for row in rows if row not in common_options()]:
        parts.append(_table(OPTION_HEAD, own))
    if common := [row[0] for row in rows if row in common_options()]:
        page = "" if _page_of(words) == next(iter(COMMAND_PAGES)) else next(iter(COMMAND_PAGES))
        parts.append(_wrapped(f"[Common options]({page}#common-options): {', '.join(common)}."))
    if notes.more:
        parts.append(f"More: [{notes.more}]({notes.more}).")
    return "\n\n".join(parts)


def _options(command: click.Command) -> list[click.Option]:
    return [parameter for parameter in command.params if isinstance(parameter, click.Option)]


def _argument(argument: click.Argument) -> str:
    if isinstance(argument.type, click.Choice):
        return f"[{'|'.join(argument.type.choices)}]"
    name = argument.metavar or (argument.name or "").upper()
    return name if argument.required else f"[{name}]"


def help_parts(text: str) -> list[str]:
    """Make Markdown of a command's help: paragraphs wrapped, what is set as it stands in a code block."""
    parts = []
    for paragraph in inspect.cleandoc(text).split("\n\n"):
        if not paragraph.lstrip("\n").startswith("\b"):
            parts.append(_wrapped(_links(paragraph)))
            continue
        lines = paragraph.lstrip("\n").removeprefix("\b").strip("\n").splitlines()
        first = [line for line in lines if not line.startswith(" ")]
        block = textwrap.dedent("\n".join(line for line in lines if line.startswith(" ")))
        parts += [*first, f"```text\n{block}\n```"]
    return parts


def _help(option: click.Option) -> tuple[str, str, str]:
    """Divide an option's help into its meaning, its default, and its range."""
    text = " ".join((option.help or "").split())
    allowed = re.search(r" *\[x>=(\d+)\]", text)
    text = text.replace(allowed[0], "") if allowed else text
    default = re.search(r" *\[default: (.*)\]$", text)
    text = text.replace(default[0], "") if default else text
    return text, default[1] if default else "", f"≥ {allowed[1]}" if allowed else ""


def _value(option: click.Option) -> str:
    """Say what an option takes."""
    if option.is_flag:
        return "switch"
    if isinstance(option.type, click.Choice):
        return ", ".join(f"`{choice}`" for choice in option.type.choices)
    limits = _help(option)[2]
    if isinstance(option.type, click.IntRange):
        low, high = option.type.min, option.type.max
        limits = f"≥ {low}" if high is None else f"{low} to {high}"
    kind = {"integer": "whole number", "integer range": "whole number", "float": "number"}.get(option.type.name, "")
    return _cell(" ".join([f"`{option.metavar}`", *([", ".join(filter(None, (kind, limits)))] if kind else [])]))


def _default(option: click.Option) -> str:
    """Return an option's default, `-` for none; click's own mark for no default differs between its versions."""
    if option.required:
        return "required"
    if option.is_flag:
        return "off"
    if said := _help(option)[1]:
        return _cell(said)
    value = option.default
    return f"`{value}`" if isinstance(value, (str, int, float)) and value != "" else NONE


def _meaning(option: click.Option) -> str:
    return _cell(_help(option)[0])


def write(folder: Path = DOCS) -> None:
    """Write all pages."""
    for name, text in pages().items():
        (folder / name).write_text(text, encoding="utf-8")


@functools.cache
def pages() -> dict[str, str]:
    """Return all pages: file name -> text."""
    return {
        "scenario.md": scenario_page(),
        "scenario_sensors.md": sensors_page(),
        "scenario_observers.md": observers_page(),
        **{page: commands_page(page) for page in COMMAND_PAGES},
    }


if __name__ == "__main__":
    write()
