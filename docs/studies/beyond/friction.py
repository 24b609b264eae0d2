"""A friction model in the observer, on a rig that rubs and on one that does not."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from beyond.push_recovery import ERROR, gain, on_rigs, push_recovery
from cmg_mj.papers.claim import Claim, OnShare
from cmg_mj.papers.pair import PUSH_RECOVERY
from cmg_mj.results.intervals import known_interval

SEED, WORLDS = 90_001, 100
FRICTION_N_M = 0.05
WITH = {False: "without", True: "with"}


def claims(on_share: OnShare) -> list[Claim]:
    """Judge a friction model in the observer."""
    return [friction_claim(friction(WORLDS, SEED, on_share))]


def friction(worlds: int, seed: int, on_share: OnShare, settings: Sequence[str] = ()) -> dict[str, Any]:
    """Run dry friction in the plant and in the observer, each with and without the other.

    Args:
        worlds: Number of worlds, the same ones each time.
        seed: Seed of the sensors' noise.
        on_share: Called with the share done.
        settings: Settings `section.field=value` that differ in `push_recovery`.

    Returns:
        Mean errors by plant and observer; the gain of the observer's friction model on both plants, and how much of
        the gain on the rig that rubs is not had on the one that does not.
    """
    results = {}
    for model in (False, True):
        observer = f"observer.friction_n_m={FRICTION_N_M if model else 0.0}"
        experiment = push_recovery("homogeneous", seed, [observer, *settings])
        rigs = on_rigs(experiment, worlds, "tilt_friction_n_m", (0.0, FRICTION_N_M))
        results[False, model], results[True, model] = rigs
        on_share(0.5 + 0.5 * model)
    means = {
        f"{WITH[rig]}_friction_in_the_plant_{WITH[model]}_in_the_observer_rad_s": results[rig, model].mean(ERROR)
        for rig in (False, True)
        for model in (False, True)
    }
    values = {key: result.values(ERROR) for key, result in results.items()}
    gains = {f"gain_{WITH[rig]}_friction_rad_s": gain(values[rig, False], values[rig, True]) for rig in WITH}
    due = (values[True, False] - values[True, True]) - (values[False, False] - values[False, True])
    return means | gains | {"gain_due_to_friction_rad_s": known_interval(due), "worlds": worlds, "seed": seed}


def friction_claim(figures: dict[str, Any]) -> Claim:
    """Judge the figures of `friction`: knowing the friction helps if it brings more than damping."""
    due = figures["gain_due_to_friction_rad_s"]
    return Claim(
        place="Future work of both papers: friction in the observer",
        statement="a friction model in the velocity estimator would reduce its modelling errors",
        assumes={**PUSH_RECOVERY, "friction": f"{FRICTION_N_M:g} N m, dry, on the tilt axis"},
        holds=due is not None and due.low > 0.0,
        conditions=(
            "Most of the gain is damping that would help without any friction; push_recovery, e = 0.5 deg, 400 ug/rtHz."
        ),
        otherwise="Its gain on the rig with friction is, within chance, damping that helps without any friction.",
        figures=figures,
    )
