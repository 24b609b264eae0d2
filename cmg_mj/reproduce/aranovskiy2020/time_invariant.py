"""The time-invariant observer with which the rig of aranovskiy2020 could not be stabilised."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

import numpy as np

from cmg_mj.picture import Line, Panel, Picture
from cmg_mj.plant import load_plant
from cmg_mj.reproduce.aranovskiy2020.linearisation import printed_model
from cmg_mj.reproduce.aranovskiy2020.rig_loop import DURATION_S, WORLDS, errors
from cmg_mj.reproduce.claim import Claim, OnShare, verdict
from cmg_mj.scenario import load_scenario, prepare

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
    fails = [e for e in BIASES_DEG if found["luenberger"][e][0] == 1.0]
    stands = [e for e in BIASES_DEG if found["luenberger"][e][0] == 0.0]
    listed = ", ".join(f"{share:.0%} at {e:g} deg" for e, (share, _) in found["luenberger"].items())
    frozen_fall = max(share for share, _ in found["(10), frozen gain"].values())
    half = found["(10), frozen gain"][0.5][1], found["(10)"][0.5][1]
    return [
        Claim(
            place="Section V, the time-invariant observer",
            says="A linear time-invariant observer, a particular case of (10), could not stabilise the rig.",
            found=(
                f"The Luenberger observer of the predecessor on the linearisation (6), {worlds} seeds, the same push: "
                f"share of falls {listed}. But (10) with its gain frozen at H's steady value, "
                f"{counts['(10), frozen gain']} seeds a bias, falls in {frozen_fall:.0%} and has a velocity RMS error "
                f"of {half[0]:.4f} rad/s at 0.5 deg, (10) itself {half[1]:.4f}: J2 is so small that H hardly varies. "
                "What fails is not the constant gain but its size and the model: at rest e biases the estimated rate "
                f"by {luenberger_bias:.1f} e/s there and by {frozen_bias:.1f} e/s in (10)."
            ),
            verdict=verdict(bool(fails), "bias"),
            why=(
                f"For the Luenberger observer with the predecessor's gain and a bias of {min(fails):g} deg or more; "
                f"it stands at {', '.join(f'{e:g}' for e in stands)} deg. (10) with a frozen gain does not fail."
                if fails
                else "It stands at every bias tried."
            ),
            figures={
                "bias_deg": list(BIASES_DEG),
                **{
                    f"fell_fraction_{label}": [share for share, _ in by_bias.values()]
                    for label, by_bias in found.items()
                },
                **{
                    f"velocity_rms_error_{label}_rad_s": [None if math.isnan(r) else r for _, r in by_bias.values()]
                    for label, by_bias in found.items()
                },
                "rate_bias_luenberger_rad_s_per_rad": luenberger_bias,
                "rate_bias_10_rad_s_per_rad": frozen_bias,
            },
            pictures=[_falls_picture(found)],
        )
    ]


def _falls_picture(found: dict[str, dict[float, tuple[float, float]]]) -> Picture:
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
