"""The file of a recording, of runs or of users' logs; and its view in a notebook's cell."""

from __future__ import annotations

import contextlib
import importlib
import io
import os
import re
import shutil
import zlib
from collections.abc import Iterator, Mapping, Sequence
from concurrent import futures
from pathlib import Path
from typing import Any, NamedTuple

import rerun as rr
import rerun.blueprint as rrb

from cmg_mj.core.errors import InputError
from cmg_mj.results.folder import whole_file
from cmg_mj.scenario.resolve import versions
from cmg_mj.view.recording.layout import Plot, default_blueprint, page_tabs, pages, plot_view, rows_of, tabbed_blueprint
from cmg_mj.view.recording.run import RecordingHeader, Run, numbered_parts
from cmg_mj.view.recording.scene import log_poses, log_pushes, log_shapes
from cmg_mj.view.recording.signals import Lines, Series, log_phases, log_styles, log_values, make_branches

MAX_LIST = 120
"""Longest list of runs in an application's name [characters]."""
MAX_READ = 1 << 20
LOG_TIMELINE = "time"
"""Name of the timeline of a log, whose time is not simulated."""
MAIN = (
    Plot("Tilt [deg]", ("tilt/",), 1.7),
    Plot("Tilt rate [rad/s]", ("rate/", "rate_estimate/"), 2.8),
    Plot("Estimate less reference [rad/s]", ("rate_error/",), 2.8),
)
LOG_PLOTS = (
    *MAIN,
    Plot("Estimated equilibrium bias [deg]", ("bias/",)),
    Plot("Angular acceleration, measured [rad/s^2]", ("acceleration/",)),
    Plot("Command, gimbal rate [rad/s]", ("command/",)),
    Plot("Gimbal angle from upright [deg]", ("gimbal/",)),
)


class LogSeries(NamedTuple):
    """The recorded series of one log.

    Attributes:
        name: Name of the log, unique in a recording.
        series: The series, in the folders that `LOG_PLOTS` names: angles in degrees, rates in rad/s.
        best: Names of the observers that are switched on at first.
    """

    name: str
    series: Sequence[Series]
    best: Sequence[str]


def write_recording(path: Path, header: RecordingHeader, runs: Sequence[Run]) -> None:
    """Write one run, or several runs to compare, as a rerun recording; whole or not at all.

    Args:
        path: The file, `recording.rrd`.
        header: The experiment of all runs.
        runs: The runs; each has a branch, named after the run. No two have the same name.

    Raises:
        InputError: The environment turns rerun off.
        OSError: The file cannot be written.
    """
    branches = make_branches(header, runs)
    title = f"{header.title or 'Run'}: {', '.join(branch.label for branch in branches)}"
    names = [run.name for run in runs]
    with _written(path, title, branches, default_blueprint(branches), pages(header, branches)) as rec:
        for branch in branches:
            log_shapes(rec, branch)
            log_pushes(rec, branch)
            log_poses(rec, branch)
            log_phases(rec, header, branch, max(run.outcome.time_s for run in runs))
        # By its properties a catalogue finds a recording.
        package_versions = {name: versions()[name] for name in ("cmg_mj", "mujoco")}
        rec.send_property("experiment", rr.AnyValues(True, **package_versions, title=header.title, runs=names))
        for run in runs:
            numbers = {key: value for key, value in run.summary.items() if isinstance(value, float)}
            values = rr.AnyValues(True, **numbers, outcome=run.outcome.kind, time_s=run.outcome.time_s)
            rec.send_property(rr.escape_entity_path_part(run.name), values)


def write_logs(path: Path, title: str, logs: Sequence[LogSeries], texts: Mapping[str, str]) -> None:
    """Write logs as one recording; whole or not at all.

    Args:
        path: The file, `recording.rrd`.
        title: The recording's name.
        logs: The logs; each has a branch.
        texts: Title -> Markdown of the pages; the first page is in front.

    Raises:
        InputError: The environment turns rerun off.
        OSError: The file cannot be written.
    """
    names = [log.name for log in logs]
    branches = [
        Lines(path=f"/{part}", label=log.name, series={row.path: row for row in log.series}, timeline=LOG_TIMELINE)
        for part, log in zip(numbered_parts(names), logs, strict=True)
    ]
    boards = [_log_board(branch, log, list(texts)) for branch, log in zip(branches, logs, strict=True)]
    blueprint = tabbed_blueprint(boards, LOG_TIMELINE, "paused")
    with _written(path, title, branches, blueprint, {name.lower(): text for name, text in texts.items()}):
        pass


def _log_board(branch: Lines, log: LogSeries, titles: Sequence[str]) -> rrb.Container:
    """Lay out everything about one log."""
    plots = [plot for plot in LOG_PLOTS if rows_of(plot, branch)]
    left, right = (
        [plot_view(plot, branch, log.best) for plot in plots if (plot in MAIN) == is_left] for is_left in (True, False)
    )
    return rrb.Horizontal(
        rrb.Vertical(*left, row_shares=[plot.height for plot in MAIN if plot in plots]),
        rrb.Vertical(page_tabs(titles, titles[0]), *right, row_shares=[3.5, *[1.0] * len(right)]),
        column_shares=[11, 9],
        name=branch.label,
    )


@contextlib.contextmanager
def _written(
    path: Path,
    title: str,
    branches: Sequence[Lines],
    blueprint: rrb.Blueprint,
    texts: Mapping[str, str],
) -> Iterator[rr.RecordingStream]:
    """Open a recording, with its layout, series and pages; write its file at the end.

    Args:
        path: The file.
        title: Name of the recording.
        branches: The series of the runs or logs.
        blueprint: Layout in which the recording opens.
        texts: Path of a page -> Markdown.

    Yields:
        The recording, to log more to.

    Raises:
        InputError: The environment turns rerun off.
        OSError: The file cannot be written.
    """
    strict = rr.strict_mode()
    rr.set_strict_mode(True)  # rerun would only warn
    try:
        with rr.RecordingStream(_application_name(branches)) as rec:
            require_enabled(rec)
            with whole_file(path) as temporary, pipe_into(temporary) as pipe:
                rec.save(pipe)
                try:
                    rec.send_blueprint(blueprint, make_active=False, make_default=True)
                    set_up(rec, title)
                    for branch in branches:
                        log_styles(rec, branch)
                        log_values(rec, branch)
                    for name, text in texts.items():
                        rec.log(name, rr.TextDocument(text, media_type=rr.MediaType.MARKDOWN), static=True)
                    yield rec
                finally:
                    rec.disconnect()  # the pipe ends only then
    finally:
        rr.set_strict_mode(strict)


@contextlib.contextmanager
def pipe_into(path: Path) -> Iterator[str]:
    """Make a pipe whose bytes go into a file: by itself rerun hides a full disk, or waits for ever.

    Yields:
        The pipe's path.

    Raises:
        OSError: The file cannot be written.
    """
    source, sink = os.pipe()

    def copy() -> None:
        with open(source, "rb") as pipe:
            try:
                with path.open("wb") as file:
                    shutil.copyfileobj(pipe, file)
            finally:
                while pipe.read(MAX_READ):  # whoever writes waits until all has been taken
                    pass

    with futures.ThreadPoolExecutor(1) as pool:
        copied = pool.submit(copy)
        try:
            yield f"/dev/fd/{sink}"
        finally:
            os.close(sink)
        copied.result()


def require_enabled(rec: rr.RecordingStream) -> None:
    """Refuse to record where the environment turns rerun off.

    Raises:
        InputError: The environment variable RERUN turns rerun off.
    """
    if not rr.is_enabled(rec):
        raise InputError("RERUN: this environment variable turns recording off; unset it")


def set_up(rec: rr.RecordingStream, name: str) -> None:
    """Name a recording, and make simulated time its only timeline."""
    rec.set_log_time_enabled(False)
    rec.set_log_tick_enabled(False)
    rec.send_recording_name(name)


def _application_name(branches: Sequence[Lines]) -> str:
    """Name the application of a recording.

    The viewer remembers a layout by application: recordings with other branches or lines must not share its name.
    The name may have about 180 characters, few of them punctuation.
    """
    names = " ".join(branch.label for branch in branches)
    if len(names) > MAX_LIST:
        names = f"{len(branches)} runs"
    lines = " ".join(f"{branch.path}/{path}" for branch in branches for path in branch.series)
    return re.sub(r"[^\w -]", "-", f"cmg-mj {names} {zlib.crc32(lines.encode()):08x}", flags=re.ASCII)


def show_recording(path: Path | str, *, height: int = 600) -> Any:
    """Show a recording in the cell of a notebook: make this call the cell's last line.

    The viewer runs in the browser and holds the whole recording in memory. This process serves the viewer's code on a
    port of localhost. For a notebook on another computer set `RERUN_NOTEBOOK_ASSET=inline` before the first call: the
    code, 20 MB, is then part of the cell.

    Args:
        path: The file, `recording.rrd`, of a run or a comparison.
        height: Height of the viewer [px]. The viewer is as wide as the cell.

    Returns:
        The viewer: a Jupyter widget, `rerun_notebook.Viewer`.

    Raises:
        InputError: The file cannot be read, or rerun's notebook viewer is not installed.
    """
    try:
        recording = Path(path).read_bytes()
    except OSError as error:
        raise InputError(f"{path}: {error.strerror or error}") from error
    os.environ.setdefault("RERUN_NOTEBOOK_ASSET", "serve-local")  # by itself rerun fetches the code from its own site
    try:
        with contextlib.redirect_stdout(io.StringIO()):  # it prints the port
            viewer = importlib.import_module("rerun_notebook").Viewer(width="auto", height=height)
    except ImportError as error:
        raise InputError(
            "show_recording: rerun's notebook viewer is not installed. Install it with `python -m pip install "
            f'"cmg_mj[notebook]"`, or run `rerun {path}`'
        ) from error
    viewer.send_rrd(recording)
    return viewer
