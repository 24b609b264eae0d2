"""The plugin's noise in C against NumPy's."""

from __future__ import annotations

import ctypes
import subprocess
from pathlib import Path

import numpy as np
import pytest

import cmg_mj.features.plugin as package
from tests.features.export.compiled import COMPILER, STRICT, needs_compiler

pytestmark = needs_compiler

SOURCES = Path(package.__file__).parent / "c"
WORDS = 8


class Noise:
    """`noise.c`, compiled without a warning."""

    def __init__(self, folder: Path) -> None:
        library = folder / "noise.so"
        command = [str(COMPILER), *STRICT, "-shared", "-fPIC", str(SOURCES / "noise.c"), "-o", str(library), "-lm"]
        subprocess.run(command, check=True, timeout=300)
        self._loaded = ctypes.CDLL(str(library))

    def start(self, seed: int, world: int, stream: int) -> np.ndarray:
        words = np.zeros(WORDS)
        start = self._loaded.noise_start
        start(words.ctypes.data_as(ctypes.c_void_p), ctypes.c_double(seed), ctypes.c_double(world), stream)
        return words

    def draw(self, words: np.ndarray, n: int) -> np.ndarray:
        drawn = np.empty(n)
        pointers = [array.ctypes.data_as(ctypes.c_void_p) for array in (words, drawn)]
        self._loaded.noise_normals(*pointers, n)
        return drawn


@pytest.fixture(scope="module")
def noise(tmp_path_factory: pytest.TempPathFactory) -> Noise:
    return Noise(tmp_path_factory.mktemp("noise"))


KEYS = [(0, 0, 0), (1, 2, 4), (2**32, 2**32 - 1, 16), (12345, 2**40, 20), (2**53, 2**53, 83)]


@pytest.mark.parametrize(("seed", "world", "stream"), KEYS)
def test_normals_are_numpys(noise: Noise, seed: int, world: int, stream: int) -> None:
    words = noise.start(seed, world, stream)
    ours = np.concatenate([noise.draw(words, n) for n in (1, 4, 16, 9979)])
    expected = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(world, stream))).standard_normal(10000)
    np.testing.assert_array_equal(ours, expected)
    np.testing.assert_array_equal(words, np.floor(words))
    assert words.min() >= 0
    assert words.max() < 2**32


@pytest.mark.slow
def test_ten_million_normals(noise: Noise) -> None:
    """The tail and every layer of the ziggurat come up."""
    for seed in range(10):
        drawn = noise.draw(noise.start(seed, 0, 0), 1_000_000)
        expected = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(0, 0))).standard_normal(1_000_000)
        np.testing.assert_array_equal(drawn, expected)
        assert np.abs(drawn).max() > 3.6541528853610088


@pytest.mark.parametrize("written", [np.nan, -1.0, 1e300, 0.5])
def test_whatever_is_written_into_the_state(noise: Noise, written: float) -> None:
    assert np.all(np.isfinite(noise.draw(np.full(WORDS, written), 100)))
