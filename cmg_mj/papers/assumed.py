"""Data of the experiments on the six-body rig that the papers do not give; the scenario push_recovery has them."""

from __future__ import annotations

from collections.abc import Mapping

from cmg_mj.papers.claim import Assumption

PUSH_RECOVERY: Mapping[Assumption, str] = {"push": "1 N m for 0.1 s", "e": "0.5 deg", "noise": "400 ug/rtHz"}
"""The push, e and the noise; observer_tuning has the same."""
