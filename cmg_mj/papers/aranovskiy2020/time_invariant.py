"""The time-invariant observer with which the rig of aranovskiy2020 could not be stabilised."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from cmg_mj.papers.aranovskiy2020.paper import printed_model, settled_gains
from cmg_mj.papers.aranovskiy2020.rig import DURATION_S, push_recovery
from cmg_mj.papers.claim import Claim, OnShare
from cmg_mj.picture import Line, Panel, Picture
from cmg_mj.summary_keys import written

SEED = 72_002
BIASES_DEG = (0.0, 0.25, 0.5, 1.0)

LUENBERGER, FROZEN, WHOLE = "luenberger", "(10), frozen gain", "(10)"


class Case(NamedTuple):
    """An observer in the loop."""

    observer: str
    settings: Sequence[str]
    worlds: int
    """Seeds a bias."""


H11, H12 = settled_gains()
CASES = {
    LUENBERGER: Case("luenberger", [], 20),
    # With alpha = 1, (11) is the first two states of (10) with a constant gain.
    FROZEN: Case("homogeneous", [f"observer.k1={H11}", f"observer.k2={H12}", "observer.alpha=1"], 5),
    WHOLE: Case("ltv", [], 5),
}


class Fate(NamedTuple):
    """What became of the worlds at one bias."""

    fell: float
    """Share that fell."""
    error: float | None
    """Mean velocity RMS error of those that stood [rad/s]; None if none did."""


Fates = Mapping[str, Mapping[float, Fate]]
"""Label -> bias [deg] -> fate."""


def fates_of(
    label: str, biases_deg: Sequence[float], worlds: int, seed: int, duration_s: float = DURATION_S
) -> dict[float, Fate]:
    """Run one of `CASES` at several biases, in the same worlds each, with the push of Figs 5 to 7."""
    observer, settings, _ = CASES[label]
    biases = [e for e in biases_deg for _ in range(worlds)]
    numbers = [*range(worlds)] * len(biases_deg)
    experiment = push_recovery(observer, seed, settings, duration_s)
    result = experiment.run_many(numbers, vary={"equilibrium_bias_deg": biases}, keep_trajectory=False)
    return {
        e: Fate(float(group.fell.mean()), group.mean("velocity_rms_error_rad_s"))
        for e, group in zip(biases_deg, result.groups(len(biases_deg)), strict=True)
    }


def rate_biases() -> dict[str, float]:
    """Of the rate that an observer estimates at rest, per radian of e, in closed form [1/s]."""
    model = printed_model()
    lever = model.gravity_torque / model.J1
    return {LUENBERGER: 20.0 * lever / (150.0 - lever), FROZEN: lever * H11 / H12}


def luenberger_claim(found: Fates) -> Claim:
    """The Luenberger observer of the predecessor in the loop."""
    fates, biases = found[LUENBERGER], rate_biases()
    fails = [e for e, fate in fates.items() if fate.fell == 1.0]
    stands = [e for e, fate in fates.items() if fate.fell == 0.0]
    listed = ", ".join(f"{fate.fell:.0%} at {e:g} deg" for e, fate in fates.items())
    return Claim(
        place="Section V, the predecessor's observer",
        says="With a time-invariant (Luenberger) observer, as the predecessor's, the rig could not be stabilised.",
        found=(
            f"sokolov2019's Luenberger observer on the linearisation (6), {CASES[LUENBERGER].worlds} seeds, the same "
            f"push: share of falls {listed}. At rest e biases its estimated rate by {biases[LUENBERGER]:.1f} e/s, that "
            f"of (10) by {biases[FROZEN]:.1f} e/s."
        ),
        holds=bool(fails),
        conditions=(
            f"With the predecessor's gain and a bias of {min(fails, default=0.0):g} deg or more; it stands at "
            f"{', '.join(f'{e:g}' for e in stands) or 'no other bias tried'} deg."
        ),
        otherwise="It does not fall in every world at any bias tried.",
        figures={
            "bias_deg": list(fates),
            **_figures(LUENBERGER, found),
            "rate_bias_luenberger_rad_s_per_rad": biases[LUENBERGER],
            "rate_bias_10_rad_s_per_rad": biases[FROZEN],
        },
        pictures=[_picture(found)],
    )


def frozen_claim(found: Fates) -> Claim:
    """(10) with a constant gain, which is the time-invariant particular case of it."""
    frozen, whole = found[FROZEN], found[WHOLE]
    fell = max(fate.fell for fate in frozen.values())
    return Claim(
        place="Section V, the time-invariant case of (10)",
        says="A linear time-invariant observer, a particular case of (10), could not stabilise the rig.",
        found=(
            f"(10) with its gain frozen at the value at which the Riccati equation settles at rest, "
            f"{CASES[FROZEN].worlds} seeds a bias, e from {min(frozen):g} to {max(frozen):g} deg: it falls in "
            f"{fell:.0%} at most. Velocity RMS error at 0.5 deg {_error(frozen[0.5])} rad/s, (10) itself "
            f"{_error(whole[0.5])}."
        ),
        holds=fell > 0.5,
        otherwise=(
            "J2 is so small that A' and with it H hardly vary: a constant gain of this size is (10) to the digits "
            "given. What fails in the predecessor's observer is not that its gain is constant, but its size, and the "
            "linear model, which takes gravity at the estimate."
        ),
        figures={"bias_deg": list(frozen), **_figures(FROZEN, found), **_figures(WHOLE, found)},
    )


def _error(fate: Fate) -> str:
    return written("velocity_rms_error_rad_s", fate.error)


def _figures(label: str, found: Fates) -> dict[str, Any]:
    return {
        f"fell_fraction_{label}": [fate.fell for fate in found[label].values()],
        f"velocity_rms_error_{label}_rad_s": [fate.error for fate in found[label].values()],
    }


def _picture(found: Fates) -> Picture:
    shares, errors = [], []
    for style, (label, fates) in zip(("o-", "s-", ".--"), found.items(), strict=True):
        known = {e: fate.error for e, fate in fates.items() if fate.error is not None}
        shares.append(Line(list(fates), [100.0 * fate.fell for fate in fates.values()], label, style))
        errors.append(Line(list(known), list(known.values()), label, style))
    return Picture(
        "aranovskiy2020-time-invariant",
        "aranovskiy2020, Section V: a time-invariant observer in the loop, with the push",
        [
            Panel("share of falls [%]", shares, y_range=(-5.0, 105.0)),
            Panel("velocity\nRMS error [rad/s]", errors, "of the worlds that stood", "equilibrium bias e [deg]"),
        ],
    )


def claims(on_share: OnShare) -> list[Claim]:
    """The predecessor's observer, and the time-invariant case of (10)."""
    found = {}
    for i, (label, case) in enumerate(CASES.items()):
        found[label] = fates_of(label, BIASES_DEG, case.worlds, SEED)
        on_share((i + 1) / len(CASES))
    return [luenberger_claim(found), frozen_claim(found)]
