"""Matrices with leading dimensions: what is refused of them, and products and solutions with one vector each."""

from __future__ import annotations

from typing import Any

import numpy as np

from cmg_mj.core.errors import InputError, shown

SYMMETRIC = 1e-10
"""Relative asymmetry of a matrix that is symmetric but for rounding."""


def require_shape(name: str, value: np.ndarray, shape: tuple[int, ...], words: str) -> None:
    """Refuse what does not end in this shape, which `words` explain."""
    if value.shape[-len(shape) :] != shape:
        raise InputError(f"{name}: must have the shape {shape}, {words}; it has {value.shape}")


def to_real(name: str, value: Any) -> np.ndarray:
    """Return an array of floats; refuse what is not real numbers."""
    try:
        array = np.asarray(value)
    except ValueError as error:  # rows of different lengths
        raise InputError(f"{name}: must be an array of real numbers, with rows of one length") from error
    if array.dtype.kind not in "iuf":
        raise InputError(f"{name} = {shown(value)}: must be real numbers, not {array.dtype}".replace("\n", ""))
    return array.astype(float, copy=False)


def to_matrix(name: str, value: Any) -> np.ndarray:
    """Return an array of floats with at least two dimensions; refuse what is not finite."""
    matrix = to_real(name, value)
    if matrix.ndim < 2 or not np.isfinite(matrix).all():
        fault = f"not of shape {matrix.shape}" if matrix.ndim else f"not a scalar; for one number write [[{matrix:g}]]"
        raise InputError(f"{name}: must be a matrix of finite numbers, {fault}")
    return matrix


def require_positive_definite(name: str, matrix: np.ndarray) -> None:
    """Refuse a matrix that is not symmetric and positive definite."""
    mirrored = np.swapaxes(matrix, -1, -2)
    if np.abs(matrix - mirrored).max() > SYMMETRIC * np.abs(matrix).max():
        raise InputError(f"{name}: must be symmetric and positive definite; it is not symmetric")
    least = float(np.linalg.eigvalsh((matrix + mirrored) / 2.0).min())
    if least <= 0.0:
        raise InputError(f"{name}: must be symmetric and positive definite; its least eigenvalue is {least:.3g}")


def times(matrix: np.ndarray, vector: np.ndarray) -> np.ndarray:
    """Multiply matrix and vector, (..., a, b) and (..., b) -> (..., a)."""
    return (matrix @ vector[..., None])[..., 0]


def solve(matrix: np.ndarray, vector: np.ndarray) -> np.ndarray:
    """Solve for one right-hand side, (..., a, a) and (..., a) -> (..., a)."""
    if matrix.shape[-1] == 1:
        return vector / matrix[..., 0]
    return np.linalg.solve(matrix, vector[..., None])[..., 0]
