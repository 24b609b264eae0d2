"""The options of a run on a real board."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.command import cmg_mj


@pytest.mark.usefixtures("elsewhere")
@pytest.mark.parametrize(
    ("options", "complaint"),
    [
        ("--port /dev/ttyACM0", "--port /dev/ttyACM0: goes with --driver board, not native"),
        ("--driver board --baud 115200", "--baud: goes with --port, the port of a real board"),
        ("--deadline-ms 5", "--deadline-ms: goes with --port, the port of a real board"),
        ("--max-lost 5", "--max-lost: goes with --port, the port of a real board"),
        ("--driver board --port x --baud 0", "--baud 0: must be 1 to 12000000"),
        ("--driver board --port x --baud 9999999999", "--baud 9999999999: must be 1 to 12000000"),
        ("--driver board --port x --max-lost 0", "--max-lost 0: must be 1 to 127"),
        ("--driver board --port x --max-lost 128", "--max-lost 128: must be 1 to 127"),
        ("--driver board --port x --deadline-ms nan", "--deadline-ms nan: must be above 0 and at most 60000 ms"),
    ],
)
def test_options_that_do_not_fit(options: str, complaint: str) -> None:
    assert cmg_mj(*f"run push_recovery {options}".split()).complaint == complaint
    assert not Path("runs").exists()


SLOW = "/dev/none --baud 115200"


@pytest.mark.usefixtures("elsewhere")
def test_the_command_refuses_a_slow_line_before_it_opens_it() -> None:
    complaint = cmg_mj(*f"run push_recovery --driver board --port {SLOW}".split()).complaint
    assert complaint.startswith("--baud 115200: a tick's frames do not fit: 30 + 38 bytes take 5.9 ms")
    assert not Path("runs").exists()
