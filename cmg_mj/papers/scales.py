"""One scale for what is to be compared across pictures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from cmg_mj.papers.claim import Claim
from cmg_mj.view.plots.figure import Panel

ROOM = 0.05
"""Left above and below, as a share of the range."""


def on_common_scales(claims: Sequence[Claim]) -> list[Claim]:
    """Give all panels of one quantity, in all claims' pictures, the range that they all need."""
    panels = [panel for claim in claims for picture in claim.pictures for panel in picture.panels]
    ranges = {label: _range([panel for panel in panels if panel.y_label == label]) for label in _labels(panels)}

    def scale_claim(claim: Claim) -> Claim:
        pictures = [
            replace(picture, panels=[replace(panel, y_range=ranges[panel.y_label]) for panel in picture.panels])
            for picture in claim.pictures
        ]
        return replace(claim, pictures=pictures)

    return [scale_claim(claim) for claim in claims]


def _labels(panels: Sequence[Panel]) -> set[str]:
    return {panel.y_label for panel in panels}


def _range(panels: Sequence[Panel]) -> tuple[float, float]:
    values = np.concatenate([np.asarray(line.y) for panel in panels for line in panel.lines])
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    return low - ROOM * (high - low), high + ROOM * (high - low)
