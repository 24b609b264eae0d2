"""A table of columns and rows, printed to the terminal or as Markdown; and wrapped Markdown."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from cmg_mj.results.intervals import in_line

if TYPE_CHECKING:
    from rich.table import Table as RichTable

HEADING_WIDTH = 8
"""Characters of a heading in the terminal before it is broken."""

Row = Mapping[str, Any]


@dataclass(frozen=True)
class Table:
    """Rows of values by key, and how each is read.

    Attributes:
        columns: Key -> heading, its unit in brackets at the end.
        rows: Values by key. The first column has the rows' names.
        title: Above the table in the terminal.
        entry: Formats a row's value, but for its name. Lines after the first are an interval, such as "±0.01" or "0.1"
            and "to 0.3".
        named: Whether the names of the rows are code in Markdown.
    """

    columns: Mapping[str, str]
    rows: Sequence[Row]
    title: str
    entry: Callable[[Row, str], str]
    named: bool = True

    def _entries(self) -> list[list[list[str]]]:
        """Return the lines of each entry of each row."""
        name, *keys = self.columns
        return [[[str(row[name])], *(self.entry(row, key).split("\n") for key in keys)] for row in self.rows]

    def rich(self) -> RichTable:
        """Make the table for the terminal."""
        from rich import box
        from rich.table import Table as RichTable
        from rich.text import Text

        # The title stays on one line, even if the table is not as wide.
        title = Text(self.title, style="table.title", no_wrap=True, overflow="ignore") if self.title else None
        table = RichTable(title=title, box=box.SIMPLE_HEAD, title_justify="left", padding=0)
        first, *others = self.columns.values()
        table.add_column(first, vertical="bottom", overflow="fold")
        for heading in others:
            label, bracket, unit = heading.partition(" [")
            lines = textwrap.wrap(label, HEADING_WIDTH, break_long_words=False) + [f"[{unit}"] * bool(bracket)
            table.add_column("\n".join(lines), justify="right", vertical="bottom")
        for entries in self._entries():
            height = max(map(len, entries))
            table.add_row(*("\n".join([*lines, *[" "] * (height - len(lines))]) for lines in entries))
        return table

    def markdown(self) -> str:
        """Write the table as Markdown, an entry a line, without a line break at the end."""
        rows = [[in_line(lines) for lines in entries] for entries in self._entries()]
        if self.named:
            rows = [[f"`{name}`", *entries] for name, *entries in rows]
        return markdown_table(list(self.columns.values()), rows)


WIDTH = 100
"""Columns of a wrapped line."""
VERBATIM = ("|", "#")
"""Beginnings of tables and headings, which keep their lines."""


def markdown_table(headings: Sequence[str], rows: Sequence[Sequence[str]], *, text_columns: int = 1) -> str:
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


def wrap(paragraph: str) -> str:
    """Wrap a paragraph of Markdown, or each item of a `- ` list; a table or heading stays as it is."""
    if paragraph.startswith(VERBATIM):
        return paragraph
    items = re.split(r"\n(?=- )", paragraph)
    style = {"width": WIDTH, "break_long_words": False, "break_on_hyphens": False}
    return "\n".join(
        textwrap.fill(item, subsequent_indent="  " if item.startswith("- ") else "", **style) for item in items
    )
