"""sokolov2019, Table II: one tuning against a search on a grid, and the verdict on made-up ones."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cmg_mj.features.tuning import NoiseLevelResult
from cmg_mj.papers.sokolov2019 import figure_3
from cmg_mj.papers.sokolov2019.paper import OBSERVERS

SEED = 5_000


def level(printed: Sequence[float], tuned: Sequence[float]) -> NoiseLevelResult:
    """With these errors on the held-out worlds."""
    rms, printed_rms = np.array(tuned), np.array(printed)
    return NoiseLevelResult(
        400.0, {}, {"tau": 0.02}, (), float(rms.mean()), float(printed_rms.mean()), rms, printed_rms, 1.0, 0
    )


BEATEN, TIED = level([1.2, 1.3, 1.25], [1.0, 1.05, 1.02]), level([1.0, 1.1, 1.05], [1.01, 1.09, 1.05])


def test_the_printed_values_must_be_best_on_one_recording() -> None:
    def holds(*by_observer: Sequence[NoiseLevelResult]) -> bool:
        claim = figure_3.tuning_claim({"a push": dict(zip(OBSERVERS, by_observer, strict=True))})
        assert claim.verdict == "cannot be tested"  # their recording is not ours
        return claim.holds is True

    assert holds([TIED], [TIED], [TIED])
    assert not holds([TIED], [BEATEN], [TIED])
    assert not holds([TIED, BEATEN], [BEATEN, TIED], [TIED, TIED])  # not at the same noise
    assert holds([TIED, BEATEN], [TIED, BEATEN], [TIED, BEATEN])
