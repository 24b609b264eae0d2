"""Writes the pages of the papers' claims from the reports of `cmg-mj reproduce`.

cmg-mj reproduce all && python docs/studies/reproduced.py runs/reproduce-all (about three minutes on two quiet cores)
cmg-mj reproduce beyond && python docs/studies/reproduced.py runs/reproduce-beyond (about four minutes)

The first writes docs/reproduced.md and, into docs/reproduced/, its pictures, made small. The second writes
docs/beyond.md, without pictures.
"""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path

from PIL import Image

from cmg_mj.results.markdown import wrap

DOCS = Path(__file__).resolve().parents[1]
PICTURES = DOCS / "reproduced"
ABOUT_ALL = (
    "This page is the report of `cmg-mj reproduce all`, with smaller pictures. Microseconds and their ratios were "
    "measured on one machine."
)
ABOUT_BEYOND = (
    "This page is the report of `cmg-mj reproduce beyond`, without its plots. Seconds and microseconds were measured "
    "on one busy machine."
)
WIDTH, COLOURS = 820, 40
"""Width [px] and number of palette colours of the small pictures."""
_PICTURE = re.compile(r"(!\[[^\]]*\]\()([^)]+\.png)\)")


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


def page_text(report: str, about: str) -> str:
    """Return a report as a page: a paragraph about the page follows its title."""
    title, *paragraphs = report.split("\n\n")
    return escaped_indices("\n\n".join([title, wrap(about), *paragraphs]).rstrip("\n") + "\n")


def without_pictures(report: str) -> str:
    """Return a report without the paragraphs that are pictures."""
    return "\n\n".join(paragraph for paragraph in report.split("\n\n") if not _PICTURE.match(paragraph))


def write_reproduced(run: Path, report: str) -> None:
    """Write docs/reproduced.md and its pictures."""
    PICTURES.mkdir(exist_ok=True)
    for old in PICTURES.glob("*.png"):
        old.unlink()
    for _, name in _PICTURE.findall(report):
        small(run / name, PICTURES / name)
    text = page_text(_PICTURE.sub(r"\1reproduced/\2)", report), ABOUT_ALL)
    (DOCS / "reproduced.md").write_text(text, encoding="utf-8")


def main(run: Path) -> None:
    """Write the page of the papers in a folder of `cmg-mj reproduce`."""
    report = (run / "report.md").read_text(encoding="utf-8")
    papers = list(json.loads((run / "figures.json").read_text(encoding="utf-8"))["papers"])
    if papers == ["beyond"]:
        text = page_text(without_pictures(report), ABOUT_BEYOND)
        (DOCS / "beyond.md").write_text(text, encoding="utf-8")
    else:
        write_reproduced(run, report)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
