"""A table of columns and rows, printed to the terminal, as Markdown or as JSON."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from cmg_mj.results import markdown
from cmg_mj.results.summary_keys import Summary, SummaryValue, finite

if TYPE_CHECKING:
    from rich.table import Table as RichTable

HEADING_WIDTH = 8
"""Characters of a heading in the terminal before it is broken."""

Row = Mapping[str, SummaryValue]


def plain(row: Row, key: str) -> str:
    """Write a value as it is; a dash where there is none."""
    value = row.get(key)
    return "-" if value is None else str(value)


@dataclass(frozen=True)
class Table:
    """Rows of values by key, and how each is read.

    Attributes:
        columns: Key -> heading, its unit in brackets at the end.
        rows: Values by key. The first column has the rows' names.
        title: Above the table in the terminal.
        entry: Formats a row's value. Lines after the first are an interval, such as "±0.01" or "0.1" and "to 0.3".
        named: Whether the names of the rows are code in Markdown.
    """

    columns: Mapping[str, str]
    rows: Sequence[Row]
    title: str = ""
    entry: Callable[[Row, str], str] = plain
    named: bool = True

    def rich(self) -> RichTable:
        """Make the table for the terminal."""
        from rich import box
        from rich.table import Table as RichTable
        from rich.text import Text

        # The title stays on one line, even if the table is not as wide.
        title = Text(self.title, style="table.title", no_wrap=True, overflow="ignore") if self.title else None
        table = RichTable(title=title, box=box.SIMPLE_HEAD, title_justify="left", padding=0)
        for i, heading in enumerate(self.columns.values()):
            label, bracket, unit = heading.partition(" [")
            lines = textwrap.wrap(label, HEADING_WIDTH, break_long_words=False) if i else [label]
            justify = "right" if i else "left"
            table.add_column(
                "\n".join([*lines, *([f"[{unit}"] if bracket else [])]), justify=justify, vertical="bottom"
            )
        table.columns[0].overflow = "fold"
        for row in self.rows:
            entries = [self.entry(row, key).split("\n") for key in self.columns]
            height = max(map(len, entries))
            table.add_row(*("\n".join([*lines, *[" "] * (height - len(lines))]) for lines in entries))
        return table

    def markdown(self) -> str:
        """Write the table as Markdown, an entry a line, without a line break at the end."""
        rows = []
        for row in self.rows:
            name, *entries = (_on_one_line(self.entry(row, key)) for key in self.columns)
            rows.append([f"`{name}`" if self.named else name, *entries])
        return markdown.table(list(self.columns.values()), rows)

    def json(self) -> list[Summary]:
        """Return the rows' values by key; None where there is none, or none that is finite."""
        return [finite({key: row.get(key) for key in self.columns}) for row in self.rows]


def _on_one_line(entry: str) -> str:
    figure, *interval = entry.split("\n")
    return f"{figure} ({' '.join(interval)})" if len(interval) > 1 else " ".join([figure, *interval])
