"""Foot switches: threshold, delay, bounce."""

from __future__ import annotations

from typing import Any

import numpy as np

from cmg_mj.core.noise import Normals
from cmg_mj.features.gait import Gait
from cmg_mj.features.gait.switches import foot_switches

DT = 0.005


def said(force: np.ndarray, **settings: Any) -> np.ndarray:
    """Return what the switch of the left foot says of forces, tick by tick; the right one stands."""
    switches = foot_switches(Gait(**settings), DT)
    noise = {stream: Normals(3, 0, stream, width) for stream, width in switches.draws.items()}
    feet, shown = switches.init([force[0], 50.0]), []
    for tick, f in enumerate(force.tolist()):
        feet, (left, _) = switches.step(feet, [f, 50.0], tick, noise)
        shown.append(left)
    return np.array(shown)


LANDS = np.where(np.arange(80) < 30, 0.0, 40.0)


def test_one_without_faults_is_closed_from_a_force_on() -> None:
    force = np.array([0.0, 4.9, 5.1, 40.0, 4.9, 0.0])
    shown = said(force, switch_delay_s=0.0, switch_bounce_s=0.0)
    np.testing.assert_array_equal(shown, force > 5.0)


def test_it_is_late_by_its_delay_and_its_bounce() -> None:
    for delay, bounce in ((0.0, 0.0), (0.01, 0.0), (0.0, 0.02), (0.015, 0.03)):
        shown = said(LANDS, switch_delay_s=delay, switch_bounce_s=bounce)
        changes = np.flatnonzero(np.diff(shown.astype(int)))
        late = (changes[0] + 1 - 30) * DT
        assert len(changes) == 1  # bounces are no steps
        assert delay <= late <= delay + 2.0 * bounce + 1e-9
