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

from tests.acceptance.cases import GROUP, STANDING, closed_loop, closed_loop_figures, open_loop_group, open_loop_run

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
    names = sys.argv[1:] or list(STANDING)
    if unknown := set(names) - STANDING.keys():
        sys.exit(f"{', '.join(unknown)}: not in STANDING of cases.py")
    all_bounds = json.loads(FILE.read_text(encoding="utf-8"))
    firsts = range(0, GROUPS * GROUP, GROUP)
    for observer in names:
        result = closed_loop(observer, STANDING[observer], SWEEP_SEED, GROUPS * GROUP)
        all_bounds["closed_loop"][observer] = bounds([closed_loop_figures(result, first) for first in firsts])
    result = open_loop_run(SWEEP_SEED, GROUPS * GROUP)
    open_loop_bounds = bounds([open_loop_group(result, first) for first in firsts])
    all_bounds["open_loop"] |= {
        name: open_loop_bounds[name]
        for name in open_loop_bounds
        if name.partition(",")[0] in names or name not in all_bounds["open_loop"]
    }
    FILE.write_text(json.dumps(all_bounds, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
