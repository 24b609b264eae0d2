"""Parts of a sweep's report: pictures, how often an order holds, Sobol indices. Each a list of paragraphs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from cmg_mj.results import markdown
from cmg_mj.results.intervals import Interval
from cmg_mj.results.summary_keys import KEYS, heading
from cmg_mj.studies.sweeps.cells import Trials
from cmg_mj.studies.sweeps.order import JUDGED, OrderCount, by_quarters, figures_of, order_of_points, pairs_of
from cmg_mj.studies.sweeps.plot_scales import ERRORS
from cmg_mj.studies.sweeps.report_cells import said
from cmg_mj.studies.sweeps.sobol import FEWEST, LOG_RATIO, LOST
from cmg_mj.studies.sweeps.study import SweepStudy
from cmg_mj.visualization.plots.figure_spec import Picture

ABOUT_MAPS = (
    "A cell's colour is the observer of the smallest mean error among those that stood in every world, the contours "
    "are its error. A dot: another one's mean difference to it, world by world, is within its 95 % interval. A line in "
    "an observer's colour: half of its worlds fall beyond it. For falls, a dot says that Wilson's intervals overlap."
)
HEADINGS_OF_A_SHARE = ("share", "95 % interval")
ABOUT_CURVES = (
    "Bands are 95 % intervals. A cross: some worlds did not stand to the end, and the mean is that of the others, "
    "which had it easier."
)


def pictures(trials: Trials, drawn: Sequence[Picture]) -> list[str]:
    """The pictures, with how to read them."""
    if not drawn:
        return []
    is_map = any(panel.map is not None for picture in drawn for panel in picture.panels)
    falls = [] if trials.fell.any() else ["No world fell."]
    return [
        *(f"![{picture.title}]({picture.name}.png)" for picture in drawn),
        ABOUT_MAPS if is_map else ABOUT_CURVES,
        *falls,
    ]


def order(trials: Trials, rows: Sequence[dict[str, Any]], most: int) -> list[str]:
    """How often the named order holds."""
    study = trials.study
    orders = [study.order] if len(study.order) == 2 else [study.order, *pairs_of(study.order)]
    table = []
    for key in figures_of(trials):
        worlds = [row for row in rows if row["figure"] == key]
        in_worlds = f"{sum(row['held'] for row in worlds)} of {sum(row['worlds'] for row in worlds)}"
        for order in orders:
            held = order_of_points(trials, key, order)
            table.append(
                [heading(key), " < ".join(order), *_points(held, study), in_worlds if order is study.order else ""]
            )
    share = HEADINGS_OF_A_SHARE if study.design == "sample" else ()  # points of a grid are no sample of anything
    headings = ["counted by", "order", "points", *share, "worlds"]
    parts = [
        f"## The order {' < '.join(study.order)}",
        "At how many points it holds by the means over the worlds, and in how many worlds. A fall is worse than any "
        "error. Left out are points and worlds that cannot tell: a trial was refused or stopped, or two next to each "
        "other fell and the others do not break the order.",
        markdown.table(headings, table, text_columns=2),
    ]
    if study.design != "grid":
        quarters = _quarters(trials) if study.design == "sample" else []
        return [*parts, *quarters, "Every point is in order.parquet."]
    fields = [axis.field for axis in study.axes]
    rows = [row for row in rows if row["figure"] == JUDGED[0]]
    table = [
        [*(said(row[field]) for field in fields), f"{row['held']} of {row['worlds']}", *_share(row)]
        for row in rows[:most]
    ]
    parts.append(f"World by world, by the {heading(JUDGED[0])}:")
    parts.append(markdown.table([*fields, "worlds", *HEADINGS_OF_A_SHARE], table, text_columns=0))
    more = len(rows) - most
    return parts if more <= 0 else [*parts, f"{more} points more are in order.parquet."]


def _quarters(trials: Trials) -> list[str]:
    """Where in the fields' ranges the order holds."""
    key = figures_of(trials)[0]
    table = [
        [
            field,
            f"{low:.4g} to {high:.4g}" if low < high else f"{low:.4g}",
            f"{held.times} of {held.of}",
            *_interval(held.share),
        ]
        for field, low, high, held in by_quarters(trials, key)
    ]
    sentence = f"By the {heading(key)}, by each quarter of a field's range, or each value of a list:"
    return [sentence, markdown.table(["field", "values", "points", *HEADINGS_OF_A_SHARE], table, text_columns=2)]


def _points(held: OrderCount, study: SweepStudy) -> list[str]:
    """At how many points an order holds; of a sample with the share and its interval."""
    times = [f"{held.times} of {held.of}"]
    return [*times, *_interval(held.share)] if study.design == "sample" else times


def order_in_short(trials: Trials) -> str:
    """The same in a sentence, for the figure that comes first."""
    study, key = trials.study, figures_of(trials)[0]
    held = order_of_points(trials, key, study.order)
    sentence = (
        f"The order {' < '.join(study.order)}: by the {heading(key)} it holds at {held.times} of {held.of} points"
    )
    if held.share is not None and study.design == "sample":  # points of a grid are no sample of anything
        share, interval = _interval(held.share)
        sentence += f" ({share}, Wilson's 95 % interval {interval})"
    unknown = len(study.points) - held.of
    return f"{sentence}; {unknown} points cannot tell." if unknown else f"{sentence}."


def indices(study: SweepStudy, rows: Sequence[dict[str, Any]]) -> list[str]:
    """First-order and total indices of the figures that matter most."""
    about = (
        "Shares of the variance of a point's mean over its worlds: first order, what a field explains by itself; "
        "total, with all that it acts together with. In brackets bootstrap 95 % intervals. Decisive: its total index's "
        "interval is above all others'. All figures are in indices.parquet."
    )
    if study.n < FEWEST:
        about += f" Of fewer than {FEWEST} rows the intervals are too narrow, and nothing is called decisive."
    parts = ["## What the errors depend on: Sobol indices", about]
    titles = {key: heading(key) for key in ERRORS} | {LOST: "share of worlds that fell or stopped"}
    titles |= {f"{LOG_RATIO}{key}": f"logarithm of the ratio: {heading(key)}" for key in JUDGED}
    for key, title in titles.items():
        of = [row for row in rows if row["figure"] == key]
        given = [row for row in of if not row["refused"]]
        if of:
            parts.append(f"### {title[0].upper()}{title[1:]}")
        if given:
            headings = ["observer", "field", "first order", "total", "decisive"]
            parts.append(markdown.table(headings, [_index_row(row) for row in given], text_columns=2))
        refused = {row["observer"]: row["refused"] for row in of if row["refused"]}
        if refused:
            parts.append("\n".join(["Refused:", "", *(f"- {name}: {why}" for name, why in refused.items())]))
    return parts


def indices_in_short(rows: Sequence[dict[str, Any]]) -> str:
    """The total indices of those figures and of the logarithms of their ratios, and why there are none of others."""
    of: dict[tuple[str, str, str], dict[str, Any]] = {}
    refused: dict[tuple[str, str], dict[str, None]] = {}
    for row in rows:
        figure = row["figure"].removeprefix(LOG_RATIO)
        name = row["observer"] if figure == row["figure"] else f"log({row['observer']})"
        if figure in ERRORS and row["refused"]:
            refused.setdefault((name, row["refused"]), {})[KEYS[figure].label] = None
        elif figure in ERRORS:
            of[name, row["field"], figure] = row
    columns = [key for key in ERRORS if any(figure == key for _, _, figure in of)]
    table = [
        [name, field, *(_total(of.get((name, field, key))) for key in columns)]
        for name, field in dict.fromkeys((name, field) for name, field, _ in of)
    ]
    parts = []
    if table:
        headings = ["observer", "field", *(f"total index, {KEYS[key].label}" for key in columns)]
        parts.append(markdown.table(headings, table, text_columns=2))
    if any(row["decisive"] for row in of.values()):
        parts.append("*: decisive, its interval is above all others'.")
    parts += [f"No indices of {name}, {', '.join(labels)}: {why}." for (name, why), labels in refused.items()]
    return "\n\n".join(parts)


def _total(row: dict[str, Any] | None) -> str:
    if row is None:
        return "-"
    return f"{row['total']:.3f} [{row['total_low']:.3f}, {row['total_high']:.3f}]{'*' if row['decisive'] else ''}"


def _index_row(row: dict[str, Any]) -> list[str]:
    cells = [f"{row[name]:.3f} [{row[f'{name}_low']:.3f}, {row[f'{name}_high']:.3f}]" for name in ("first", "total")]
    return [row["observer"], row["field"], *cells, "yes" if row["decisive"] else ""]


def _share(row: dict[str, Any]) -> list[str]:
    return _interval(None if row["share"] is None else Interval(row["share"], row["low"], row["high"]))


def _interval(share: Interval | None) -> list[str]:
    if share is None:
        return ["-", "-"]
    return [_percent(share.mean), f"{_percent(share.low)} to {_percent(share.high)}"]


def _percent(share: float) -> str:
    return f"{100.0 * share:.1f} %"
