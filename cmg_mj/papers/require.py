"""Parameters that must be numbers, in the papers' general forms, which take any types."""

from __future__ import annotations

import math
import numbers
from typing import Any

from cmg_mj.core.errors import InputError, shown


def require_number(name: str, value: Any) -> float:
    """Refuse a parameter that is not a real number; NaN and infinity pass."""
    text = shown(value)
    if not isinstance(value, numbers.Real):
        raise InputError(f"{name} = {text}: must be a number")
    return float(value)


def require_positive(name: str, value: Any) -> float:
    """Refuse a parameter that is not a positive, finite number."""
    text = shown(value)
    if not (isinstance(value, numbers.Real) and 0.0 < float(value) < math.inf):
        raise InputError(f"{name} = {text}: must be a number greater than 0")
    return float(value)
