"""Markdown: tables, and prose wrapped to the width of a page."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Sequence

WIDTH = 100
"""Columns of a wrapped line."""

_VERBATIM = ("|", "#", "![", "```", "    ")
"""Beginnings of paragraphs that keep their lines: tables, headings, pictures, code."""
_MARKUP = re.compile(r" (?=(?:[-+*]|>\S*|#+|=+|--+|\d+[.)])(?: |$))")
"""A space before a word that would be markup at the beginning of a line, such as the minus of `a - b`."""


def table(headings: Sequence[str], rows: Sequence[Sequence[str]], *, text_columns: int = 1) -> str:
    """Write a table.

    Args:
        headings: One a column.
        rows: The cells, as they are to be read.
        text_columns: So many columns from the left hold text; the rest hold numbers and are set to the right.

    Returns:
        The table, without a line break at its end.
    """
    from tabulate import tabulate

    align = ["left"] * text_columns + ["right"] * (len(headings) - text_columns)
    cells = [[cell.replace("|", "\\|") for cell in row] for row in rows]
    return tabulate(cells, headings, tablefmt="pipe", colalign=align[: len(headings)], disable_numparse=True)


def wrap(text: str, width: int = WIDTH) -> str:
    """Wrap the prose of a Markdown text. Tables, headings, pictures and code keep their lines.

    Args:
        text: Paragraphs with an empty line between them. A paragraph may be a list of `- ` items.
        width: Columns of a line. A single word may be longer.

    Returns:
        The text. A text that is wrapped already stays as it is.
    """
    return "\n\n".join(_wrap_paragraph(paragraph, width) for paragraph in text.split("\n\n"))


def _wrap_paragraph(paragraph: str, width: int) -> str:
    if paragraph.startswith(_VERBATIM):
        return paragraph
    items = re.split(r"\n(?=- )", paragraph)
    return "\n".join(_fill(item, width, "  " if item.startswith("- ") else "") for item in items)


def _fill(item: str, width: int, indent: str) -> str:
    bullet, words = ("- ", item[2:]) if indent else ("", item)
    joined = _MARKUP.sub("\0", " ".join(words.split()))
    lines = textwrap.wrap(
        joined,
        width,
        initial_indent=bullet,
        subsequent_indent=indent,
        break_long_words=False,
        break_on_hyphens=False,
    )
    return "\n".join(lines).replace("\0", " ")
