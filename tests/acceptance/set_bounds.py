"""Set the acceptance bounds from a seed sweep, of all observers or of some; the others' stay as they are.

    python -m tests.acceptance.set_bounds [OBSERVER ...]     # about half a minute an observer

A figure's bounds are its mean over groups of 20 worlds, -+ four standard deviations of the groups' figures. The seed is
not the tests' one.
"""

from __future__ import annotations

import json
import statistics
import sys
from pathlib import Path

from tests.acceptance.cases import GROUP, STANDING, closed_loop, closed_loop_figures, ride_along, ride_along_figures

SWEEP_SEED, GROUPS = 50_000, 12
FILE = Path(__file__).parent / "bounds.json"


def bounds(groups: list[dict[str, float]]) -> dict[str, list[float]]:
    """Figure -> [low, high]."""
    result = {}
    for name in groups[0]:
        values = [group[name] for group in groups]
        mean, spread = statistics.fmean(values), 4.0 * statistics.stdev(values)
        result[name] = [float(f"{max(mean - spread, 0.0):.4g}"), float(f"{mean + spread:.4g}")]
    return result


def main() -> None:
    """Write the bounds of those that are named, or of all."""
    wanted = sys.argv[1:] or list(STANDING)
    if unknown := set(wanted) - STANDING.keys():
        sys.exit(f"{', '.join(unknown)}: not in STANDING of cases.py")
    kept = json.loads(FILE.read_text(encoding="utf-8"))
    firsts = range(0, GROUPS * GROUP, GROUP)
    for observer in wanted:
        result = closed_loop(observer, STANDING[observer], SWEEP_SEED, GROUPS * GROUP)
        kept["closed_loop"][observer] = bounds([closed_loop_figures(result, first) for first in firsts])
    result = ride_along(SWEEP_SEED, GROUPS * GROUP)
    riding = bounds([ride_along_figures(result, first) for first in firsts])
    kept["ride_along"] |= {
        name: riding[name] for name in riding if name.partition(",")[0] in wanted or name not in kept["ride_along"]
    }
    FILE.write_text(json.dumps(kept, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
