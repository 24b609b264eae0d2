"""The plugin's noise in C against NumPy's."""

from __future__ import annotations

import ctypes
from pathlib import Path

import numpy as np
import pytest

import cmg_mj.features.plugin as package
from tests.features.export.compiled import compile_c, needs_compiler

pytestmark = needs_compiler

SOURCES = Path(package.__file__).parent / "c"
WORDS = 8


@pytest.fixture(scope="module")
def noise(tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    """`noise.c`, compiled without a warning."""
    library = tmp_path_factory.mktemp("noise") / "noise.so"
    compile_c("-shared", "-fPIC", SOURCES / "noise.c", "-o", library, "-lm")
    return ctypes.CDLL(str(library))


def start(noise: ctypes.CDLL, seed: int, world: int, stream: int) -> np.ndarray:
    words = np.zeros(WORDS)
    noise.noise_start(words.ctypes.data_as(ctypes.c_void_p), ctypes.c_double(seed), ctypes.c_double(world), stream)
    return words


def draw(noise: ctypes.CDLL, words: np.ndarray, n: int) -> np.ndarray:
    drawn = np.empty(n)
    noise.noise_normals(*(array.ctypes.data_as(ctypes.c_void_p) for array in (words, drawn)), n)
    return drawn


KEYS = [(0, 0, 0), (1, 2, 4), (2**32, 2**32 - 1, 16), (12345, 2**40, 20), (2**53, 2**53, 83)]


@pytest.mark.parametrize(("seed", "world", "stream"), KEYS)
def test_normals_are_numpys(noise: ctypes.CDLL, seed: int, world: int, stream: int) -> None:
    words = start(noise, seed, world, stream)
    ours = np.concatenate([draw(noise, words, n) for n in (1, 4, 16, 9979)])
    expected = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(world, stream))).standard_normal(10000)
    np.testing.assert_array_equal(ours, expected)
    np.testing.assert_array_equal(words, np.floor(words))
    assert words.min() >= 0
    assert words.max() < 2**32


@pytest.mark.slow
def test_ten_million_normals(noise: ctypes.CDLL) -> None:
    """The tail and every layer of the ziggurat come up."""
    for seed in range(10):
        drawn = draw(noise, start(noise, seed, 0, 0), 1_000_000)
        expected = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(0, 0))).standard_normal(1_000_000)
        np.testing.assert_array_equal(drawn, expected)
        assert np.abs(drawn).max() > 3.6541528853610088
