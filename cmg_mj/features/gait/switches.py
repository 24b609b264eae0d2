"""Two foot switches: a threshold, a delay, contacts that bounce, and what the controller makes of them."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

import numpy as np

from cmg_mj.core.arrays import Scalar, where
from cmg_mj.core.controller import Controller
from cmg_mj.core.noise import NoiseStream, normals
from cmg_mj.core.sensor import steps_until
from cmg_mj.features.gait import Gait


class FootSwitches:
    """Says of each foot whether it stands, once a control tick.

    A switch is closed from a force on. After a change it bounces: its reading is open or closed at random for a while.
    A foot counts as changed once its readings have agreed for longer than that.

    Args:
        gait: The switches' settings.
        first: The first axis' controller, at whose ticks they are read.
    """

    def __init__(self, gait: Gait, first: Controller) -> None:
        dt = first.law.dt
        self._threshold = gait.switch_force_n
        self._bounces = steps_until(gait.switch_bounce_s, dt)
        self._late: deque[np.ndarray] = deque(maxlen=1 + steps_until(gait.switch_delay_s, dt))
        self._agreeing: deque[np.ndarray] = deque(maxlen=1 + self._bounces)
        self._noise = normals(first.seed, first.world_ids, NoiseStream.FOOT_SWITCH, 2)
        self._last = self._stands = self._since = np.array(0)

    def __call__(self, forces: Sequence[Scalar]) -> np.ndarray:
        """Return whether each foot stands, (2,) or (2, n_worlds).

        Args:
            forces: On both feet [N].
        """
        pressed = np.array([force > self._threshold for force in forces])
        if not self._late:
            self._last = self._stands = pressed
            self._since = np.full(pressed.shape, self._bounces)
        self._since = np.where(pressed != self._last, 0, self._since + 1)
        self._last = pressed
        random = np.reshape(next(self._noise), pressed.shape) > 0.0
        self._late.append(np.where(self._since < self._bounces, random, pressed))
        self._agreeing.append(self._late[0])
        shown = np.array(self._agreeing)
        self._stands = where(shown.all(axis=0) | ~shown.any(axis=0), shown[-1], self._stands)
        return self._stands
