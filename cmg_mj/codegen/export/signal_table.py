"""What `cmg-mj export` prints."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


def export_table(figures: Mapping[str, Any]) -> str:
    """An export's figures as text."""
    operations = figures["operations"]
    lines = [
        f"{figures['observer']}, {figures['precision']} precision",
        f"  numbers in the observer's state   {figures['numbers_in_state']}",
        f"  operations an update              {sum(operations.values())}, of them the observer {operations['step']}",
        f"  formulas, off from Python by      {_off(figures['trace_off_by'])}",
    ]
    if figures["c_off_by"] is not None:
        lines.append(f"  C, off from Python, by {figures['compiler']}:")
        width = max(map(len, figures["c_off_by"]))
        lines += [f"    {name:<{width}}  {_off(off)}" for name, off in figures["c_off_by"].items()]
    return "\n".join(lines)


def _off(size: float) -> str:
    return f"{size:.2g}" if size else "0 (bit for bit)"
