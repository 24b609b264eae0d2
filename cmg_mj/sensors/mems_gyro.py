"""A gyro of about two dollars, which no law or observer uses: what an estimate of the rate is judged beside."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from itertools import islice
from typing import Annotated

import numpy as np
from pydantic import Field
from pydantic.dataclasses import dataclass

from cmg_mj.elementwise import digitise
from cmg_mj.inputs.field_types import STRICT, NonNegative, Positive
from cmg_mj.sensors.flicker_noise import CORNERS_HZ, Flicker

PIECE = 1000
"""So many samples before the run are made together, whatever the rate."""


@dataclass(frozen=True, config=STRICT)
class MemsGyro:
    """A gyro of the MPU-6050 class: it sits in the accelerometers' own package (InvenSense PS-MPU-6000A, 3.4, 6.1).

    It shows the rate at every control tick. The white noise is the datasheet's 0.005 deg/s/rtHz. For the bias
    instability the datasheet has the noise from 1 to 10 Hz, 0.033 deg/s RMS: less the white noise's part,
    0.005 sqrt(9), it makes 1/f noise of 0.0194^2/f (deg/s)^2/Hz, whose Allan deviation stays at 82 deg/h. The scale
    error is the largest that the datasheet allows at 25 degrees Celsius. The offset, up to 20 deg/s, is taken off by a
    mean at rest before the run; its drift with temperature is left out, and so is the delay of the chip's own filter,
    as with the accelerometers.

    Attributes:
        noise_density_deg_s_rthz: White noise, one-sided density; one sample's sigma is density * sqrt(rate/2).
        bias_instability_deg_h: Floor of the Allan deviation that the 1/f noise has [deg/h].
        scale_error: The reading's slope less one.
        bias_deg_s: Constant offset that the mean at rest has not seen [deg/s].
        calibration_s: How long the mean at rest is taken [s]; 0 for no such mean.
        range_deg_s: Readings saturate here [deg/s].
        counts_per_deg_s: Resolution; 0 for none.
    """

    noise_density_deg_s_rthz: NonNegative = 0.005
    bias_instability_deg_h: NonNegative = 82.0
    scale_error: Annotated[float, Field(gt=-1.0, lt=1.0)] = 0.03
    bias_deg_s: float = 0.0
    calibration_s: Annotated[float, Field(ge=0.0, le=10.0)] = 1.0
    range_deg_s: Positive = 250.0
    counts_per_deg_s: NonNegative = 131.0

    channels = 1 + len(CORNERS_HZ)

    def white_noise_sigma(self, dt: float) -> float:
        """Standard deviation of one sample's white noise [rad/s].

        Args:
            dt: Sample period [s].
        """
        return math.radians(self.noise_density_deg_s_rthz) * math.sqrt(0.5 / dt)

    @property
    def flicker_floor(self) -> float:
        """Floor of the Allan deviation of the 1/f noise [rad/s]."""
        return math.radians(self.bias_instability_deg_h) / 3600.0

    def make_reading_function(self, dt: float, noise: Iterator) -> Callable[[np.ndarray], np.ndarray]:
        """The gyro at work.

        Args:
            dt: Sample period [s].
            noise: Standard normals, a sample after the other: `channels` numbers, or an array (channels, n_worlds).

        Returns:
            A function: the next samples' true rate (n_rows, n_worlds) -> what the gyro shows, the same shape [rad/s].
        """
        sigma = self.white_noise_sigma(dt)
        limit = math.radians(self.range_deg_s)
        step = math.radians(1.0 / self.counts_per_deg_s) if self.counts_per_deg_s else 0.0

        def drawn(n: int) -> np.ndarray:
            """(n, channels, n_worlds)."""
            return np.array(list(islice(noise, n))).reshape(n, self.channels, -1)

        flicker = Flicker(self.flicker_floor, dt, drawn(1)[0, 1:])

        def errors(n: int) -> np.ndarray:
            """Return the errors of the next n samples, (n, n_worlds) [rad/s]."""
            normals = drawn(n)
            return sigma * normals[:, 0] + flicker.advance(normals[:, 1:])

        resting = round(self.calibration_s / dt)
        pieces = [min(PIECE, resting - start) for start in range(0, resting, PIECE)]
        # Added one after the other: NumPy's sum takes another order for one world than for many.
        sums = (np.add.accumulate(errors(n))[-1] for n in pieces)
        offset = math.radians(self.bias_deg_s) - sum((total / resting for total in sums), 0.0)
        scale = 1.0 + self.scale_error
        return lambda rate: digitise(scale * rate + (errors(len(rate)) + offset), limit, step)
