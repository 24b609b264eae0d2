"""The time-invariant observer with which the rig of aranovskiy2020 could not be stabilised."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from cmg_mj.experiment import prepare
from cmg_mj.papers.aranovskiy2020.linearisation import printed_model
from cmg_mj.papers.aranovskiy2020.rig_loop import DURATION_S, WORLDS, errors
from cmg_mj.papers.claim import Claim, OnShare, verdict
from cmg_mj.picture import Line, Panel, Picture
from cmg_mj.plant import load_plant
from cmg_mj.scenario import load_scenario

SEED = 72_002
BIASES_DEG = (0.0, 0.25, 0.5, 1.0)


def frozen_gains() -> tuple[float, float]:
    """H11 and H12 at which the Riccati equation of (10) settles at rest, Q of Table 2 [1/s], [1/s^2]."""
    q1, q2 = 1.0, 5e6
    return math.sqrt(q1 + 2.0 * math.sqrt(q2)), math.sqrt(q2)


TIME_INVARIANT = {
    "luenberger": ("luenberger", []),
    "(10), frozen gain": (
        "homogeneous",
        [f"observer.k1={frozen_gains()[0]}", f"observer.k2={frozen_gains()[1]}", "observer.alpha=1"],
    ),
    "(10)": ("ltv", []),
}
"""Label -> observer and its settings. With alpha = 1, (11) is the first two states of (10) with a constant gain."""


def shares_of_falls(
    label: str, biases_deg: Sequence[float], worlds: int, seed: int
) -> dict[float, tuple[float, float]]:
    """Share of falls and mean velocity RMS error of the worlds that stood, by bias [deg]."""
    observer, settings = TIME_INVARIANT[label]
    experiment = prepare(
        load_scenario("push_recovery", [f"seed={seed}", f"duration_s={DURATION_S}", *settings], observer)
    )
    plant = experiment.scenario.plant
    rigs = [load_plant(dataclasses.replace(plant, equilibrium_bias_deg=e)) for e in biases_deg]
    result = experiment.run_many(
        [*range(worlds)] * len(rigs), plants=[rig for rig in rigs for _ in range(worlds)], keep_trajectory=False
    )
    fell = np.array([outcome.fell for outcome in result.outcomes]).reshape(len(rigs), worlds)
    rms = errors(result).reshape(len(rigs), worlds)
    return {
        e: (float(f.mean()), float(np.nanmean(r)) if not f.all() else math.nan)
        for e, f, r in zip(biases_deg, fell, rms, strict=True)
    }


def run(on_share: OnShare, worlds: int = WORLDS, seed: int = SEED) -> list[Claim]:
    """The time-invariant observer that the paper could not stabilise the rig with."""
    counts = {"luenberger": worlds, "(10), frozen gain": max(2, worlds // 4), "(10)": max(2, worlds // 4)}
    found = {}
    for i, (label, count) in enumerate(counts.items()):
        found[label] = shares_of_falls(label, BIASES_DEG, count, seed)
        on_share((i + 1) / len(counts))
    model = printed_model()
    lever = model.gravity_torque / model.J1
    h11, h12 = frozen_gains()
    luenberger_bias = 20.0 * lever / (150.0 - lever)  # of its estimated rate at rest, per radian of e [1/s]
    frozen_bias = lever * h11 / h12
    return [
        luenberger_claim(found, worlds, luenberger_bias, frozen_bias),
        frozen_claim(found, counts["(10), frozen gain"]),
    ]


Falls = Mapping[str, Mapping[float, tuple[float, float]]]
"""Label -> bias [deg] -> share of falls, mean velocity RMS error of the worlds that stood [rad/s]."""


def luenberger_claim(found: Falls, worlds: int, luenberger_bias: float, frozen_bias: float) -> Claim:
    """The Luenberger observer of the predecessor in the loop."""
    fails = [e for e in BIASES_DEG if found["luenberger"][e][0] == 1.0]
    stands = [e for e in BIASES_DEG if found["luenberger"][e][0] == 0.0]
    listed = ", ".join(f"{share:.0%} at {e:g} deg" for e, (share, _) in found["luenberger"].items())
    return Claim(
        place="Section V, the predecessor's observer",
        says="With a time-invariant (Luenberger) observer, as the predecessor's, the rig could not be stabilised.",
        found=(
            f"sokolov2019's Luenberger observer on the linearisation (6), {worlds} seeds, the same push: share of "
            f"falls {listed}. At rest e biases its estimated rate by {luenberger_bias:.1f} e/s, that of (10) by "
            f"{frozen_bias:.1f} e/s."
        ),
        verdict=verdict(bool(fails), "bias"),
        why=(
            f"With the predecessor's gain and a bias of {min(fails):g} deg or more; it stands at "
            f"{', '.join(f'{e:g}' for e in stands) or 'no other bias tried'} deg."
            if fails
            else "It does not fall in every world at any bias tried."
        ),
        figures={
            "bias_deg": list(BIASES_DEG),
            **_figures("luenberger", found),
            "rate_bias_luenberger_rad_s_per_rad": luenberger_bias,
            "rate_bias_10_rad_s_per_rad": frozen_bias,
        },
        pictures=[_falls_picture(found)],
    )


def frozen_claim(found: Falls, worlds: int) -> Claim:
    """(10) with a constant gain, which is the time-invariant particular case of it."""
    frozen, whole = found["(10), frozen gain"], found["(10)"]
    fell = max(share for share, _ in frozen.values())
    fails = fell > 0.5
    return Claim(
        place="Section V, the time-invariant case of (10)",
        says="A linear time-invariant observer, a particular case of (10), could not stabilise the rig.",
        found=(
            f"(10) with its gain frozen at the value at which the Riccati equation settles at rest, {worlds} seeds a "
            f"bias, e from {min(frozen):g} to {max(frozen):g} deg: it falls in {fell:.0%} at most. Velocity RMS error "
            f"at 0.5 deg {frozen[0.5][1]:.4f} rad/s, (10) itself {whole[0.5][1]:.4f}."
        ),
        verdict=verdict(fails, ""),
        why=(
            ""
            if fails
            else "J2 is so small that A' and with it H hardly vary: a constant gain of this size is (10) to the digits "
            "given. What fails in the predecessor's observer is not that its gain is constant, but its size, and the "
            "linear model, which takes gravity at the estimate."
        ),
        figures={"bias_deg": list(BIASES_DEG), **_figures("(10), frozen gain", found), **_figures("(10)", found)},
    )


def _figures(label: str, found: Falls) -> dict[str, Any]:
    return {
        f"fell_fraction_{label}": [share for share, _ in found[label].values()],
        f"velocity_rms_error_{label}_rad_s": [None if math.isnan(rms) else rms for _, rms in found[label].values()],
    }


def _falls_picture(found: Falls) -> Picture:
    styles = ("o-", "s-", ".--")
    shares, rms = (
        [
            Line(BIASES_DEG, [factor * values[part] for values in by_bias.values()], label, style)
            for style, (label, by_bias) in zip(styles, found.items(), strict=True)
        ]
        for part, factor in ((0, 100.0), (1, 1.0))
    )
    return Picture(
        "aranovskiy2020-time-invariant",
        "aranovskiy2020, Section V: a time-invariant observer in the loop, with the push",
        [
            Panel("share of falls [%]", shares, y_range=(-5.0, 105.0)),
            Panel("velocity\nRMS error [rad/s]", rms, "of the worlds that stood", "equilibrium bias e [deg]"),
        ],
    )
