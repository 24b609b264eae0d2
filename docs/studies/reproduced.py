"""Writes the page of the papers' claims from the report of `cmg-mj reproduce`.

cmg-mj reproduce all && python docs/studies/reproduced.py runs/reproduce-all (about three minutes on two quiet cores)

Writes docs/reproduced.md and, into docs/reproduced/, its pictures, made small.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

from PIL import Image

DOCS = Path(__file__).resolve().parents[1]
PICTURES = DOCS / "reproduced"
WIDTH, COLOURS = 820, 40
"""Width [px] and number of palette colours of the small pictures."""
READINGS = """
`python docs/studies/claims_not_reproduced.py [--claim ID]` prints each of the claims that are not
reproduced in all readings that its row names, with the figures that it compares (six minutes).
"""
"""Paragraph that the page has before the first paper."""
_PICTURE = re.compile(r"(\[picture\]\()([^)]+\.png)\)")


def small(source: Path, target: Path) -> None:
    """Write a plot with fewer pixels and colours."""
    with Image.open(source) as image:
        height = round(image.height * WIDTH / image.width)
        image.convert("RGB").resize((WIDTH, height), Image.Resampling.LANCZOS).quantize(
            COLOURS, dither=Image.Dither.NONE
        ).save(target, optimize=True)


def main(run: Path) -> None:
    """Write the page of the papers in a folder of `cmg-mj reproduce`, and its pictures."""
    report = (run / "report.md").read_text(encoding="utf-8")
    PICTURES.mkdir(exist_ok=True)
    for old in PICTURES.glob("*.png"):
        old.unlink()
    for _, name in _PICTURE.findall(report):
        small(run / name, PICTURES / name)
    page = _PICTURE.sub(r"\1reproduced/\2)", report).replace("\n## ", f"{READINGS}\n## ", 1)
    (DOCS / "reproduced.md").write_text(re.sub(r"(?<=\w)\[(\d+)\]\[(\d+)\]", r"\\[\1][\2]", page), encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
