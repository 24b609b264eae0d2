"""Set the acceptance bounds from a seed sweep: python -m tests.acceptance.set_bounds > tests/acceptance/bounds.json.

A figure's bounds are its mean over groups of 20 worlds, -+ four standard deviations of the groups' figures. The seed is
not the tests' one.
"""

from __future__ import annotations

import json
import statistics

from tests.acceptance.cases import GROUP, STANDING, closed_loop, closed_loop_figures, ride_along, ride_along_figures

SWEEP_SEED, GROUPS = 50_000, 12


def bounds(groups: list[dict[str, float]]) -> dict[str, list[float]]:
    """Figure -> [low, high]."""
    found = {}
    for name in groups[0]:
        values = [group[name] for group in groups]
        mean, spread = statistics.fmean(values), 4.0 * statistics.stdev(values)
        found[name] = [float(f"{max(mean - spread, 0.0):.4g}"), float(f"{mean + spread:.4g}")]
    return found


def main() -> None:
    """Print the bounds."""
    firsts = range(0, GROUPS * GROUP, GROUP)
    table = {}
    for observer, settings in STANDING.items():
        result = closed_loop(observer, settings, SWEEP_SEED, GROUPS * GROUP)
        table[observer] = bounds([closed_loop_figures(result, first) for first in firsts])
    result = ride_along(SWEEP_SEED, GROUPS * GROUP)
    print(
        json.dumps(
            {"closed_loop": table, "ride_along": bounds([ride_along_figures(result, f) for f in firsts])}, indent=1
        )
    )


if __name__ == "__main__":
    main()
