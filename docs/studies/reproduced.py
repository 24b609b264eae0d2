"""Writes docs/reproduced.md, the report without its plots.

cmg-mj reproduce all && python docs/studies/reproduced.py runs/reproduce-all
"""

from __future__ import annotations

import sys
from pathlib import Path

FILE = Path(__file__).resolve().parents[1] / "reproduced.md"
SAYS = (
    "The report of `cmg-mj reproduce all`, without its plots. Microseconds and their ratios are those of one machine."
)

title, *paragraphs = (Path(sys.argv[1]) / "report.md").read_text(encoding="utf-8").split("\n\n")
kept = [title, SAYS, *(paragraph for paragraph in paragraphs if not paragraph.startswith("!["))]
FILE.write_text("\n\n".join(kept).rstrip("\n") + "\n", encoding="utf-8")
