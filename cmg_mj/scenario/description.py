"""A scenario and its plant in words."""

from __future__ import annotations

import shlex
from collections.abc import Iterable, Iterator, Mapping

from cmg_mj.controllers.laws import LAWS, TABLE_2_GAINS, StateFeedback
from cmg_mj.core.types import law_needs
from cmg_mj.errors import TomlValue
from cmg_mj.scenario.bend_cures import NEAR, Trial, cure_among, trials, try_loop
from cmg_mj.scenario.design import Design
from cmg_mj.scenario.linear_plant import rk4_energy_loss
from cmg_mj.scenario.omissions import omissions
from cmg_mj.scenario.pivot_track import read_track
from cmg_mj.scenario.plant_parameters import PlantParameters
from cmg_mj.scenario.plant_settings import BendBeyond
from cmg_mj.scenario.resolve import resolved
from cmg_mj.scenario.schema import ControllerSettings, Scenario
from cmg_mj.scenario.sliding_pivot import IN_THE_MODEL, NOT_IN_THE_MODEL, sliding_words
from cmg_mj.scenario.stability_check import bend_hint, closed_loop, hints, plant_hints
from cmg_mj.stages.push import Push
from cmg_mj.stages.swing import Swing

BEYOND: dict[BendBeyond, str] = {
    "sensors": "with the sensors; the modules, whose tilt and rate count as true, are before it",
    "modules": "with the modules, whose tilt and rate count as true; the sensors are before it",
    "both": "with the modules, whose tilt and rate count as true, and the sensors",
}


def description(name: str, scenario: Scenario, design: Design, rig: PlantParameters, axis: str = "") -> str:
    """Describe a scenario in the lines that `cmg-mj check` prints.

    Args:
        name: The scenario as the user called it.
        scenario: The scenario of one axis.
        design: The law and the observers.
        rig: The parameters of the plant.
        axis: The name of the axis, if it has one.
    """
    settings = scenario.plant
    timestep = rig.timestep
    fields = resolved(scenario, {axis: design})
    steps = f"{round(scenario.duration_s / timestep)} physics steps of {timestep:g} s"
    coarse = (
        f"; figures are accurate up to {rig.largest_step:g} s" if timestep > rig.largest_step * (1.0 + 1e-9) else ""
    )
    observer = {key: value for key, value in fields["observer"].items() if key != "kind"}
    compare = scenario.compare
    rates = {kind: getattr(scenario.sensors, kind).rate_hz for kind in ("accelerometer", "encoder", "fog")}
    imperfections = scenario.sensors.accelerometer.imperfections
    changes = settings.changes()
    rows = [
        ("run", f"{scenario.duration_s:g} s, {steps} ({settings.integrator}{coarse}), seed {scenario.seed}"),
        ("plant", f"{fields['plant']['model']}, modules: {', '.join(rig.modules)}"),
        *([("", assignments(changes))] if changes else []),
        ("", f"equilibrium bias {settings.equilibrium_bias_deg:g} deg, initial tilt {settings.initial_tilt_deg:g} deg"),
        *_law_rows(scenario, design, rig, fields["controller"]),
        ("observer", f"{scenario.observer.kind}  {assignments(observer)}".rstrip()),
        *(
            [("", "your own code, which was imported and tried on two samples")]
            if ":" in scenario.observer.kind
            else []
        ),
        ("open loop", ", ".join(scenario.open_loop_names()) or "none"),
        ("sensors", ", ".join(f"{kind} {rate:g} Hz" for kind, rate in rates.items())),
        *([("", f"accelerometer: {assignments(imperfections)}")] if imperfections else []),
        *([("compare", f"{', '.join(compare.names())}; {compare.worlds} worlds")] if compare else []),
        *(("push", f"{p.torque_n_m:g} N m{_about(p)} from {p.start_s:g} s to {p.end_s:g} s") for p in scenario.push),
    ]
    rows += [("swing", f"{s.amplitude_n_m:g} N m at {s.frequency_hz:g} Hz{_about(s)}") for s in scenario.swing]
    for pivot in scenario.pivot:
        rows.append(("pivot", pivot.words))
        if pivot.file is not None:
            rows.append(("", read_track(pivot.file, pivot.column).words))
    rows += _pivot_rows(rig)
    missing = list(omissions(scenario).values())
    if missing:
        rows.append(("omitted", f"{', '.join(missing)}: not in the reduced model, its loop, the ceiling, floor_accel"))
    trial = try_loop(scenario, rig)
    rows += _bend_rows(scenario, rig, trial)
    clauses = [*plant_hints(scenario, design, rig), *bend_hint(rig, trial)]
    return lines(
        f"{name}{f', axis {axis}' if axis else ''}: valid",
        [*rows, *(("hint", hint) for hint in clauses)],
    )


def _about(torque: Push | Swing) -> str:
    return "" if torque.axis is None else f" about {torque.axis}"


def _pivot_rows(rig: PlantParameters) -> Iterator[tuple[str, str]]:
    """Describe a sliding pivot: the point that the tilt is taken about, and the model's share of the sliding."""
    if rig.reduced.pivot_arm:
        yield "pivot", sliding_words(rig)
        yield "", f"in the reduced model: {IN_THE_MODEL}"
        yield "", f"not in it: {NOT_IN_THE_MODEL}"


def _bend_rows(scenario: Scenario, rig: PlantParameters, trial: Trial | None) -> Iterator[tuple[str, str]]:
    """Return the mode of a frame that bends, the loop around it, and a cure for that if it needs one."""
    if rig.bend is None:
        return
    plant, bend = scenario.plant, rig.bend
    loss, numerical = bend.energy_loss, rk4_energy_loss(bend.frequency_hz, rig.timestep)
    mode = f"{bend.frequency_hz:g} Hz, damping ratio {bend.damping_ratio:g}"
    yield "bend", f"{mode}, beyond it {plant.bend_share:g} of the inertia"
    yield "", BEYOND[plant.bend_beyond]
    yield "", f"loses {100.0 * loss:.3g} % of its energy a second, and {100.0 * numerical:.2g} % to the physics steps"
    if trial is None:
        yield "", "its loop is not computed for code of your own"
        return
    yield "", f"the loop with it, feedback from the {scenario.controller.feedback}: {trial.words}"
    if not trial.is_stable_rigid:
        yield "cure", "none is tried: law, observer and notch have to hold a rigid frame first"
    if not trial.is_near:
        return
    others = trials(scenario, rig)
    for other in others:
        yield "tried", f"{' '.join(other.settings)}: {other.words}"
    cure = cure_among(others)
    if cure is None or (trial.is_stable and cure.distance <= trial.distance):
        yield (
            "cure",
            "none of these: the mode is too near the loop's bandwidth; a stiffer frame or another observer may",
        )
        return
    little = "" if cure.distance >= NEAR else ", with little margin"
    yield "cure", f"{' '.join(f'--set {_quoted(setting)}' for setting in cure.settings)}{little}"


def _quoted(setting: str) -> str:
    return f"'{setting}'" if " " in setting else setting


def _law_rows(
    scenario: Scenario, design: Design, rig: PlantParameters, fields: Mapping[str, TomlValue]
) -> Iterator[tuple[str, str]]:
    """Return the law, its inputs, and of the papers' law the closed loop on the reduced model."""
    controller, law = scenario.controller, design.law
    limits = f"at {controller.rate_hz:g} Hz, at most {controller.rate_limit_rad_s:g} rad/s"
    inputs = f"tilt rate from the {controller.feedback}, {controller.angle_source} angles"
    notch = f"notch at {controller.notch_hz:g} Hz on the command" if controller.notch_hz else ""
    if isinstance(law, StateFeedback):
        loop = closed_loop(scenario, law, rig.reduced)
        yield "law", f"K_e = {number(law.gains)} {limits}"
        yield "", inputs
        if notch:
            fast = f", not in the next lines: beyond {0.5 / loop.period:g} Hz the sensors show nothing"
            yield "", notch if loop.notch_hz else f"{notch}{fast}"
        yield "", f"{loop.words} with the reduced model and its true state, slowest pole {loop.slowest:.3g} 1/s,"
        yield "", f"least damping ratio {loop.damping:.2g}, nearest to -1 {loop.distance:.2g}"
        return
    yield "law", f"{controller.kind} {limits}"
    parameters = {name: value for name, value in fields.items() if name not in ControllerSettings.model_fields}
    if parameters:
        yield "", assignments(parameters)
    yield "", inputs if law_needs(law) else "takes nothing of the observer, which is judged only"
    if notch:
        yield "", notch
    if controller.kind not in LAWS:
        yield "", "your own code, which was imported and tried on two samples"


def rig_description(
    name: str, scenario: Scenario, design: Design, rig: PlantParameters, axis: str = "", own: str = ""
) -> str:
    """Describe a model file in the lines that `cmg-mj check` prints.

    Args:
        name: The file as the user called it.
        scenario: A scenario with this model and all defaults.
        design: The law and the observers by default.
        rig: The parameters of the plant.
        axis: The name of the axis, if it has one.
        own: The model's own scenario file, if it has one, whose gains are then not judged here.
    """
    about = f" --set push.0.axis={axis}" if axis else ""
    push_it = f"cmg-mj run push_recovery --set {shlex.quote(f'plant.model={name}')}{about}"
    law = f"gains are a scenario's; here Table 2's, K_e = {number(TABLE_2_GAINS)}"
    clauses: Iterable[str] = hints(scenario, design, rig)
    if own:
        clauses = (f"{rig.path}: {hint}" for hint in rig.hints)
        push_it = f"cmg-mj run {shlex.quote(own)}"
        law = f"the gains are its scenario's: cmg-mj check {shlex.quote(own)}"
    reduced = rig.reduced
    share = f", for one of {reduced.gimbals} gimbals" if reduced.gimbals > 1 else ""
    rows = [
        ("modules", ", ".join(rig.modules)),
        ("reduced", f"J1 = {reduced.J1:.6g}, J2 = {reduced.J2:.6g}, J_d = {reduced.J_d:.6g} kg m^2{share}"),
        ("", f"omega_d = {reduced.omega_d:.6g} rad/s, m g l/sqrt(2) = {reduced.gravity_torque:.6g} N m"),
        *_pivot_rows(rig),
        ("physics", f"accurate with steps of up to {rig.largest_step:.3g} s"),
        ("law", law),
        *(("hint", hint) for hint in clauses),
        ("run it", push_it),
    ]
    return lines(f"{name}: a rig{f', axis {axis}' if axis else ''}", rows)


def lines(title: str, rows: Iterable[tuple[str, str]]) -> str:
    """Join a title, and rows of a label and a text."""
    return "\n".join([title, *(f"  {label:10}  {text}" for label, text in rows)])


def assignments(values: Mapping[str, TomlValue]) -> str:
    """Parameters and their values, as `--set` takes them."""
    return "  ".join(f"{name}={number(value)}" for name, value in values.items())


def number(value: TomlValue) -> str:
    """Return a value as TOML writes it, to six digits."""
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(number(item) for item in value)}]"
    if isinstance(value, bool):
        return "true" if value else "false"
    return f"{value:.6g}" if isinstance(value, float) else str(value)
