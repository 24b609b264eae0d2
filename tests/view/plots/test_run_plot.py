"""Plots: what is on plot.png, that no line takes an axis for itself, colours."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import matplotlib.figure
import numpy as np
import pytest

from cmg_mj.observers import OBSERVERS
from cmg_mj.results.result import Outcome
from cmg_mj.results.trajectory import Trajectory
from cmg_mj.runs.experiment import prepare
from cmg_mj.scenario.loading import load_scenario
from cmg_mj.scenario.schema import MetricsSettings
from cmg_mj.stages.push import Push
from cmg_mj.stages.swing import Swing
from cmg_mj.view.plots.run_plot import plot_run
from cmg_mj.view.plots.style import colour, hexadecimal
from cmg_mj.view.recording import RecordingHeader, Run
from tests.recorded import recorded

BAND, LIMIT = 1.0, 4.7
PUSHES = [Push(0.2, 0.1)]


@pytest.fixture(scope="module")
def all_observers() -> tuple[Trajectory, dict[str, Any]]:
    """A short run with every observer."""
    short = ("duration_s=0.4", "push.0.start_s=0.2")
    result = prepare(load_scenario("observer_tuning", short)).run()
    return recorded(result), result.summaries[0]


@pytest.fixture
def figures(monkeypatch: pytest.MonkeyPatch) -> list[matplotlib.figure.Figure]:
    """The figures that are saved, as they are then."""
    saved_figures: list[matplotlib.figure.Figure] = []
    save = matplotlib.figure.Figure.savefig

    def save_and_keep(saved_figure: matplotlib.figure.Figure, *args: Any, **kwargs: Any) -> None:
        saved_figures.append(saved_figure)
        save(saved_figure, *args, **kwargs)

    monkeypatch.setattr(matplotlib.figure.Figure, "savefig", save_and_keep)
    return saved_figures


def plot(path: Path, trajectory: Trajectory, summary: dict[str, Any], figures: list[Any], **events: Any) -> Any:
    no_plant: Any = None
    header = RecordingHeader(no_plant, LIMIT, settings=MetricsSettings(BAND), **{"pushes": PUSHES, **events})
    about = {"scenario": "A title", "observer": "homogeneous", "seed": 0, "differs": {}}
    plot_run(path / "plot.png", header, Run("it", trajectory, about | summary, Outcome("done", 0.4)))
    assert (path / "plot.png").read_bytes().startswith(b"\x89PNG")
    return figures[-1]


def labels(axes: Any) -> list[str]:
    return [text.get_text() for text in axes.get_legend().get_texts()]


@pytest.mark.slow
def test_eleven_lines_on_one_page(
    all_observers: tuple[Trajectory, dict[str, Any]], tmp_path: Path, figures: list[matplotlib.figure.Figure]
) -> None:
    trajectory, summary = all_observers
    figure = plot(tmp_path, trajectory, summary, figures)
    width, height = figure.get_size_inches()
    assert width <= 9.0
    assert height <= 12.7
    tilt, rate, error, _, command, *small = figure.axes
    assert len(small) == len(OBSERVERS) - 3
    assert min(axes.get_position().height * height for axes in figure.axes) > 0.7
    assert "settle band" in labels(tilt)
    assert "push" in labels(tilt)
    assert [line.get_ydata()[0] for line in command.lines[-2:]] == [LIMIT, -LIMIT]
    assert len(error.lines) == 1 + 3
    np.testing.assert_allclose(
        error.lines[1].get_ydata(), trajectory["estimate/homogeneous/x2_rad_s"] - trajectory["x2_rad_s"]
    )
    observers = [text.split(" ")[0] for text in labels(rate)[2:]]
    panel_titles = {axes.get_title(loc="left") for axes in small}
    assert panel_titles | set(observers) == set(trajectory.observers)
    for line, name in zip(rate.lines[2:], observers, strict=True):
        assert line.get_color() == hexadecimal(colour(name))


@pytest.fixture
def few(all_observers: tuple[Trajectory, dict[str, Any]], monkeypatch: pytest.MonkeyPatch) -> Trajectory:
    """The run with its first three observers; the figures are not laid out, which takes as long as drawing."""
    trajectory, _ = all_observers
    monkeypatch.setattr(matplotlib.figure.Figure, "get_layout_engine", lambda figure: None)
    extra = trajectory.layout.extra_signals[:3]
    layout = replace(trajectory.layout, observers=trajectory.observers[:3], extra_signals=extra)
    return replace(trajectory, layout=layout)


def test_a_swing_is_not_called_a_push(few: Trajectory, tmp_path: Path, figures: list[matplotlib.figure.Figure]) -> None:
    """The column of torques has both: the whole run would be a push."""
    columns = {**few.columns, "push_n_m": np.ones(len(few))}
    swings = [Swing(1.0), Swing(2.0, start_s=0.1, duration_s=0.1)]
    tilt = plot(tmp_path, replace(few, columns=columns), {}, figures, pushes=[], swings=swings).axes[0]
    assert [text for text in labels(tilt) if text in ("push", "swing")] == ["swing"]
    corners = [patch.get_patch_transform().transform(patch.get_path().vertices) for patch in tilt.patches]
    spans = [(xy[:, 0].min(), xy[:, 0].max()) for xy in corners if np.ptp(xy[:, 1]) < 0.1]
    np.testing.assert_allclose(spans, [(0.0, few["time_s"][-1]), (0.1, 0.2)])
    assert len(tilt.patches) == 2


def test_a_diverged_estimate_is_drawn_without_a_warning(few: Trajectory, tmp_path: Path, figures: list[Any]) -> None:
    estimate = few["x2_rad_s"].copy()
    estimate[50:] = [*[1e300, -np.inf], *[np.nan] * (len(few) - 52)]
    plot(
        tmp_path, replace(few, columns={**few.columns, f"estimate/{few.observers[1]}/x2_rad_s": estimate}), {}, figures
    )
