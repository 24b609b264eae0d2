"""Markdown tables."""

from __future__ import annotations

from collections.abc import Sequence


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
