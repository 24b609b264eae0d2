"""Functions that take a float for one world or an array (n_worlds,) for many.

NumPy's functions cost a microsecond on a float, `math`'s fifty nanoseconds, and `math` refuses arrays.
Observers and sensors call these instead, so that one formula serves one world and many at full speed.

Both branches must round alike. While quantisation makes two readings equal, nothing holds two runs of an unstable
plant together: a difference in the last bit grows by a factor e every 0.13 s until it flips a count, and a batch
would no longer be the same as its single runs.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import reduce
from math import copysign
from operator import add, mul
from typing import Any

import numpy as np

# A number for one world, or an array with one number a world. `Any` because operators on the union
# of float and ndarray are what every formula here consists of.
Scalar = Any

SMALLEST = 1e-200  # below this a number counts as zero where it is divided by


class Symbolic:
    """A symbol in place of a number while a formula is traced, as `export` does.

    NumPy's functions hand over to what brings an `__array_ufunc__`, so that a symbol takes the arrays' branches. It is
    asked for only where those are not the plain function.
    """

    __slots__ = ()

    @property
    def is_array(self) -> bool:
        """Whether it stands for the numbers of many worlds."""
        return False


def _traced(x: Any) -> bool:
    return isinstance(x, Symbolic)


def sin(x: Scalar) -> Scalar:
    """Sine, elementwise."""
    return math.sin(x) if type(x) is float else np.sin(x)


def cos(x: Scalar) -> Scalar:
    """Cosine, elementwise."""
    return math.cos(x) if type(x) is float else np.cos(x)


def sqrt(x: Scalar) -> Scalar:
    """Square root, elementwise."""
    return math.sqrt(x) if type(x) is float else np.sqrt(x)


def atan2(y: Scalar, x: Scalar) -> Scalar:
    """Angle of the point (x, y) [rad], elementwise."""
    if type(y) is float:
        return math.atan2(y, x)
    if _traced(y):
        return np.arctan2(y, x)
    # `np.arctan2` may take a vector instruction that rounds differently from the C library; the complex
    # logarithm takes its angle from the library.
    with np.errstate(divide="ignore"):  # the logarithm of 0, whose angle is 0
        return np.log(x + 1j * y).imag


def exp(x: Scalar) -> Scalar:
    """Exponential, elementwise, for x up to 700."""
    if type(x) is float:
        return math.exp(x)
    # `np.exp` may take a vector instruction that rounds differently from the C library; for complex numbers it
    # takes the library's.
    return np.exp(x) if _traced(x) else np.exp(x + 0j).real


def dot(a: Sequence[Scalar], b: Sequence[Scalar]) -> Scalar:
    """Sum of the products of two short sequences, term by term from the left.

    Python's own `sum` compensates rounding on floats since 3.12, and would differ from the same on arrays.
    """
    return reduce(add, map(mul, a, b))


def radians(degrees: Scalar) -> Scalar:
    """Return an angle in rad, elementwise; for a float equal to `math.radians`."""
    return degrees * (math.pi / 180.0)


def sign(x: Scalar) -> Scalar:
    """Sign of x, zero at zero, elementwise."""
    return float((x > 0.0) - (x < 0.0)) if type(x) is float else np.sign(x)


def signed_power(x: Scalar, exponent: float) -> Scalar:
    """[x]^a = |x|^a sign(x) for a > 0, elementwise."""
    if type(x) is float:
        try:
            return copysign(abs(x) ** exponent, x)
        except OverflowError:  # as on arrays
            return copysign(math.inf, x)
    return np.copysign(np.float_power(np.abs(x), exponent), x)  # not `np.power`: see below


def signed_powers(x: Scalar, exponent: float) -> tuple[Scalar, Scalar]:
    """Return [x]^a and [x]^(2a - 1), where [x]^a = |x|^a sign(x), as aranovskiy2020 (11) needs them.

    The second is the first one's square over |x|: one power instead of two.
    """
    if type(x) is float:
        size = abs(x)
        if size < SMALLEST:
            return 0.0 * x, 0.0 * x
        power = size**exponent
        return copysign(power, x), copysign(power * power / size, x)
    # `np.power` may take a vector instruction that rounds differently from the C library; `np.float_power` does not.
    size = np.abs(x)
    power = np.where(size < SMALLEST, 0.0, np.float_power(size, exponent))
    return np.copysign(power, x), np.copysign(power * power / np.maximum(size, SMALLEST), x)


def clip(x: Scalar, low: float, high: float) -> Scalar:
    """Limit x to [low, high], elementwise."""
    if type(x) is float:
        return low if x < low else high if x > high else x
    return np.minimum(np.maximum(x, low), high)  # np.clip takes longer


def where(condition: Scalar, a: Scalar, b: Scalar) -> Scalar:
    """Choose a where the condition holds and b elsewhere. Both are evaluated."""
    if type(condition) is bool:
        return a if condition else b
    return np.where(condition, a, b)


def digitise(x: Scalar, limit: float, step: float) -> Scalar:
    """Saturate x at +-limit and round it to the nearest multiple of step (no rounding if step is 0).

    Ties go to the even multiple, in `round` as in `np.rint`.
    """
    if type(x) is float:
        if not -limit < x < limit:
            x = copysign(limit, x)
        return round(x / step) * step if step else x
    x = np.minimum(np.maximum(x, -limit), limit)
    if _traced(x):
        counts = np.rint(x / step)
        if not x.is_array:
            counts = counts + 0.0  # makes -0 to 0, as `round` does
        return np.where(step != 0.0, counts * step, x) if _traced(step) else counts * step if step else x
    return np.rint(x / step) * step if step else x
