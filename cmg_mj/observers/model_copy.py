"""What the observers have in common that run a copy of the reduced model beside the rig."""

from __future__ import annotations

import numpy as np

from cmg_mj.errors import InputError


def require_stable_step(names: str, poles: np.ndarray, dt: float) -> None:
    """Refuse poles that one classical Runge-Kutta step a sample does not follow stably.

    Args:
        names: The parameters that make the poles.
        poles: Of the linear part of the error system [1/s].
        dt: Sample period [s].

    Raises:
        InputError: A pole is outside.
    """
    z = dt * poles
    if np.abs(1.0 + z + z**2 / 2.0 + z**3 / 6.0 + z**4 / 24.0).max() >= 1.0:
        listed = ", ".join(f"{pole:.3g}" for pole in poles)
        raise InputError(
            f"{names}: too fast for the sample period: the poles {listed} 1/s of the linear part are outside "
            f"the stability region of a Runge-Kutta step of {dt:g} s"
        )
