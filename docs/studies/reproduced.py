"""Writes docs/reproduced.md, the report, and its pictures, made small, into docs/reproduced/.

cmg-mj reproduce all && python docs/studies/reproduced.py runs/reproduce-all (about three minutes on two quiet cores)
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

from PIL import Image

DOCS = Path(__file__).resolve().parents[1]
FILE, PICTURES = DOCS / "reproduced.md", DOCS / "reproduced"
SAYS = (
    "The report of `cmg-mj reproduce all`, its pictures made small. Microseconds and their ratios are those of one "
    "machine."
)
WIDTH, COLOURS = 820, 40
"""Of the small pictures: [px], and so many of a palette."""


def small(source: Path, target: Path) -> None:
    """Write a plot with fewer pixels and colours."""
    with Image.open(source) as image:
        height = round(image.height * WIDTH / image.width)
        image.convert("RGB").resize((WIDTH, height), Image.Resampling.LANCZOS).quantize(
            COLOURS, dither=Image.Dither.NONE
        ).save(target, optimize=True)


def escaped_indices(text: str) -> str:
    """Escape the bracket of `L[0][0]`, which the site takes for a link."""
    return re.sub(r"(?<=\w)\[(\d+)\]\[(\d+)\]", r"\\[\1][\2]", text)


def main(run: Path) -> None:
    """Write both."""
    title, *paragraphs = (run / "report.md").read_text(encoding="utf-8").split("\n\n")
    text = "\n\n".join([title, SAYS, *paragraphs]).rstrip("\n") + "\n"
    PICTURES.mkdir(exist_ok=True)
    for old in PICTURES.glob("*.png"):
        old.unlink()
    for name in re.findall(r"!\[[^\]]*\]\(([^)]+\.png)\)", text):
        small(run / name, PICTURES / name)
    text = re.sub(r"(!\[[^\]]*\]\()([^)]+\.png\))", r"\1reproduced/\2", text)
    FILE.write_text(escaped_indices(text), encoding="utf-8")


main(Path(sys.argv[1]))
