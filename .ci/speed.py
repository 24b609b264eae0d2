"""Speed limits of the closed loop: `python benchmarks/loop.py --observers homogeneous --json | python .ci/speed.py`.

Beyond a limit is said; beyond it by more than what other work on a shared machine does to these ratios fails. So does
a closed loop that would be quicker than the physics in it: nothing was timed.
"""

import json
import sys

LIMITS = {200.0: (3.1, 0.7), 1000.0: (3.1, 0.7)}
"""Control rate -> at most so many times bare MuJoCo (one world), at least this share of Batch (many worlds).

A control tick has one physics step at either rate.
"""
NOISE = 1.25

figures = json.load(sys.stdin)["figures"]
failed = {row["control_rate_hz"] for row in figures} != LIMITS.keys()
if failed:
    print(f"not measured at {', '.join(f'{rate:g} Hz' for rate in LIMITS)}, but: {figures}")
for row in figures:
    most, least = LIMITS[row["control_rate_hz"]]
    over, share = row["closed_loop_over_bare"], row["closed_loop_share_of_batch"]
    beyond = max(over / most, least / share)
    is_timed = over * NOISE >= 1.0 and share <= NOISE
    failed |= beyond > NOISE or not is_timed
    word = "FAILED" if beyond > NOISE else "beyond its limit" if beyond > 1.0 else "kept"
    if not is_timed:
        word = "FAILED, quicker than its physics alone"
    print(
        f"{row['observer']} at {row['control_rate_hz']:g} Hz: {over:.2f} times bare (limit {most:g}), "
        f"{share:.2f} of Batch (limit {least:g}): {word}"
    )
sys.exit(failed)
