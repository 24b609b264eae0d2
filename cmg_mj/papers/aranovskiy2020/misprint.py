"""The Riccati equation of (10) as aranovskiy2020 prints it: with A^T of (6) where A'^T belongs."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cmg_mj.papers.aranovskiy2020.forms_of_10 import Comparison, Method, Plain, compare, rk4, rk4_as_printed
from cmg_mj.papers.aranovskiy2020.paper import H_0, A_prime
from cmg_mj.papers.aranovskiy2020.rig import SEED_OF_10
from cmg_mj.papers.claim import Claim, OnShare

SETTLING_S = 8.0
"""The slowest entry, H33, takes 1 s to fall by e^2 [s]."""
HARMLESS = 0.05
"""Share of the rate's error: if the misprint changes the rate by less, either equation may have been run."""


class Misprint(NamedTuple):
    """The changes that the printed Riccati equation makes."""

    corrected_H: np.ndarray
    """H where the corrected equation settles at rest, (3, 3)."""
    printed_H: np.ndarray
    """H where the printed one does, (3, 3)."""
    rate: Comparison
    """The corrected form and the printed one along a closed-loop run."""


def settle(method: Method, h: float = 1e-3) -> np.ndarray:
    """Return H where a method settles at rest, (3, 3)."""
    H = H_0
    for _ in range(round(SETTLING_S / h)):
        H = method(H, A_prime(), h)
    return H


def misprint(seed: int = SEED_OF_10) -> Misprint:
    """Integrate both equations, at rest and along a run, with Runge-Kutta 4."""
    comparison = compare(Plain(rk4), Plain(rk4_as_printed), seed)
    return Misprint(settle(rk4), settle(rk4_as_printed), comparison)


def misprint_claim(seed: int = SEED_OF_10) -> Claim:
    """Judge the Riccati equation as printed."""
    H, printed_H, rate = misprint(seed)
    asymmetry = float(abs(printed_H[0, 1] - printed_H[1, 0]) / printed_H[1, 0])
    gain = float(np.abs(printed_H[:, ::2] - H[:, ::2]).max() / np.abs(H[:, ::2]).max())
    return Claim(
        place="After (10), the Riccati equation",
        statement="The symmetric gain matrix of (10) is the solution of H' = H A^T + A' H - H C^T C H + Q.",
        holds=asymmetry < 1e-6 or rate.difference < HARMLESS * rate.error,
        conditions=(
            ""
            if asymmetry < 1e-6
            else "With A'^T for the printed A^T, which is that of (6): a misprint. The observer's rate is the same to "
            f"{rate.difference / rate.error:.1%} of its error, whichever of them was run."
        ),
        otherwise="As printed it is not symmetric, and the observer would be another one.",
        figures={
            "H12_printed": float(printed_H[0, 1]),
            "H21_printed": float(printed_H[1, 0]),
            "H12": float(H[0, 1]),
            "largest_change_of_gain_share": gain,
            "rate_changed_rad_s": rate.difference,
            "rate_error_rad_s": rate.error,
            "rate_error_printed_rad_s": rate.other_error,
        },
    )


def claims(on_share: OnShare) -> list[Claim]:
    """Judge the misprint."""
    return [misprint_claim()]
