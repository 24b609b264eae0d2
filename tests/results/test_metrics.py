"""Numbers of a run from signals whose numbers are known."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

import numpy as np
import pytest

from cmg_mj.results.metrics import Metrics
from cmg_mj.scenario.schema import MetricsSettings
from cmg_mj.stages.push import Push

DT = 0.01
DEG = math.radians(1.0)
T = np.arange(2000) * DT

SIGNALS = {"x1": "rad", "x2": "rad_s", "x3": "rad", "u": "rad_s", "fog": "rad_s"}


def metrics(
    n_worlds: int = 1,
    push_end_s: float = 0.0,
    observers: tuple = ("mine",),
    pushes: tuple = (),
    references: tuple = (),
    **settings: Any,
) -> Metrics:
    pushes = pushes or ((Push(push_end_s - 0.1, 0.1),) if push_end_s else ())
    return Metrics(observers, n_worlds, DT, pushes, 4.7, MetricsSettings(**settings), [0.0] * n_worlds, references)


def rows(values: Any, n: int) -> np.ndarray:
    """(n,) or a number -> (n, 1)."""
    return np.broadcast_to(np.asarray(values, dtype=float), (n,))[:, None]


def rest_signals(n: int) -> dict[str, Any]:
    """Signals of a rig that does not move."""
    return {name: rows(0.0, n) for name in SIGNALS}


def estimates(rates: Iterable[np.ndarray]) -> list[dict[str, np.ndarray]]:
    return [{"x2_rad_s": rate} for rate in rates]


def add(run: Metrics, estimates: list[dict[str, np.ndarray]], references: Any = None, **signals: np.ndarray) -> None:
    """Add ticks of which nothing but these signals is known."""
    columns = {f"{name}_{unit}": signals[name] for name, unit in SIGNALS.items()}
    for name, estimate in zip(run.observers, estimates, strict=True):
        columns |= {f"estimate/{name}/{signal}": values for signal, values in estimate.items()}
    run.update(columns, references or {})


def summary(run: Metrics, n: int = len(T), fell: bool = False, rates: tuple = (0.0,), **signals: Any) -> dict[str, Any]:
    columns: dict[str, Any] = {name: rows(signals.get(name, 0.0), n) for name in SIGNALS}
    add(run, estimates(rows(rate, n) for rate in rates), **columns)
    return run.summary(0, stood=not fell)


def settle_time(x1: np.ndarray, push_end_s: float = 0.0, fell: bool = False, **settings: Any) -> float | None:
    return summary(metrics(push_end_s=push_end_s, **settings), len(x1), fell, x1=x1)["settle_time_s"]


# --- root mean squares -------------------------------------------------------------------------------------


def test_rms_values_of_sines() -> None:
    """A sine over whole periods has the amplitude over sqrt(2)."""
    w = 2.0 * math.pi / 2.0  # ten whole periods
    figures = summary(
        metrics(),
        x1=0.3 * DEG * np.sin(w * T),
        x2=0.5 * np.cos(w * T),
        x3=0.2 * np.sin(w * T),
        u=3.0 * np.sin(w * T),
        fog=0.5 * np.cos(w * T) + 0.03,
        rates=(0.5 * np.cos(w * T) + 0.1 * np.sin(w * T),),
    )
    assert figures["tilt_rms_deg"] == pytest.approx(0.3 / math.sqrt(2.0), rel=1e-12)
    assert figures["command_rms_rad_s"] == pytest.approx(3.0 / math.sqrt(2.0), rel=1e-12)
    assert figures["velocity_rms_error_rad_s"] == pytest.approx(0.1 / math.sqrt(2.0), rel=1e-12)
    assert figures["velocity_rms_error_fog_rad_s"] == pytest.approx(math.sqrt(0.1**2 / 2.0 + 0.03**2), rel=1e-12)
    assert figures["gimbal_peak_deg"] == pytest.approx(math.degrees(0.2), rel=1e-4)
    assert figures["command_saturated_fraction"] == 0.0


def test_saturated_is_at_the_limit_either_way() -> None:
    u = np.where(T < 2.0, 4.7, np.where(T < 5.0, -4.7, 4.69))
    assert summary(metrics(), u=u)["command_saturated_fraction"] == pytest.approx(500 / 2000)


# --- what an estimate is worth --------------------------------------------------------------------------------


def test_fit_is_one_less_error_by_motion() -> None:
    w = math.pi  # ten whole periods
    figures = summary(metrics(observers=("mine", "hers")), x2=0.5 * np.cos(w * T), rates=(0.4 * np.cos(w * T), 0.0))
    assert figures["velocity_rms_rad_s"] == pytest.approx(0.5 / math.sqrt(2.0), rel=1e-12)
    assert figures["velocity_fit"] == pytest.approx(0.8, rel=1e-12)
    assert figures["open_loop_observers"]["hers"]["velocity_fit"] == 0.0  # an estimate of zero
    assert figures["open_loop_observers"]["hers"]["velocity_rms_rad_s"] == figures["velocity_rms_rad_s"]


def push_error(pushes: tuple, error: np.ndarray, n: int = len(T)) -> float | None:
    """Error over the push windows of an estimate that is off by this, with a motion that must not matter."""
    x2 = np.sin(T)[:n]
    figures = summary(metrics(pushes=pushes, observers=("a", "b")), n, x2=x2, rates=(x2 + error[:n], x2))
    assert figures["open_loop_observers"]["b"]["velocity_rms_error_push_rad_s"] in (0.0, None)
    return figures["velocity_rms_error_push_rad_s"]


def test_the_push_window_is_from_its_start_to_a_second_after_its_end() -> None:
    """110 ticks from 2 s, included, to 3.1 s, excluded."""
    assert push_error((Push(2.0, 0.1),), np.where((T > 1.995) & (T < 3.095), 3.0, 50.0)) == pytest.approx(3.0)
    for tick in (200, 309):
        assert push_error((Push(2.0, 0.1),), np.where(np.arange(len(T)) == tick, 1.0, 0.0)) == pytest.approx(110**-0.5)
    for tick in (199, 310):
        assert push_error((Push(2.0, 0.1),), np.where(np.arange(len(T)) == tick, 1.0, 0.0)) == 0.0


def test_what_two_pushes_share_counts_once() -> None:
    """2 to 3.1 s and 2.5 to 4 s are 2 to 4 s; 6 to 7.05 s stands alone. What is between them does not count."""
    pushes = (Push(6.0, 0.05), Push(2.5, 0.5), Push(2.0, 0.1))
    window = ((T > 1.995) & (T < 3.995)) | ((T > 5.995) & (T < 7.045))
    assert push_error(pushes, np.where(window, 0.0, 9.0)) == 0.0
    assert push_error(pushes, np.where((T > 2.495) & (T < 3.095), 1.0, 0.0)) == pytest.approx(math.sqrt(60 / 305))


def test_a_run_that_ends_within_the_window_is_judged_until_there() -> None:
    error = np.where(T < 2.495, 2.0, 7.0)
    assert push_error((Push(2.0, 0.1),), error, 250) == pytest.approx(2.0)
    assert push_error((Push(2.0, 0.1),), error, 200) is None
    assert push_error((), error) is None


# --- settle time -------------------------------------------------------------------------------------------


def decay(tau: float, start: float = 10.0) -> np.ndarray:
    return start * DEG * np.exp(-T / tau)


def excursion(start: int, end: int, size: float) -> np.ndarray:
    x1 = decay(2.0)
    x1[start:end] = size * DEG
    return x1


@pytest.mark.parametrize(
    ("x1", "options", "expected"),
    [
        (decay(2.0), {}, 4.61),  # 10 deg exp(-t/2 s) is inside 1 deg from 2 ln 10 = 4.605 s on: seen at the next tick
        (-decay(2.0), {}, 4.61),
        (decay(2.0), {"settle_band_deg": 5.0}, 1.39),  # 2 ln 2 = 1.386
        (decay(2.0), {"push_end_s": 2.1}, 4.61 - 2.1),
        (excursion(1500, 1512, -1.5), {}, 15.12),
        (np.where(T < 2.0, 5.0 * DEG, 0.0), {"push_end_s": 2.1}, 0.0),
        (0.0 * T, {}, 0.0),
        (np.full(50, DEG), {}, 0.0),
        (excursion(1999, 2000, 0.999), {}, 4.61),
        (excursion(1999, 2000, 1.001), {}, None),
        (decay(2.0), {"fell": True}, None),
        (decay(0.1)[:100], {"push_end_s": 2.0}, None),
    ],
)
def test_settle_time(x1: np.ndarray, options: dict[str, Any], expected: float | None) -> None:
    assert settle_time(x1, **options) == (expected if expected is None else pytest.approx(expected))


# --- pieces, worlds and ends -------------------------------------------------------------------------------


def restless_signals(n: int, n_worlds: int) -> dict[str, Any]:
    rng = np.random.default_rng(9)
    signals: dict[str, Any] = {name: rng.normal(0.0, 1.0, (n, n_worlds)) for name in SIGNALS}
    signals["x1"] *= 3.0 * DEG * np.linspace(1.0, 0.1, n)[:, None]
    signals["u"] = np.clip(4.0 * signals["u"], -4.7, 4.7)
    return signals


def assert_same(ours: dict[str, Any], theirs: dict[str, Any]) -> None:
    """But for the order in which sums were added."""
    assert ours.keys() == theirs.keys()
    for name, value in theirs.items():
        if isinstance(value, dict):
            assert_same(ours[name], value)
        else:
            assert ours[name] == (None if value is None else pytest.approx(value, rel=1e-12))


@pytest.mark.parametrize("borders", [(256, 512), tuple(range(1, 600, 13))])
def test_pieces_add_up_to_the_whole(borders: tuple[int, ...]) -> None:
    n, n_worlds = 600, 3
    signals = restless_signals(n, n_worlds)
    signals["x1"][250:, 1] = np.nan
    rates = [0.9 * signals["x2"], 1.2 * signals["fog"]]
    run, pieces = (metrics(n_worlds, 1.0, ("mine", "hers")) for _ in range(2))
    add(run, estimates(rates), **signals)
    for part in np.split(np.arange(n), borders):
        add(pieces, estimates(rate[part] for rate in rates), **{k: v[part] for k, v in signals.items()})
    for world in range(n_worlds):
        assert_same(pieces.summary(world, False), run.summary(world, False))


def test_rows_after_a_worlds_end_do_not_count() -> None:
    """A batch in which world 1 ended after 250 ticks gives it the numbers of those 250 alone."""
    n, end = 600, 250
    signals = restless_signals(n, 2)
    rate = 0.9 * signals["x2"]
    alone = metrics()
    add(alone, estimates([rate[:end, 1:]]), **{k: v[:end, 1:] for k, v in signals.items()})
    batch = metrics(2)
    for name in SIGNALS:
        signals[name][end:, 1] = np.nan
    rate[end:, 1] = np.nan
    add(batch, estimates([rate]), **signals)
    for fell in (True, False):
        assert_same(batch.summary(1, fell), alone.summary(0, fell))


def test_a_run_without_a_tick_has_no_numbers() -> None:
    assert set(metrics().summary(0, False).values()) == {None}


def test_an_estimate_that_is_not_finite_gives_none_not_nan() -> None:
    """JSON knows no NaN. The other numbers stay."""
    figures = summary(metrics(), x1=DEG, rates=(np.where(T > 1.0, np.inf, 0.0),))
    assert figures["velocity_rms_error_rad_s"] is None
    assert figures["tilt_rms_deg"] == pytest.approx(1.0)


# --- the bias estimate ---------------------------------------------------------------------------------------


def test_bias_is_judged_from_its_time_on() -> None:
    """Far off at first, then 0.3 degrees above and below 1.1 in turn, with 1.0 to be figures: RMS of 0.4 and -0.2."""
    run = Metrics(("adaptive", "other"), 1, DT, (), 4.7, MetricsSettings(bias_from_s=5.0), [DEG])
    bias = np.where(T < 5.0 - DT / 2.0, 90.0 * DEG, (1.1 + 0.3 * (-1.0) ** np.arange(len(T))) * DEG)
    for part in np.array_split(np.arange(len(T)), 7):
        n = len(part)
        rate, figures = {"x2_rad_s": rows(0.0, n)}, {"bias_rad": rows(bias[part], n)}
        add(run, [rate | figures, rate], **rest_signals(n))
    figures: dict[str, Any] = run.summary(0, stood=True)
    assert figures["bias_deg"] == pytest.approx(1.0)
    assert figures["bias_estimate_deg"] == pytest.approx(1.1, rel=1e-12)
    assert figures["bias_rms_error_deg"] == pytest.approx(math.sqrt((0.4**2 + 0.2**2) / 2.0), rel=1e-12)
    assert "bias_deg" not in figures["open_loop_observers"]["other"]


def test_a_run_that_ends_before_has_no_bias_figures() -> None:
    run = metrics(bias_from_s=5.0)
    estimate = {"x2_rad_s": rows(0.0, 100), "bias_rad": rows(0.1, 100)}
    add(run, [estimate], **rest_signals(100))
    figures: dict[str, Any] = run.summary(0, stood=True)
    assert figures["bias_estimate_deg"] is None
    assert figures["bias_rms_error_deg"] is None
    assert figures["bias_deg"] == 0.0
