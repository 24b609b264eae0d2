"""(11) with the equilibrium bias from `adaptive`, beside each of the two alone."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from beyond.push_recovery import ERROR, gain, on_rigs, push_recovery
from cmg_mj.papers.claim import Claim, OnShare
from cmg_mj.papers.pair import PUSH_RECOVERY
from cmg_mj.results.intervals import known_interval
from cmg_mj.view.plots.figure import Line, Panel, Picture

SEED, WORLDS = 90_002, 100
BIASES_DEG = (0.25, 0.5, 1.0, 1.5)
ALONE, TOLD = "homogeneous", "homogeneous_adaptive"
KINDS = (ALONE, "adaptive", TOLD)


def claims(on_share: OnShare) -> list[Claim]:
    """Judge the feeding of the estimated bias into (11)."""
    return [fed_bias_claim(fed_bias(WORLDS, SEED, on_share))]


def fed_bias(
    worlds: int, seed: int, on_share: OnShare, biases_deg: Sequence[float] = BIASES_DEG, settings: Sequence[str] = ()
) -> list[dict[str, Any]]:
    """Run (11) alone, `adaptive` alone, and (11) with the bias from `adaptive`, at several biases.

    Args:
        worlds: Worlds a bias, the same ones each time.
        seed: Seed of the sensors' noise.
        on_share: Called with the share done.
        biases_deg: The equilibrium biases e [deg].
        settings: Settings `section.field=value` that differ in `push_recovery`.

    Returns:
        A row a bias: each observer's velocity RMS error and share of falls, and the gain of (11) by the bias.
    """
    by_kind = {}
    for i, kind in enumerate(KINDS):
        by_kind[kind] = on_rigs(push_recovery(kind, seed, settings), worlds, "equilibrium_bias_deg", biases_deg)
        on_share((i + 1) / len(KINDS))
    rows = []
    for i, bias in enumerate(biases_deg):
        row: dict[str, Any] = {"bias_deg": bias, "worlds": worlds, "seed": seed}
        values = {kind: results[i].values(ERROR) for kind, results in by_kind.items()}
        for kind in KINDS:
            row[f"{kind}_rad_s"] = known_interval(values[kind])
            row[f"{kind}_fell_fraction"] = 1.0 - float(by_kind[kind][i].stood.mean())
        rows.append(row | {"gain_rad_s": gain(values[ALONE], values[TOLD])})
    return rows


def fed_bias_claim(rows: Sequence[dict[str, Any]]) -> Claim:
    """Judge the rows of `fed_bias`: it helps if at some bias the error is smaller beyond chance, or falls are fewer."""
    helped_biases = [
        row["bias_deg"]
        for row in rows
        if (row["gain_rad_s"] is not None and row["gain_rad_s"].low > 0.0)
        or row[f"{TOLD}_fell_fraction"] < row[f"{ALONE}_fell_fraction"]
    ]
    helpful_biases = f"It helps at e = {', '.join(f'{e:g}' for e in helped_biases)} deg of those tried."
    return Claim(
        place="homogeneous with the bias fed in from adaptive",
        is_ours=True,
        statement="the rate error of (11) that e causes goes when e is estimated beside it",
        assumes={**PUSH_RECOVERY, "e": ", ".join(f"{row['bias_deg']:g}" for row in rows) + " deg"},
        holds=bool(helped_biases),
        conditions="" if len(helped_biases) == len(rows) else helpful_biases,
        otherwise="It helps at none of the biases tried.",
        figures={"rows": rows},
        picture=_picture(rows),
    )


def _picture(rows: Sequence[dict[str, Any]]) -> Picture:
    lines = []
    for kind in KINDS:
        points = [(row["bias_deg"], row[f"{kind}_rad_s"]) for row in rows if row[f"{kind}_rad_s"] is not None]
        biases, errors = [bias for bias, _ in points], [error for _, error in points]
        means, halves = [error.mean for error in errors], [error.half for error in errors]
        lines.append(Line(biases, means, kind, "o-", kind, spread=halves))
    panel = Panel("velocity RMS error [rad/s]", lines, x_label="equilibrium bias e [deg]")
    return Picture("beyond-fed-bias", "The bias fed into (11): velocity RMS error with 95 % intervals", [panel])
