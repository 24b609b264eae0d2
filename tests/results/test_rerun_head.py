"""The line that says how to run a run again."""

from __future__ import annotations

import shlex

import pytest

from cmg_mj.results.rerun_head import rerun_head
from cmg_mj.results.wire import WireSettings


@pytest.mark.parametrize(
    ("wire", "command"),
    [
        (WireSettings("/dev/ttyACM0"), "--driver board --port /dev/ttyACM0"),
        (
            WireSettings("tcp:a b:1", 921_600, 7.3, 5),
            "--driver board --port 'tcp:a b:1' --baud 921600 --deadline-ms 7.3 --max-lost 5",
        ),
        (WireSettings("$(x)", deadline_ms=60_000.0), "--driver board --port '$(x)' --deadline-ms 60000"),
    ],
    ids=["defaults", "all", "quotes"],
)
def test_the_line_that_runs_it_again_has_the_options(wire: WireSettings, command: str) -> None:
    head = rerun_head("board", 3, wire).splitlines()
    assert head[0].startswith(f"# Run on a board at {wire.port} (docs/board.md), where ticks may be lost. World 3:")
    assert head[1] == f"#     cmg-mj run scenario.toml {command} --world 3"
    assert shlex.split(command)[2:] == wire.options()


def test_the_line_that_runs_it_again_is_one_line() -> None:
    head = rerun_head("board", 0, WireSettings("a\nb"))
    assert all(not line or line.startswith("# ") for line in head.splitlines())
