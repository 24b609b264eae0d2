"""Hundreds of broken scenarios and models, the same ones every time: no traceback, no hang, and what `check` calls
valid, `run` can start.

Everything happens in this process but a handful, which go through the real command: a traceback there is one here.
"""

from __future__ import annotations

import json
import os
import re
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli_w

from cmg_mj import load_scenario
from cmg_mj.inputs.bundled import folder
from cmg_mj.scenario.schema import Scenario
from cmg_mj.simulation.experiment import prepare
from tests.command import CommandOutcome, cmg_mj, cmg_mj_process
from tests.tiers import slow_but

SCENARIOS, MODELS, IN_PROCESSES = 400, 200, 6
GROUP = 25  # cases a test, so that the workers share them
HANG_S = 20.0
TICKS = 3
"""A run that gets so far has started."""

NUMBERS = [0, 1, -1, 2, 0.5, 1e-3, 1e-9, 1e9, 1e17, 1e30, 1e300, 1e306, 1.7e308, 5e-324, 1e-300, -1e308, 10**20, 2**127]
NUMBERS += [float("nan"), float("inf"), -float("inf"), 0.0049999, 1 / 3, 200, 1000, 0.1, 45, 90]
TEXTS = [
    "",
    "linear",
    "all",
    "homogeneous",
    "RK4",
    "truth",
    "no.such:Thing",
    "os:path",
    "\u202e",
    "a\u0000b",
    "é" * 300,
]
TEXTS += [
    "9" * 5000,
    "single_gimbal.xml",
    ".",
    "/",
    "..",
    "~",
    "/dev/zero",
    "\x1b[31m",
    "$x^{",
    "a\nb",
    "1e300",
    "'",
    '"',
]


def nested(depth: int) -> Any:
    value: Any = 1
    for _ in range(depth):
        value = [value]
    return value


@cache
def valid_scenario() -> str:
    """A scenario with every field written out, as JSON."""
    fields = Scenario().model_dump(mode="json", exclude_none=True)
    fields["plant"] |= {"timestep_s": 0.005, "gimbal_friction_n_m": 0.1, "tilt_damping_n_m_s": 0.01}
    fields["plant"] |= {"gimbal_armature_kg_m2": 1e-4, "gimbal_damping_n_m_s": 0.01, "tilt_friction_n_m": 0.01}
    fields["plant"] |= {"servo_stiffness_n_m_rad": 80.0, "servo_damping_n_m_s_rad": 0.7, "flywheel_speed_rad_s": 300.0}
    fields["plant"] |= {"accelerometer_inner_m": 0.07, "accelerometer_outer_m": 0.2, "gimbal_backlash_arcmin": 5.0}
    fields["controller"] |= {"gains": [35.0, 4.0, -1.0, 0.3]}
    fields["observer"] = {"kind": "homogeneous", "k1": 20.0, "k2": 150.0, "alpha": 0.85, "friction_n_m": 0.1}
    fields |= {"duration_s": 0.5, "push": [{"start_s": 0.1, "duration_s": 0.1, "torque_n_m": 1.0}]}
    return json.dumps(fields)


def places(value: Any, path: tuple = ()) -> Iterator[tuple]:
    """Paths of everything in a scenario."""
    entries = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for name, item in entries:
        yield (*path, name)
        yield from places(item, (*path, name))


def scenario(rng: np.random.Generator) -> bytes:
    """A scenario with something wrong, or not."""
    fields = json.loads(valid_scenario())
    kinds = ["linear", "ltv", "luenberger", "super_twisting", "high_gain", "adaptive", "homogeneous_adaptive"]
    if rng.random() < 0.3:
        fields["observer"] = {"kind": str(rng.choice(kinds))}
    if rng.random() < 0.2:
        del fields["controller"]["gains"]
        fields["controller"]["lqr"] = {"state_cost": [1.0, 1.0, 1.0, 1.0], "input_cost": 1.0}
    if rng.random() < 0.5:
        del fields["plant"]["timestep_s"]
    for _ in range(rng.integers(1, 4)):
        every = list(places(fields))
        *sections, name = every[rng.integers(len(every))]
        place = fields
        for section in sections:
            place = place[section]
        values = [*NUMBERS, *TEXTS, True, [], {}, [1], {"a": 1}, [[1, 2], [3]], nested(5), nested(200)]
        value = values[rng.integers(len(values))]
        old_value = place[name]
        if isinstance(old_value, (int, float)) and rng.random() < 0.6:  # the type is right at least
            value = NUMBERS[rng.integers(len(NUMBERS))]
        if isinstance(old_value, float) and rng.random() < 0.5:  # or even the size
            value = float(old_value * 10.0 ** rng.uniform(-4, 4))
        if isinstance(old_value, bool):
            value = not old_value
        if rng.random() < 0.1 and isinstance(place, dict):
            place[f"{name}s"] = place.pop(name)
        elif rng.random() < 0.05 and isinstance(place, dict):
            del place[name]
        else:
            place[name] = value
    text = tomli_w.dumps(fields).encode()
    if rng.random() < 0.1:
        text = corrupt(text, rng)
    return text


def corrupt(text: bytes, rng: np.random.Generator) -> bytes:
    """The text with some bytes taken out, put in, changed, or said again."""
    for _ in range(rng.integers(1, 4)):
        begin = int(rng.integers(len(text) + 1))
        end = min(len(text), begin + int(rng.integers(1, 30)))
        junk = [
            b"\0",
            b"\xff",
            b"\xef\xbb\xbf",
            b"[" * 300,
            b"a." * 150,
            b"\r\n",
            b"<",
            b'"',
            b"9" * 5000,
            b"=",
            b"&#0;",
        ]
        insertions = [
            b"",
            junk[rng.integers(len(junk))],
            text[begin:end] * 2,
            bytes(rng.integers(0, 256, 5, dtype=np.uint8)),
        ]
        text = text[:begin] + insertions[rng.integers(4)] + text[end:]
    return text


def model(rng: np.random.Generator) -> tuple[bytes, bytes]:
    """The bundled rig and its cube with something wrong, or not."""
    texts = [(folder("models") / name).read_text() for name in ("scissored_pair.xml", "cube.xml")]
    for _ in range(rng.integers(1, 4)):
        file_index = int(rng.integers(2))
        text = re.sub(r"<!--.*?-->", "", texts[file_index], flags=re.DOTALL)
        kind = rng.random()
        if kind < 0.5:  # another number
            spots = list(re.finditer(r"(?<=[\" ])-?\d+\.?\d*(?:e-?\d+)?(?=[\" ])", text))
            new = [
                "0",
                "-1",
                "nan",
                "inf",
                "1e300",
                "1e-300",
                "1e10",
                "1e17",
                "-3.14",
                "0.5",
                "",
                "x",
                "1 2",
                "1e30",
                "7",
            ]
        elif kind < 0.75:  # an element or attribute gone
            spots = list(re.finditer(r"<[a-z]\w*[^<>]*/>|\b\w+=\"[^\"]*\"", text))
            new = [""]
        elif kind < 0.9:  # another name
            spots = list(re.finditer(r"(?<=\")[a-z_]\w*(?:/\w+)?(?=\")", text))
            new = [
                "tilt",
                "fog",
                "cube1/gimbal",
                "",
                "a b",
                "cube.xml",
                "my.xml",
                "pipe",
                "slide",
                "ball",
                "&#10;",
                "é",
                "1",
            ]
        else:  # an element twice, or in between
            spots = list(re.finditer(r"<[a-z]\w*[^<>]*/>", text))
            new = [2 * spots[rng.integers(len(spots))][0], '<include file="pipe"/>', '<joint type="free"/>', "<body/>"]
        spot = spots[rng.integers(len(spots))]
        texts[file_index] = text[: spot.start()] + new[rng.integers(len(new))] + text[spot.end() :]
    rig, cube = (text.encode() for text in texts)
    if rng.random() < 0.1:
        rig = corrupt(rig, rng)
    return rig, cube


class _Hangs(BaseException):
    pass


@contextmanager
def no_hang() -> Iterator[None]:
    def ring(*_: object) -> None:
        raise _Hangs(f"more than {HANG_S:g} s")

    before = signal.signal(signal.SIGALRM, ring)
    signal.setitimer(signal.ITIMER_REAL, HANG_S)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


def start(name: str) -> None:
    """Start what `check` calls valid: run its first ticks. (What is wrong only later is a result.)"""
    experiment = prepare(load_scenario(name))
    ticks = 0

    def on_progress(time: float) -> None:
        nonlocal ticks
        ticks += 1
        if ticks >= TICKS:
            raise KeyboardInterrupt

    outcome = experiment.run(on_progress=on_progress).outcomes[0]
    assert outcome.kind != "stopped", outcome
    experiment.resolved()


def case(outcome: CommandOutcome) -> bool:
    """Judge what `check` says of a file, and start it if that is valid; whether it is."""
    if outcome.status == 0:
        start("my.toml")
        return True
    assert outcome.complaint
    return False


def count_valid(make: Callable[[np.random.Generator], Any], seeds: range, write: Callable[[Any], None]) -> int:
    """Make, check and start; how many were valid."""
    valid = 0
    for seed in seeds:
        write(make(np.random.default_rng(seed)))
        with no_hang():
            try:
                valid += case(cmg_mj("check", "my.toml"))
            except (Exception, _Hangs) as error:
                raise AssertionError(f"seed {seed}: {error!r}") from error
    return valid


def write_scenario(text: bytes) -> None:
    Path("my.toml").write_bytes(text)


def write_model(texts: tuple[bytes, bytes]) -> None:
    rig, cube = texts
    Path("my.xml").write_bytes(rig)
    Path("cube.xml").write_bytes(cube)
    Path("my.toml").write_text("duration_s = 0.5\nplant.model = 'my.xml'")


@pytest.mark.parametrize("first", slow_but(range(0, SCENARIOS, GROUP), 0))
def test_scenarios(first: int) -> None:
    valid = count_valid(scenario, range(first, first + GROUP), write_scenario)
    assert 0 < valid < GROUP  # or the fuzz shows nothing


@pytest.mark.parametrize("first", slow_but(range(0, MODELS, GROUP), 0))
def test_models(first: int) -> None:
    os.mkfifo("pipe")
    valid = count_valid(model, range(1000 + first, 1000 + first + GROUP), write_model)
    assert 0 < valid < GROUP


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(IN_PROCESSES))
def test_by_the_real_command(seed: int, tmp_path: Path) -> None:
    """`check` and then `run`, each in a process of its own."""
    rng = np.random.default_rng(2000 + seed)
    write_model(model(rng)) if seed % 2 else write_scenario(scenario(rng))
    check = cmg_mj_process("check", "my.toml", cwd=tmp_path)
    run = cmg_mj_process("run", "my.toml", "--out", "it", "--json", cwd=tmp_path)
    if check.status == 0:
        assert json.loads(run.out)
    else:
        assert check.complaint
        assert run.complaint
