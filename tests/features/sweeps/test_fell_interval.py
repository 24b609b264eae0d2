"""The interval of a share of falls against the probability of every count."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from cmg_mj.features.sweeps.cells import fell_interval


@pytest.mark.parametrize("worlds", [100, 400])
@pytest.mark.parametrize("share", [0.05, 0.2, 0.5])
def test_the_share_of_falls_is_covered(share: float, worlds: int) -> None:
    """Wilson's interval, exactly."""
    low, high = np.array([fell_interval(n_fallen, worlds)[1:] for n_fallen in range(worlds + 1)]).T
    is_covered = (low <= share) & (share <= high)
    exactly = stats.binom.pmf(np.arange(worlds + 1), worlds, share)[is_covered].sum()
    assert 0.925 <= exactly <= 0.975
