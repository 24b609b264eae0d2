"""All observers in one table, and where the papers' order holds in it."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from beyond.league import MEANS, league
from beyond.push_recovery import ERROR
from cmg_mj.papers.claim import Claim, OnShare
from cmg_mj.papers.pair import PUSH_RECOVERY
from cmg_mj.results.intervals import Interval
from cmg_mj.results.summary_keys import format_figure, heading
from cmg_mj.results.tables import markdown_table
from cmg_mj.view.plots.figure import Line, Panel, Picture

SEED, WORLDS = 90_000, 100
ORDER = ("homogeneous", "ltv", "linear")
"""aranovskiy2020, section V, the best first."""

Row = dict[str, Any]
Cell = tuple[float, float]
"""Noise density [ug/rtHz] and equilibrium bias [deg]."""

SHOWN: Cell = (400.0, 0.5)
"""The cell whose lags and noise gains are drawn."""


def claims(on_share: OnShare) -> list[Claim]:
    """Judge all observers, and where the papers' order holds."""
    return [order_claim(league(WORLDS, SEED, on_share))]


def order_claim(rows: Sequence[Row]) -> Claim:
    """Judge the papers' order by the rows of `league`: it holds if it is that of some cell."""
    cells = by_cell(rows)
    ordered = [cell for cell, of_cell in cells.items() if in_order(of_cell)]
    return Claim(
        place="All observers, three noises, three biases",
        statement="aranovskiy2020 section V: homogeneous before ltv before linear; here over a grid, with every "
        "observer",
        assumes={
            **PUSH_RECOVERY,
            "e": f"{', '.join(f'{e:g}' for e in sorted({bias for _, bias in cells}))} deg",
            "noise": f"{', '.join(f'{noise:g}' for noise in sorted({noise for noise, _ in cells}))} ug/rtHz",
        },
        holds=bool(ordered),
        conditions="" if len(ordered) == len(cells) else "The order turns round where noise is low or the bias large.",
        otherwise="Another order is found at every noise and bias tried.",
        figures={"rows": rows},
        picture=_trade_off(rows),
    )


def by_cell(rows: Sequence[Row]) -> dict[Cell, list[Row]]:
    """Return the rows of each noise and bias, the smallest velocity error first."""
    cells: dict[Cell, list[Row]] = {}
    for row in rows:
        cells.setdefault((row["noise_ug_rthz"], row["bias_deg"]), []).append(row)
    return {cell: sorted(of_cell, key=lambda row: row[ERROR] or np.inf) for cell, of_cell in cells.items()}


def in_order(of_cell: Sequence[Row]) -> bool:
    """Return true if the paper's three observers come in its order."""
    errors = {row["observer"]: row[ERROR] for row in of_cell}
    values = [errors[kind] for kind in ORDER]
    return None not in values and all(error < next_error for error, next_error in pairwise(values))


def league_table(rows: Sequence[Row]) -> str:
    """Return the table, one block a noise and bias, the smallest velocity error first."""
    error, *other_headings = (heading(key) for key in MEANS)
    headings = (
        "observer",
        error,
        "over the floor",
        "push lag [ms]",
        "noise gain [1/s]",
        *other_headings,
        "falls [%]",
        "update [us]",
    )
    blocks = []
    for (noise, bias), of_cell in by_cell(rows).items():
        blocks.append(f"**{noise:g} ug/rtHz, e = {bias:g} deg** (floor {of_cell[0]['floor_rad_s']:.4f} rad/s)")
        blocks.append(markdown_table(headings, [_line(row) for row in of_cell]))
    return "\n\n".join(blocks)


def _line(row: Row) -> list[str]:
    error, *other_means = (_mean(row, key) for key in MEANS)
    ratio, lag = row["ratio_to_floor"], row["push_lag_s"]
    falls, low, high = (100.0 * row[f"fell_fraction{end}"] for end in ("", "_low", "_high"))
    return [
        f"`{row['observer']}`",
        error,
        "-" if ratio is None else f"{ratio:.1f}",
        "-" if lag is None else f"{1e3 * lag:.1f}",
        f"{row['noise_gain_per_s']:.1f}",
        *other_means,
        f"{falls:.0f} ({low:.0f} to {high:.0f})",
        f"{row['update_us']:.1f}",
    ]


def _mean(row: Row, key: str) -> str:
    """Return a mean and half its interval, with the digits that the key has in every table."""
    if row[key] is None:
        return "-"
    half = Interval(row[key], row[f"{key}_low"], row[f"{key}_high"]).half
    return f"{format_figure(key, row[key])} +- {format_figure(key, half)}"


def _trade_off(rows: Sequence[Row]) -> Picture:
    """Draw lag against noise gain, a mark an observer."""
    of_cell = [row for row in rows if (row["noise_ug_rthz"], row["bias_deg"]) == SHOWN]
    visible_rows = [row for row in of_cell if row["push_lag_s"] is not None]
    marks = [
        Line([1e3 * row["push_lag_s"]], [row["noise_gain_per_s"]], row["observer"], "o", row["observer"])
        for row in visible_rows
    ]
    panel = Panel("noise gain [1/s]", marks, x_label="lag in a sudden push [ms]", y_scale="log")
    return Picture("beyond-trade-off", f"Lag and noise gain of every observer ({SHOWN[0]:g} ug/rtHz)", [panel])
