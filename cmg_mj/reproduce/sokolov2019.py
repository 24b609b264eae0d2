"""sokolov2019."""

from __future__ import annotations

from cmg_mj.reproduce.claim import Step

STEPS: list[Step] = []
