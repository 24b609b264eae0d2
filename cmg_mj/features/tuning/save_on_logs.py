"""Figures, table and file of a tuning on logs."""

from __future__ import annotations

import json
import math
from pathlib import Path

from rich import box
from rich.console import Group
from rich.table import Table
from rich.text import Text

from cmg_mj.features.tuning.closed_loop import RELEVANT, LoopComparison
from cmg_mj.features.tuning.on_logs import SHORTEST_S, LogStudy
from cmg_mj.features.tuning.parameters import plain
from cmg_mj.features.tuning.save import level_figures, ratio_text
from cmg_mj.results.folder import RunFolder, claimed, write_text
from cmg_mj.results.metrics import finite_or_none
from cmg_mj.results.summary_keys import SummaryValue

FILES = ("tuned.json",)


def figures_of_logs(study: LogStudy) -> dict[str, SummaryValue]:
    """Return the figures that `cmg-mj tune-log --json` prints."""
    level = level_figures(study.level)
    only_of_scenarios = ("noise_density_ug_rthz", "worlds_that_fell", "held_out_worlds")
    return {
        "logs": list(study.names),
        "observer": study.kind,
        "split": study.split,
        "given_parameters": plain(study.start_parameters),
        "tuned": [number.name for number in study.numbers],
        "idle": list(study.insensitive_parameters),
        "noise": [
            {
                "tilt_rad": noise.tilt,
                "acceleration_rad_s2": noise.acceleration,
                "correlation": noise.correlation,
                **by_the_log,
            }
            for noise, by_the_log in zip(study.noises, study.noises_by_the_logs, strict=True)
        ],
        "notes": [list(log) for log in study.remarks],
        "reference": [aligned and aligned._asdict() for aligned in study.alignments],
        "held_out_stretches": len(study.level.rms),
        "held_out_stretch_s": study.stretch_s,
        **{key: value for key, value in level.items() if key not in only_of_scenarios},
        **({} if study.has_interval else {"held_out_ratio": None}),
        "verdict": study.verdict,
        **({} if study.loop is None else {"closed_loop": _loop_figures(study.loop)}),
    }


def _loop_figures(loop: LoopComparison) -> dict[str, SummaryValue]:
    return {
        "scenario": loop.scenario,
        "duration_s": loop.duration_s,
        "worlds": loop.worlds,
        "given_stood": loop.stood[0],
        "tuned_stood": loop.stood[1],
        "given_stood_alone": loop.stood_alone[0],
        "tuned_stood_alone": loop.stood_alone[1],
        "tilt_rms_ratio": None if loop.ratio is None else [finite_or_none(value) for value in loop.ratio],
        "verdict": loop.verdict,
        "refused": loop.refused or None,
    }


def _verdict_in_words(study: LogStudy) -> list[str]:
    """Say why a difference counts for none."""
    ratio = study.level.ratio
    if study.verdict != "tie" or not math.isfinite(ratio.mean):
        return []
    if ratio.low <= 1.0 <= ratio.high:
        return ["A tie: the difference is not beyond chance."]
    return [f"A tie: {abs(ratio.mean - 1.0):.2%} of difference, where less than {RELEVANT - 1.0:.0%} counts for none."]


def logs_table(study: LogStudy) -> Group:
    """Return the table that `cmg-mj tune-log` prints."""
    level = study.level
    share = f"{study.split:.0%}"
    several = len(study.names) > 1
    logs = zip(study.names, study.remarks, strict=True)
    lines = [f"{name}: {line}" if several else line for name, remarks in logs for line in remarks]
    lines += [
        f"RMS of the estimated rate less the reference. Fitted on the first {share} of each log, scored on the rest,",
        f"in {len(level.rms)} stretches. An estimate of zero: {level.zero_rms:.4f} rad/s. Fit {level.fit:.3f} tuned, "
        f"{level.given_fit:.3f} given.",
    ]
    if study.insensitive_parameters:
        lines.append(f"Not tuned, because the rate does not depend on them: {', '.join(study.insensitive_parameters)}.")
    if not study.has_interval:
        short = f"the scored stretches are {study.stretch_s:.2g} s short"
        lines.append(f"No interval: {short}; there is one from {SHORTEST_S:g} s on.")
    if study.limits:
        lines.append(
            f"* at a limit of its range: {', '.join(study.limits)}. Beyond it there may be better ones: --range."
        )
    lines += _verdict_in_words(study)
    if study.loop is not None:
        lines.append(study.loop.remark)
    table = Table(title=f"{', '.join(study.names)}: {study.kind}", box=box.SIMPLE_HEAD, title_justify="left")
    for heading in ("parameter", "given", "tuned"):
        table.add_column(heading, justify="left" if heading == "parameter" else "right")
    for number in study.numbers:
        size = math.copysign(level.sizes[number.name], number.start)
        table.add_row(number.name, f"{number.start:.4g}", f"{size:.4g}{'*' if number.name in level.edges else ''}")
    table.add_section()
    table.add_row("held out [rad/s]", f"{level.given_rms.mean():.4f}", f"{level.rms.mean():.4f}")
    table.add_row("given / tuned, 95 %", "", ratio_text(level.ratio) if study.has_interval else "-")
    table.add_row("tuned is", "", study.verdict or "-")
    return Group(table, Text("\n".join(lines)))


def save_log_study(folder: RunFolder | Path, study: LogStudy) -> Path:
    """Write tuned.json.

    Args:
        folder: The folder. Files in it that cmg_mj did not write stay.
        study: The result.

    Returns:
        The folder of the file.

    Raises:
        InputError: The file cannot be written.
    """
    text = json.dumps(figures_of_logs(study), indent=2)
    with claimed(folder) as claim:
        return claim.write({FILES[0]: lambda path: write_text(path, text)})
