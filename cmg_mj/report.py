"""Tables and lists for the terminal."""

from __future__ import annotations

import inspect
import sys
import textwrap
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from rich import box
from rich.table import Table

from cmg_mj.experiment import Experiment
from cmg_mj.law import closed_loop_poles
from cmg_mj.observers import OBSERVERS, observer_class
from cmg_mj.resources import bundled
from cmg_mj.scenario import load_scenario
from cmg_mj.stability import MARGIN, is_hurwitz

COLUMNS = (
    ("velocity_rms_error_rad_s", "velocity\nRMS error\n[rad/s]", "{:.4f}"),
    ("velocity_rms_error_fog_rad_s", "against\nthe gyro\n[rad/s]", "{:.4f}"),
    ("tilt_rms_deg", "tilt\nRMS\n[deg]", "{:.3f}"),
    ("settle_time_s", "settle\ntime\n[s]", "{:.2f}"),
    ("gimbal_peak_deg", "gimbal\npeak\n[deg]", "{:.1f}"),
    ("command_rms_rad_s", "command\nRMS\n[rad/s]", "{:.3f}"),
    ("command_saturated_fraction", "command\nlimited", "{:.1%}"),
    ("fell_fraction", "fell", "{:.0%}"),
    ("stopped_fraction", "stopped", "{:.0%}"),
)
"""Summary key, heading, format."""

BIAS_LABELS = {
    "bias_estimate_deg": "Estimated equilibrium bias, mean [deg]",
    "bias_rms_error_deg": "  its RMS error [deg]",
}

LABELS = {
    "settle_time_s": "Settle time after the last push [s]",
    "velocity_rms_error_rad_s": "Velocity RMS error [rad/s]",
    "velocity_rms_error_fog_rad_s": "  against the gyro [rad/s]",
    "tilt_rms_deg": "Tilt RMS [deg]",
    "gimbal_peak_deg": "Gimbal peak [deg]",
    "command_rms_rad_s": "Command RMS [rad/s]",
    "command_saturated_fraction": "Share of ticks with the command limited",
}


def _cell(value: Any, pattern: str) -> str:
    return "-" if value is None else pattern.format(value)


def _columns(summaries: Sequence[Mapping[str, Any]]) -> list[tuple[str, str, str]]:
    """All columns, but that of stopped worlds only if there are any."""
    stopped = any(summary["stopped_fraction"] for summary in summaries)
    return [column for column in COLUMNS if stopped or column[0] != "stopped_fraction"]


def comparison_table(summaries: Sequence[Mapping[str, Any]], title: str) -> Table:
    """The table that `cmg-mj compare` prints."""
    table = Table(title=title, box=box.SIMPLE_HEAD, title_justify="left", padding=(0, 1, 0, 0))
    table.add_column("observer", vertical="bottom", overflow="fold")
    columns = _columns(summaries)
    for _, heading, _ in columns:
        table.add_column(heading, justify="right", vertical="bottom")
    for summary in summaries:
        table.add_row(summary["observer"], *(_cell(summary[key], pattern) for key, _, pattern in columns))
    return table


def comparison_markdown(summaries: Sequence[Mapping[str, Any]]) -> str:
    """The same table in Markdown."""
    columns = _columns(summaries)
    headings = ["observer", *(heading.replace("\n", " ") for _, heading, _ in columns)]
    lines = ["| " + " | ".join(headings) + " |", "|---|" + "---:|" * len(columns)]
    for summary in summaries:
        cells = [f"`{summary['observer']}`", *(_cell(summary[key], pattern) for key, _, pattern in columns)]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def summary_table(summary: Mapping[str, Any]) -> Table:
    """The table that `cmg-mj run` prints."""
    ends = {"done": "stood to the end, {:g} s", "fell": "fell at {:.2f} s"}
    outcome = str(summary["outcome"])
    end = ends.get(outcome, outcome + " at {:g} s").format(summary["end_time_s"])
    table = Table(
        title=f"{summary['scenario'] or 'Run'}: {summary['observer']}, seed {summary['seed']}",
        box=box.SIMPLE_HEAD,
        title_justify="left",
        show_header=False,
    )
    table.add_column()
    table.add_column(justify="right")
    table.add_row("Outcome", end)
    for key, label in LABELS.items():
        table.add_row(label, _cell(summary[key], "{:.1%}" if key.endswith("fraction") else "{:.4f}"))
    for key, label in BIAS_LABELS.items():
        if key in summary:
            table.add_row(label, _cell(summary[key], "{:.4f}"))
    for name, errors in summary.get("companions", {}).items():
        table.add_row(f"Velocity RMS error of {name} [rad/s]", _cell(errors["velocity_rms_error_rad_s"], "{:.4f}"))
    return table


def scenario_list() -> str:
    """What `cmg-mj list scenarios` prints."""
    names = bundled("scenarios")
    width = max(len(name) for name in names)
    return "\n".join(["Scenarios", *(f"  {name:{width}}  {load_scenario(name).title}" for name in names)])


def observer_list() -> str:
    """What `cmg-mj list observers` prints: every observer, the defaults of its parameters, what it is."""
    width = max(len(name) for name in OBSERVERS)
    lines = ["Observers, and the defaults of their parameters (--set observer.NAME=VALUE)"]
    for name in OBSERVERS:
        cls = observer_class(name)
        parameters = [p for p in inspect.signature(cls).parameters.values() if p.name not in ("dt", "model")]
        title = (sys.modules[cls.__module__].__doc__ or "").partition("\n")[0]
        defaults = _assignments({p.name: p.default for p in parameters}) or "no parameters"
        indent = " " * (width + 4)
        # A default is kept in one piece: its spaces are not those to break at.
        wrapped = textwrap.wrap(defaults.replace(", ", ",\0"), 98, initial_indent=indent, subsequent_indent=indent)
        lines.append(f"  {name:{width}}  {wrapped[0].strip()}".replace("\0", " "))
        lines += [line.replace("\0", " ") for line in wrapped[1:]]
        lines += textwrap.wrap(title, 98, initial_indent=indent, subsequent_indent=indent)
    return "\n".join(lines)


def description(name: str, experiment: Experiment) -> str:
    """What `cmg-mj check` prints: what a scenario amounts to."""
    scenario, plant, law = experiment.scenario, experiment.plant, experiment.law
    fields = experiment.resolved()
    settings = scenario.plant
    steps = f"{round(scenario.duration_s / settings.timestep_s)} physics steps of {settings.timestep_s:g} s"
    poles = closed_loop_poles(plant.reduced, law.gains)
    slowest = float(np.max(poles.real))
    stability = "stable" if is_hurwitz(poles) else "MARGINAL" if slowest < MARGIN else "UNSTABLE"
    observer = {key: value for key, value in fields["observer"].items() if key != "kind"}
    rates = {kind: getattr(scenario.sensors, kind).rate_hz for kind in ("accelerometer", "encoder", "fog")}
    rows = [
        ("run", f"{scenario.duration_s:g} s, {steps} ({settings.integrator}), seed {scenario.seed}"),
        ("plant", f"{fields['plant']['model']}, cubes: {', '.join(cube.name for cube in plant.cubes)}"),
        ("", f"equilibrium bias {settings.equilibrium_bias_deg:g} deg, initial tilt {settings.initial_tilt_deg:g} deg"),
        ("law", f"K_e = {_number(law.gains)} at {scenario.controller.rate_hz:g} Hz, at most {law.rate_limit:g} rad/s"),
        ("", f"tilt rate from the {scenario.controller.feedback}, {scenario.controller.angles} angles"),
        ("", f"{stability} with the reduced model and its true state, slowest pole {slowest:.3g} 1/s"),
        ("observer", f"{scenario.observer.kind}  {_assignments(observer)}".rstrip()),
        ("companions", ", ".join(scenario.companion_names()) or "none"),
        ("sensors", ", ".join(f"{kind} {rate:g} Hz" for kind, rate in rates.items())),
        *(("push", f"{p.torque_n_m:g} N m from {p.start_s:g} s to {p.end_s:g} s") for p in scenario.push),
    ]
    return "\n".join([f"{name}: valid", *(f"  {label:10}  {text}" for label, text in rows)])


def _assignments(values: Mapping[str, Any]) -> str:
    return "  ".join(f"{name}={_number(value)}" for name, value in values.items())


def _number(value: Any) -> str:
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(_number(item) for item in value)}]"
    if isinstance(value, bool):
        return "true" if value else "false"
    return f"{value:.6g}" if isinstance(value, float) else str(value)
