"""Progress of what is counted: on a terminal beside the bar, elsewhere a line a minute."""

from __future__ import annotations

import pytest

from cmg_mj.cli.progress_rate import ProgressRate
from cmg_mj.cli.terminal import progress


class Clock:
    now = 1000.0

    def __call__(self) -> float:
        return self.now


@pytest.mark.parametrize(
    ("seconds", "amount", "message"),
    [
        (0.5, 400, ""),
        (10.0, 400, ""),
        (10.0, 3400, "300 trials a second, 55 s left"),
        (100.0, 1400, "10 trials a second, 31 min left"),
        (1000.0, 401, "0.001 trials a second, 5444.2 h left"),
    ],
)
def test_the_pace_is_of_what_was_done_since(seconds: float, amount: int, message: str) -> None:
    clock = Clock()
    pace = ProgressRate("trials", 20_000, 400, clock)
    clock.now += seconds
    assert pace.text(amount) == message


def test_without_a_terminal_a_line_a_minute(capsys: pytest.CaptureFixture[str]) -> None:
    """Two hours, of which every second is told."""
    clock = Clock()
    with progress("sweep", 14_400, pace=ProgressRate("trials", 14_400, 7_200, clock)) as on_progress:
        for second in range(7_200):
            clock.now = 1000.0 + second
            on_progress(7_200 + second)
    out, err = capsys.readouterr()
    lines = err.splitlines()
    assert out == ""
    assert len(lines) == 119
    assert lines[0] == "cmg-mj: 7260 of 14400 trials, 1 trials a second, 2.0 h left"
    assert lines[-1] == "cmg-mj: 14340 of 14400 trials, 1 trials a second, 60 s left"


def test_without_a_pace_it_is_silent(capsys: pytest.CaptureFixture[str]) -> None:
    with progress("run", 1.0) as on_progress:
        on_progress(0.5)
    assert capsys.readouterr() == ("", "")
