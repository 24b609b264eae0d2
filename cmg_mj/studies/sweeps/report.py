"""What a sweep says: tables for the terminal and `report.md`, and the files it writes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from cmg_mj.errors import InputError
from cmg_mj.results.run_folder import RunFolder, Writers, write_text
from cmg_mj.studies.sweeps import report_cells
from cmg_mj.studies.sweeps import report_sections as report_parts
from cmg_mj.studies.sweeps.cells import Trials, cells_in_blocks, cells_schema
from cmg_mj.studies.sweeps.chunk_store import GOES_ON, TRIALS, Store, merged
from cmg_mj.studies.sweeps.figures import NAMES, pictures_of
from cmg_mj.studies.sweeps.order import order_rows, order_table
from cmg_mj.studies.sweeps.report_cells import CELLS, MOST_ROWS
from cmg_mj.studies.sweeps.sobol import index_rows, index_table
from cmg_mj.studies.sweeps.study import counted
from cmg_mj.studies.sweeps.trials import write_table, write_tables
from cmg_mj.visualization.plots.figure_spec import Picture
from cmg_mj.visualization.plots.run_plot import draw

if TYPE_CHECKING:
    from pathlib import Path

ORDER, INDICES, REPORT = "order.parquet", "indices.parquet", "report.md"
FILES = (TRIALS, CELLS, ORDER, INDICES, REPORT, *NAMES)
"""Those that may be written."""


class SweepTables(NamedTuple):
    """What a finished sweep has found.

    Attributes:
        trials: Its trials.
        order: A row a point, with a named order.
        indices: A row a figure, observer and field, of a design for them.
    """

    trials: Trials
    order: list[dict[str, Any]]
    indices: list[dict[str, Any]]


def found_of(trials: Trials) -> SweepTables:
    """What the trials say."""
    study = trials.study
    return SweepTables(
        trials,
        order_rows(trials) if study.order else [],
        index_rows(trials) if study.design == "sobol" else [],
    )


def save(folder: RunFolder, store: Store, found: SweepTables) -> Path:
    """Write the tables, the pictures and the report of a finished sweep.

    Raises:
        InputError: One cannot be written.
    """
    study, trials = store.study, found.trials
    pictures = pictures_of(trials)
    files: Writers = {
        TRIALS: lambda path: merged(store, path),
        CELLS: lambda path: write_tables(path, cells_schema(study), cells_in_blocks(trials)),
        **{f"{picture.name}.png": lambda path, picture=picture: draw(path, picture) for picture in pictures},
    }
    if study.order:
        files[ORDER] = lambda path: write_table(path, order_table(study, found.order))
    if study.design == "sobol":
        files[INDICES] = lambda path: write_table(path, index_table(found.indices))
    files[REPORT] = lambda path: write_text(path, report(found, pictures))
    try:
        return folder.write(files)
    except InputError as error:
        raise InputError(f"{error}; {GOES_ON}") from None


def report(found: SweepTables, pictures: Sequence[Picture]) -> str:
    """The report as Markdown."""
    study = found.trials.study
    counts = ", ".join(
        counted(n, what)
        for n, what in ((len(study.points), "point"), (len(study.observers), "observer"), (study.worlds, "world"))
    )
    parts = [f"# {study.scenario.title or 'Sweep'}", f"{counts}: {counted(study.trials, 'trial')}."]
    parts += report_cells.varied(study)
    parts += report_parts.pictures(found.trials, pictures)
    if study.order:
        parts += report_parts.order(found.trials, found.order, MOST_ROWS)
    if study.design == "sobol":
        parts += report_parts.indices(study, found.indices)
    parts += report_cells.unfinished(found.trials)
    return "\n\n".join([*parts, *report_cells.cells(found.trials)])


def summary(found: SweepTables) -> str:
    """For the terminal: the cells, why some trials have no figures, how often the order holds, the total indices."""
    study = found.trials.study
    parts = [report_cells.in_short(found.trials)]
    parts += filter(None, [report_cells.unfinished_in_short(found.trials)])
    if study.order:
        parts.append(report_parts.order_in_short(found.trials))
    if study.design == "sobol":
        parts.append(report_parts.indices_in_short(found.indices))
    return "\n\n".join(parts)
