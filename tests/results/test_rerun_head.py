"""The line that says how to run a run again."""

from __future__ import annotations

from cmg_mj.runs.rerun_head import rerun_head


def test_the_line_that_runs_it_again_has_the_options() -> None:
    head = rerun_head("board", 3).splitlines()
    assert head[1] == "#     cmg-mj run scenario.toml --driver board --world 3"
