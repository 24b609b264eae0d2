"""A sweep's report: tables for the terminal and `report.md`, pictures, and the files of its folder."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

from cmg_mj.errors import InputError
from cmg_mj.results.files import write_parquet
from cmg_mj.results.run_folder import RunFolder, Writers, write_text
from cmg_mj.studies.sweeps import report_sections as sections
from cmg_mj.studies.sweeps.cells import Trials, cells_in_blocks, cells_schema
from cmg_mj.studies.sweeps.chunk_store import GOES_ON, TRIALS, Store, merged
from cmg_mj.studies.sweeps.order import OrderCount, order_counts, order_table
from cmg_mj.studies.sweeps.pictures import CURVES, MAPS, pictures_of
from cmg_mj.studies.sweeps.report_sections import CELLS, INDICES, ORDER
from cmg_mj.studies.sweeps.sobol import IndexRow, index_rows, index_table
from cmg_mj.studies.sweeps.study import counted
from cmg_mj.studies.sweeps.trials import write_tables
from cmg_mj.visualization.plots.figure_spec import Picture, draw

if TYPE_CHECKING:
    from pathlib import Path

REPORT = "report.md"
PICTURES = tuple(f"{name}.png" for name in (*MAPS.values(), CURVES))
FILES = (TRIALS, CELLS, ORDER, INDICES, REPORT, *PICTURES)
"""Files that may be written."""


class SweepTables(NamedTuple):
    """The results of a finished sweep.

    Attributes:
        trials: The sweep's trials.
        order: Figure -> a count for each point, of a study with a named order.
        indices: A row a figure, observer and field, of a design for Sobol indices.
    """

    trials: Trials
    order: dict[str, list[OrderCount]]
    indices: list[IndexRow]


def tables_of(trials: Trials) -> SweepTables:
    """Evaluate the trials."""
    study = trials.study
    return SweepTables(
        trials,
        order_counts(trials) if study.order else {},
        index_rows(trials) if study.design == "sobol" else [],
    )


def save(folder: RunFolder, store: Store, tables: SweepTables) -> Path:
    """Write the tables, the pictures and the report of a finished sweep.

    Raises:
        InputError: A file cannot be written.
    """
    study, trials = store.study, tables.trials
    pictures = pictures_of(trials)
    files: Writers = {
        TRIALS: lambda path: merged(store, path),
        CELLS: lambda path: write_tables(path, cells_schema(study), cells_in_blocks(trials)),
        **{f"{picture.name}.png": lambda path, picture=picture: draw(path, picture) for picture in pictures},
    }
    if study.order:
        files[ORDER] = lambda path: write_parquet(path, order_table(study, tables.order), durable=True)
    if study.design == "sobol":
        files[INDICES] = lambda path: write_parquet(path, index_table(tables.indices), durable=True)
    files[REPORT] = lambda path: write_text(path, report(tables, pictures))
    try:
        return folder.write(files)
    except InputError as error:
        raise InputError(f"{error}; {GOES_ON}") from None


def report(tables: SweepTables, pictures: Sequence[Picture]) -> str:
    """Write the report as Markdown."""
    trials, study = tables.trials, tables.trials.study
    sizes = ((len(study.points), "point"), (len(study.observers), "observer"), (study.worlds, "world"))
    counts = ", ".join(counted(n, noun) for n, noun in sizes)
    parts = [f"# {study.scenario.title or 'Sweep'}", f"{counts}: {counted(study.trials, 'trial')}."]
    parts += sections.varied(study)
    parts += sections.pictures(trials, pictures)
    parts += sections.leads(trials)
    if study.order:
        parts += sections.order(trials, tables.order)
    if study.design == "sobol":
        parts += sections.indices(study, tables.indices)
    return "\n\n".join([*parts, *sections.unfinished(trials), *sections.cells(trials)])


def summary(tables: SweepTables) -> str:
    """Write for the terminal: cells, reasons of unfinished trials, how often the order holds, total indices."""
    trials, study = tables.trials, tables.trials.study
    parts = [sections.cells_in_short(trials), *sections.unfinished_in_short(trials)]
    if study.order:
        parts.append(sections.order_in_short(trials))
    if study.design == "sobol":
        parts.append(sections.indices_in_short(tables.indices))
    return "\n\n".join(parts)
