"""Headings that contain delimiters, in a file and in `--columns`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cmg_mj.errors import InputError
from cmg_mj.replay.logs import ReadOptions, read_log
from cmg_mj.replay.logs.columns import assignments
from tests.replay.logs.motion import sine

PIPES = "Packet number,Roll | Phi | X (degrees),Pitch | Theta | Y (degrees),Gyroscope X (deg/s)"


def write(folder: Path, heading: str, delimiter: str = ",") -> Path:
    t, y, w = sine().values()
    rows = zip(range(len(t)), np.degrees(y), 0.0 * y, np.degrees(w), strict=True)
    lines = [heading, *(delimiter.join(f"{value:.9g}" for value in row) for row in rows)]
    path = folder / "log.csv"
    path.write_text("\n".join(lines) + "\n")
    return path


def test_a_heading_may_contain_more_of_another_delimiter(tmp_path: Path) -> None:
    """Three commas and six pipes; the rows below have three commas."""
    columns = assignments("tilt=Roll | Phi | X (degrees),rate=Gyroscope X (deg/s)", "--columns")
    log = read_log(write(tmp_path, PIPES), ReadOptions(columns, rate_hz=200.0))
    np.testing.assert_allclose(log["y1_rad"], sine()["tilt_rad"], atol=1e-9)
    np.testing.assert_allclose(log["reference_rad_s"], sine()["gyro_rad_s"], atol=1e-9)


def test_a_delimiter_in_quotes_divides_nothing(tmp_path: Path) -> None:
    path = write(tmp_path, 'n;"Roll, Phi, X, x=1 (deg)";"a,b,c,d";"w, 2 (deg/s)"', ";")
    columns = assignments('tilt="Roll, Phi, X, x=1 (deg)",rate=w, 2 (deg/s)', "--columns")
    log = read_log(path, ReadOptions(columns, rate_hz=200.0))
    np.testing.assert_allclose(log["y1_rad"], sine()["tilt_rad"], atol=1e-9)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("tilt=Packet number,Roll | Phi | X (degrees)", {"tilt": "Packet number,Roll | Phi | X (degrees)"}),
        ('tilt="a,rate=b (deg)",rate=c', {"tilt": "a,rate=b (deg)", "rate": "c"}),
        ('time = t , tilt = "5"" tube" ,rate=w', {"time": "t", "tilt": '5" tube', "rate": "w"}),
        ('tilt=the "raw" one,rate=w', {"tilt": 'the "raw" one', "rate": "w"}),
    ],
)
def test_quotes_as_in_a_csv(text: str, expected: dict[str, str]) -> None:
    assert assignments(text, "--columns") == expected


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('tilt="a,b', "ends with one, before a comma or at the end; a quote inside is written twice"),
        ('tilt="a" b', "what begins with a quote ends with one"),
        ('tilt=""', "write ROLE=VALUE"),
        ("tilt=Roll,x9=1 (deg)", """a heading with commas in it goes into quotes: --columns 'tilt="roll,x (deg)","""),
    ],
)
def test_messages_show_how_to_quote(text: str, message: str) -> None:
    with pytest.raises(InputError) as error:
        assignments(text, "--columns")
    assert message in str(error.value)


def test_a_column_that_is_not_there(tmp_path: Path) -> None:
    path = write(tmp_path, 'n,"Roll,x (deg)",a,w_dps')
    with pytest.raises(InputError, match=r"has no column 'Roll'.* goes into quotes"):
        read_log(path, ReadOptions({"tilt": "Roll", "rate": "w_dps"}, {"tilt": "deg"}, rate_hz=200.0))


def test_a_heading_with_a_comma_that_the_file_does_not_quote(tmp_path: Path) -> None:
    path = write(tmp_path, "n,tilt,Gyro, x (dps),w")
    with pytest.raises(InputError) as error:
        read_log(path, ReadOptions({"tilt": "tilt", "rate": "Gyro, x (dps)"}, {"tilt": "deg"}, rate_hz=200.0))
    text = str(error.value)
    assert "has no column 'Gyro, x (dps)'; did you mean 'x (dps)'? it has: 'Gyro', 'n', 'tilt', 'w', 'x (dps)'" in text
    assert text.endswith(
        "; its heading has 5 cells, and the rows below it have 4: one with ',' in it must be in quotes in the file too"
    )
