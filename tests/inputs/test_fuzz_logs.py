"""Hundreds of corrupt logs, the same ones every time: a table or one clear line, no traceback and no hang."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from cmg_mj.errors import InputError
from cmg_mj.replay.log_replay import replay_log
from cmg_mj.replay.logs import ReadOptions, read_log
from tests.inputs.test_fuzz import GROUP, TEXTS, corrupt, no_hang
from tests.replay.logs.motion import sine, tilt, write_csv
from tests.tiers import slow_but

LOGS = 300
CELLS = [*TEXTS, "nan", "inf", "-inf", "1e308", "-1e308", "0", "1,5", "0x10", "1_000", "１２", "2026-11-22", None, None]
ROLES = {"time": "t_s", "tilt": "tilt_rad", "rate": "gyro_rad_s", "gimbal": "g_deg", "command": "u_dps"}


def columns(rng: np.random.Generator) -> dict[str, list]:
    n = int(rng.choice([0, 1, 5, 30, 200, 200, 200]))
    t = 0.01 * np.arange(n)
    signals = {name: list(values) for name, values in sine(t).items()}
    signals |= {"g_deg": list(tilt(t)), "u_dps": list(np.cos(t))}
    for _ in range(rng.integers(0, 4)):
        name = str(rng.choice(list(signals)))
        values, kind = signals[name], rng.random()
        if kind < 0.3 and values:
            values[rng.integers(len(values))] = CELLS[rng.integers(len(CELLS))]
        elif kind < 0.4:
            signals[name] = values[::-1]
        elif kind < 0.5:
            signals[name] = [values[0]] * len(values) if values else []
        elif kind < 0.6 and len(values) > 2:
            start, end = sorted(rng.integers(0, len(values), 2))
            for column in signals.values():
                del column[start:end]
        elif kind < 0.7 and len(values) > 2:
            start = int(rng.integers(len(values)))
            signals[name] = values[:start] + [None] * (len(values) - start)
        elif kind < 0.8:
            signals[name] = [v * float(10.0 ** rng.uniform(-300, 300)) if isinstance(v, float) else v for v in values]
        elif kind < 0.9:
            signals[name] = list(rng.permutation(np.array(values, dtype=object)))
        else:
            signals.pop(name)
            if not signals:
                signals = {"t_s": list(t)}
    return signals


def write(rng: np.random.Generator) -> Path:
    signals = columns(rng)
    if rng.random() < 0.3:
        values_or_none = {n: [v if isinstance(v, float) else None for v in values] for n, values in signals.items()}
        pq.write_table(pa.table(values_or_none), "log.parquet")
        path = Path("log.parquet")
    else:
        path = write_csv("log.csv", signals, delimiter=str(rng.choice([",", ";", "\t"])))
    if rng.random() < 0.3:
        path.write_bytes(corrupt(path.read_bytes(), rng))
    return path


@pytest.mark.parametrize("first", slow_but(range(0, LOGS, GROUP), 0))
def test_logs(first: int, monkeypatch: pytest.MonkeyPatch) -> None:
    for room in ("table", "sampling"):
        monkeypatch.setattr(f"cmg_mj.replay.logs.{room}.MOST_ROWS", 20_000)
    right, complaints = 0, []
    for seed in range(first, first + GROUP):
        rng = np.random.default_rng(3000 + seed)
        path = write(rng)
        roles = {role: name for role, name in ROLES.items() if role == "tilt" or rng.random() < 0.8}
        rate = None if "time" in roles and rng.random() < 0.7 else float(rng.choice([1.0, 100.0, 1e5]))
        try:
            with no_hang():
                result = replay_log(
                    read_log(path, ReadOptions(roles, rate_hz=rate)), ["linear", "finite_difference"], settle_s=0.1
                )
            right += 1
            assert result.summaries["zero"]["noise_gain_1_s"] == 0.0
        except InputError as error:
            complaints.append(str(error))
        except BaseException as error:
            raise AssertionError(f"seed {seed}: {error!r}") from error
        finally:
            os.unlink(path)
    assert all("\n" not in complaint and len(complaint) < 700 for complaint in complaints)
    assert 0 < right < GROUP  # or the fuzz shows nothing
