"""Accelerometers anywhere in the tilting plane, against rigid-body kinematics, the radial pair, and sampled noise."""

from __future__ import annotations

import math

import numpy as np
import pytest

from cmg_mj.core.errors import InputError
from cmg_mj.core.planar_tilt import PlanarTilt
from cmg_mj.core.tilt import PairTilt

G = 9.81
RNG = np.random.default_rng(4)
Y, RATE, ALPHA = 0.3, 2.0, -7.0
ACROSS_50_MM = (0.0265 + 0.1656j, -0.0133 + 0.1607j)
CASES = [
    (ACROSS_50_MM, False, False),
    ((*ACROSS_50_MM, -0.1 + 0.05j), False, False),
    (ACROSS_50_MM[:1], True, False),
    (ACROSS_50_MM, True, False),
    (ACROSS_50_MM, True, True),
]


def forces(places: tuple[complex, ...], pivot: complex = 0.0) -> list[np.ndarray]:
    """Specific forces by the vectors of rigid-body kinematics, in the world's axes, turned into the body's."""
    turn = np.array([[np.cos(Y), np.sin(Y)], [-np.sin(Y), np.cos(Y)]])  # a growing tilt moves the top across
    result = []
    for place in places:
        arm = turn @ [place.real, place.imag]
        acceleration = ALPHA * np.array([arm[1], -arm[0]]) - RATE**2 * arm + np.array([pivot.real, pivot.imag])
        x, z = turn.T @ (acceleration + np.array([0.0, G]))
        result.append(np.array([x + 1j * z]))
    return result


@pytest.mark.parametrize(("places", "has_angle", "moves"), CASES)
def test_the_motion_that_it_was(places: tuple[complex, ...], has_angle: bool, moves: bool) -> None:
    tilt = PlanarTilt(places, tuple(0.1 + 0.1 * i for i in range(len(places))), G, has_angle, moves)
    pivot = 3.0 + 1.0j if moves else 0.0
    y, alpha = tilt(forces(places, pivot), np.array([Y]) if has_angle else None)
    assert (y.item(), alpha.item()) == pytest.approx((Y, ALPHA))


PAIRS = [
    PairTilt(0.067, 0.202),
    PairTilt(0.1656, 0.1607, across=(0.0265, -0.0133)),
    PairTilt(-0.05, 0.2, across=(0.0, 0.1), angles=(math.pi / 2.0, -2.0)),
]


@pytest.mark.parametrize("pair", PAIRS)
def test_two_are_the_pair_of_the_rig(pair: PairTilt) -> None:
    planar = PlanarTilt(tuple(c + 1j * r for r, c in pair.places), (0.4, 0.4), G)
    exact = [np.exp(-1j * angle) * f for f, angle in zip(forces(planar.places), pair.angles, strict=True)]
    across, up = -G * np.sin(Y), G * np.cos(Y)
    np.testing.assert_allclose(pair.forces(across, up, ALPHA, RATE), [x for f in exact for x in (*f.real, *f.imag)])
    seen = [f + 0.3 * (RNG.normal(size=9) + 1j * RNG.normal(size=9)) for f in exact]
    y, alpha = planar([f * np.exp(1j * angle) for f, angle in zip(seen, pair.angles, strict=True)])
    of_pair = [part for f in seen for part in (f.real, f.imag)]
    np.testing.assert_allclose(pair(*of_pair), y)
    np.testing.assert_allclose(pair.acceleration(*of_pair), alpha)
    assert vars(pair.noise(0.4, G)) == pytest.approx(vars(planar.noise()))


@pytest.mark.parametrize(("places", "has_angle", "moves"), CASES)
def test_its_noise_is_that_of_samples(places: tuple[complex, ...], has_angle: bool, moves: bool) -> None:
    sigmas = tuple(0.01 + 0.01 * i for i in range(len(places)))
    tilt, n = PlanarTilt(places, sigmas, G, has_angle, moves), 40_000
    seen = [1j * G + s * (RNG.normal(size=n) + 1j * RNG.normal(size=n)) for s in sigmas]
    y, alpha = tilt(seen, 0.002 * RNG.normal(size=n) if has_angle else None)
    noise = tilt.noise(0.002)
    assert (noise.tilt, noise.acceleration) == pytest.approx((y.std(), alpha.std()), rel=0.02)
    assert noise.correlation == pytest.approx(np.corrcoef(y, alpha)[0, 1], abs=0.02)


@pytest.mark.parametrize(
    ("places", "has_angle", "moves"), [((0.2j,), False, False), ((0.2j,), True, True), ((0j,), True, False)]
)
def test_what_shows_no_angular_acceleration_is_refused(
    places: tuple[complex, ...], has_angle: bool, moves: bool
) -> None:
    with pytest.raises(InputError, match="do not show the angular acceleration"):
        PlanarTilt(places, (0.1,), G, has_angle, moves)
