"""When poles count as stable."""

from __future__ import annotations

from typing import Any

import numpy as np

MARGIN = 1e-6
"""A mode that takes longer than 1/MARGIN to fade, eleven days, is none that fades [1/s].

Rounding moves a pole at zero by about 1e-16 times the largest entry, to either side and otherwise on every processor.
"""


def is_hurwitz(poles: Any) -> bool:
    """Whether every mode fades.

    Args:
        poles: Eigenvalues of a system's matrix [1/s].

    Returns:
        Whether all lie left of -MARGIN.
    """
    return bool(np.max(np.real(poles)) < -MARGIN)
