"""A scenario and its plant in words."""

from __future__ import annotations

import math
import shlex
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from cmg_mj.core.errors import TomlValue
from cmg_mj.core.tilt import PairTilt
from cmg_mj.core.types import law_needs
from cmg_mj.inputs.features import entries
from cmg_mj.laws import LAWS, TABLE_2_GAINS, StateFeedback
from cmg_mj.linear.ceiling import ceiling, ceiling_words, plant_words
from cmg_mj.linear.verdict import IN_THE_MODEL, NOT_IN_THE_MODEL, hints, judge_gains, omissions, sliding_words
from cmg_mj.observers.gyro_free import steady_error
from cmg_mj.plant.plant import Plant
from cmg_mj.results.reports import assignments, lines, number
from cmg_mj.runs.experiment import ExperimentAxis
from cmg_mj.scenario.design import Design
from cmg_mj.scenario.resolve import resolved
from cmg_mj.scenario.schema import ControllerSettings

OWN_CODE = "your own code, which was imported and tried on two samples"

Rows = list[tuple[str, Any]]


def description(name: str, axes: Sequence[ExperimentAxis]) -> str:
    """Describe a scenario in the lines that `cmg-mj check` prints.

    Args:
        name: The scenario as the user called it.
        axes: Its axes.
    """
    titles = [f"{name}{f', axis {part.name}' if part.name else ''}: valid" for part in axes]
    groups = [[_own_rows(part), *_shareable_rows(part)] for part in axes]
    return _blocks(titles, groups, f"{name}, on all axes")


def _blocks(titles: Sequence[str], groups: Sequence[Sequence[Rows]], shared_title: str) -> str:
    """Join a block an axis and, of several axes, one with the groups of rows that all of them have."""
    shared = [group for group in groups[0] if all(group in others for others in groups)] if len(groups) > 1 else []
    blocks = [
        lines(title, [row for group in own if group not in shared for row in group])
        for title, own in zip(titles, groups, strict=True)
    ]
    if shared:
        blocks.append(lines(shared_title, [row for group in shared for row in group]))
    return "\n".join(blocks)


def _own_rows(part: ExperimentAxis) -> Rows:
    """Describe the plant about an axis, its law, observers and sensors."""
    scenario, design, rig, axis = part.scenario, part.design, part.design.rig, part.plant.axis.name
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
    return [
        ("run", f"{scenario.duration_s:g} s, {steps} ({settings.integrator}{coarse}), seed {scenario.seed}"),
        ("plant", f"{fields['plant']['model']}, modules: {', '.join(rig.modules)}"),
        *_plant_rows(design),
        ("", assignments(settings.changes())),
        ("", f"equilibrium bias {settings.equilibrium_bias_deg:g} deg, initial tilt {settings.initial_tilt_deg:g} deg"),
        *_law_rows(design, fields["controller"]),
        ("observer", f"{scenario.observer.kind}  {assignments(observer)}".rstrip()),
        ("", ":" in scenario.observer.kind and OWN_CODE),
        ("open loop", ", ".join(scenario.open_loop_names()) or "none"),
        ("sensors", ", ".join(f"{kind} {rate:g} Hz" for kind, rate in rates.items())),
        ("", imperfections and f"accelerometer: {assignments(imperfections)}"),
        ("", _places(design)),
        ("compare", compare and f"{', '.join(compare.names())}; {compare.worlds} worlds"),
    ]


def _shareable_rows(part: ExperimentAxis) -> list[Rows]:
    """Describe what acts on the robot and what is judged, in groups that all axes may have in common."""
    scenario, design = part.scenario, part.design
    missing = ", ".join(omissions(scenario).values())
    omitted = f"{missing}: not in the reduced model, its loop, the ceiling, floor_accel"
    judgements = [judge(design, part.plant) for judge in entries("judge").values()]
    said = [*hints(design, part.plant), *(hint for judgement in judgements for hint in judgement.hints)]
    groups = [
        *([("push", push.words)] for push in scenario.push),
        *([("swing", swing.words)] for swing in scenario.swing),
        list(_pivot_rows(part.plant)),
        [("omitted", omitted)] if missing else [],
        *(list(judgement.rows) for judgement in judgements),
        *([("hint", hint)] for hint in said),
    ]
    return [group for group in groups if group]


def _places(design: Design) -> str:
    """Say what `gyro_free` errs by with the accelerometers where they are, and with the inner one at the pivot."""
    rig, sensors, dt = design.rig, design.scenario.sensors, design.law.dt
    tilt, sigma = rig.tilt, sensors.accelerometer.sample_sigma
    if not sigma:
        return ""
    far = max(math.hypot(r, c) for r, c in zip(tilt.radii, tilt.across, strict=True))
    here, best = (steady_error(pair.noise(sigma, rig.gravity), dt) for pair in (tilt, PairTilt(0.0, far)))
    where = [
        f"{r:.3g}" if tilt.is_radial else f"({c:.3g}, {r:.3g})" for r, c in zip(tilt.radii, tilt.across, strict=True)
    ]
    return (
        f"accelerometers at {' and '.join(where)} m: by their white noise gyro_free errs by {here:.3g} rad/s, "
        f"at 0 and {far:.3g} m by {best:.3g}"
    )


def _pivot_rows(plant: Plant) -> Iterator[tuple[str, str]]:
    """Describe a sliding pivot: the point that the tilt is taken about, and the model's share of the sliding."""
    if plant.reduced.pivot_arm:
        yield "pivot", sliding_words(plant)
        yield "", f"in the reduced model: {IN_THE_MODEL}"
        yield "", f"not in it: {NOT_IN_THE_MODEL}"


def _plant_rows(design: Design) -> list[tuple[str, str]]:
    """Describe the plant about its tilt line as `mount` does, and what no controller recovers from there."""
    reduced = design.rig.reduced
    return [("", plant_words(reduced)), ("", ceiling_words(ceiling(reduced, design.law.rate_limit)))]


def _law_rows(design: Design, fields: Mapping[str, TomlValue]) -> Iterator[tuple[str, str]]:
    """Return the law, its inputs, and of the papers' law the closed loop on the reduced model."""
    controller, law = design.scenario.controller, design.law
    limits = f"at {controller.rate_hz:g} Hz, at most {controller.rate_limit_rad_s:g} rad/s"
    inputs = f"tilt rate from the {controller.feedback}, {controller.angle_source} angles"
    if isinstance(law, StateFeedback):
        yield "law", f"K_e = {number(law.gains)} {limits}"
    else:
        yield "law", f"{controller.kind} {limits}"
        parameters = {name: value for name, value in fields.items() if name not in ControllerSettings.model_fields}
        yield "", assignments(parameters)
    yield "", inputs if law_needs(law) else "takes nothing of the observer, which is judged only"
    if controller.notch_hz:
        yield "", f"notch at {controller.notch_hz:g} Hz on the command"
    if isinstance(law, StateFeedback):
        loop = judge_gains(design).loop
        yield "", f"gains alone, on the reduced model's true state: {loop.words}, slowest pole {loop.slowest:.3g} 1/s,"
        yield "", f"least damping ratio {loop.damping:.2g}, nearest to -1 {loop.distance:.2g}"
    elif controller.kind not in LAWS:
        yield "", OWN_CODE


def rig_description(name: str, axes: Sequence[ExperimentAxis], own: str = "") -> str:
    """Describe a model file in the lines that `cmg-mj check` prints.

    Args:
        name: The file as the user called it.
        axes: The axes of a scenario with this model and all defaults.
        own: The model's own scenario file, if it has one, whose gains are then not judged here.
    """
    titles = [f"{name}: a rig{f', axis {part.name}' if part.name else ''}" for part in axes]
    return _blocks(titles, [_rig_rows(name, part, own) for part in axes], f"{name}, on all axes")


def _rig_rows(name: str, part: ExperimentAxis, own: str) -> list[Rows]:
    """Describe a model about an axis, in groups that all axes may have in common."""
    rig, axis = part.design.rig, part.plant.axis.name
    about = f" --set push.0.axis={axis}" if axis else ""
    push_it = f"cmg-mj run push_recovery --set {shlex.quote(f'plant.model={name}')}{about}"
    law = f"gains are a scenario's; here Table 2's, K_e = {number(TABLE_2_GAINS)}"
    clauses: Iterable[str] = part.hints
    if own:
        clauses = (f"{rig.path}: {hint}" for hint in rig.hints)
        push_it = f"cmg-mj run {shlex.quote(own)}"
        law = f"the gains are its scenario's: cmg-mj check {shlex.quote(own)}"
    reduced = rig.reduced
    share = f", for one of {reduced.gimbals} gimbals" if reduced.gimbals > 1 else ""
    rows: Rows = [
        ("modules", ", ".join(rig.modules)),
        *_plant_rows(part.design),
        ("reduced", f"J1 = {reduced.J1:.6g}, J2 = {reduced.J2:.6g}, J_d = {reduced.J_d:.6g} kg m^2{share}"),
        ("", f"omega_d = {reduced.omega_d:.6g} rad/s, m g l/sqrt(2) = {reduced.gravity_torque:.6g} N m"),
        *_pivot_rows(part.plant),
        ("physics", f"accurate with steps of up to {rig.largest_step:.3g} s"),
        ("law", law),
    ]
    return [rows, *([("hint", hint)] for hint in clauses), [("run it", push_it)]]
