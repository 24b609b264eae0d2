"""The tilt of one accelerometer, and what is said of motion."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cmg_mj import InputError
from cmg_mj.replay.logs import Log, ReadOptions, read_log
from cmg_mj.replay.reference import remarks_on
from tests.replay.logs.motion import DT, OMEGA, N, rate, tilt, write_csv
from tests.replay.test_stretches import in_stretches

G = 9.80665


def read(folder: Path, radius: float, along: float = 0.0, turn: float = 1.0, gyro: bool = True, **options) -> Log:
    """Specific force at a radius of a place that accelerates horizontally, by (r alpha, -r w^2) less gravity."""
    t = np.arange(N) * DT
    y, w, alpha, push = tilt(t), rate(t), -(OMEGA**2) * tilt(t), along * np.sin(9.0 * t)
    ax = radius * alpha - G * np.sin(y) + push * np.cos(y)
    az = -radius * w**2 + G * np.cos(y) + push * np.sin(y)
    columns = {"t_s": t, "ax_g": turn * ax / G, "az": turn * az, "gyro_rad_s": w}
    roles = {"time": "t_s", "ax": "ax_g", "az": "az", **({"rate": "gyro_rad_s"} if gyro else {})}
    return read_log(write_csv(folder / "imu.csv", columns), ReadOptions(roles, **{"units": {"az": "m/s2"}, **options}))


def test_at_the_pivot_it_is_the_tilt_in_g_and_in_m_s2(tmp_path: Path) -> None:
    log = read(tmp_path, 0.0)
    np.testing.assert_allclose(log["y1_rad"], tilt(np.arange(N) * DT), atol=1e-12)
    assert log.has == {"reference"}
    assert log.tilt is None


def test_what_turning_at_a_radius_does_to_it(tmp_path: Path) -> None:
    """The hint's figure, of the gyro alone and to first order, beside the error that the tilt has."""
    log = read(tmp_path, 0.1)
    error = log["y1_rad"] - tilt(np.arange(N) * DT)
    hint = log.notes[0]
    assert "0.1 g by 5.7 deg" in hint
    assert hint.endswith(" deg RMS at 0.1 m from the pivot, and in proportion to that distance elsewhere")
    told = float(hint.split("puts it off by ")[-1].split(" deg RMS")[0])
    assert told == pytest.approx(np.degrees(np.sqrt(np.mean(error**2))), rel=0.03)
    assert told > 3.0


def test_without_a_gyro_the_size_shows_motion(tmp_path: Path) -> None:
    """Tangential acceleration changes the size of upright gravity to second order, which is said."""
    shaken, still = (read(tmp_path, 0.0, along, gyro=False).notes[0] for along in (3.0, 0.0))
    g_shaken, g_still = (float(hint.split("varies by ")[1].split(" g")[0]) for hint in (shaken, still))
    assert g_still < 1e-6
    assert g_shaken == pytest.approx((3.0 / G) ** 2 / 4.0 / np.sqrt(2.0), rel=0.1)
    assert "horizontal motion hardly shows" in shaken


def test_a_wrong_unit_and_a_wrong_direction(tmp_path: Path) -> None:
    wrong_unit = read(tmp_path, 0.0, units={"ax": "m/s2", "az": "mm/s2"}).notes[1]
    assert wrong_unit.endswith("times gravity's 9.81 m/s^2 (median): --units ax=g,az=m_s2") or "--scale" in wrong_unit
    downward = read(tmp_path, 0.0, turn=-1.0)
    gravity_itself = downward.notes
    assert any(line.startswith("The median of az is -0.9") for line in remarks_on(downward, None))
    assert "--scale ax=-1,az=-1 if the sensor shows gravity itself, --scale az=-1 if" in " ".join(gravity_itself)
    turned = read(tmp_path, 0.0, turn=-1.0, scale={"ax": -1.0, "az": -1.0})
    np.testing.assert_allclose(turned["y1_rad"], tilt(np.arange(N) * DT), atol=1e-12)
    assert len(turned.notes) == 1


def test_stretches_give_what_the_whole_gives(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = read(tmp_path, 0.1)
    in_stretches(monkeypatch, 512)
    long = read(tmp_path, 0.1)
    np.testing.assert_array_equal(long["y1_rad"], whole["y1_rad"])
    assert long.notes == whole.notes


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        ({"ax": "a_g"}, "of one accelerometer az is missing: the tilt is atan2(-ax, az)"),
        ({"tilt": "y_deg", "ax": "a_g", "az": "b_g"}, "the tilt either as tilt or from ax, az, not both"),
        ({"ax": "a_g", "az": "b_g", "inner_x": "c_g"}, "as inner_x, inner_z, outer_x, outer_z or from ax, az, not"),
        ({"rate": "w_dps"}, "there is no tilt; name one, or ax and az, or inner_x"),
    ],
)
def test_roles_that_do_not_go_together(columns: dict[str, str], message: str, tmp_path: Path) -> None:
    with pytest.raises(InputError) as error:
        read_log(tmp_path / "x.csv", ReadOptions(columns))
    assert message in str(error.value)
