"""Effects that are written here, in Python alone: the plugin has them, bit for bit as the runner."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import pytest

from cmg_mj import InputError, load_scenario, prepare
from cmg_mj.core.axis import AxisControl
from cmg_mj.core.sensor import SensorStage
from cmg_mj.features.plugin.make import make_plugin
from cmg_mj.scenario.design import Design
from tests.features.plugin.made import EFFECTS, SHORT, check_against_runner, make, needs_compiler

STREAM = 15


@dataclass(frozen=True)
class Lagging(SensorStage):
    """A lag of first order behind noise of its own."""

    @property
    def draws(self) -> dict[int, int]:
        return {STREAM: 4}

    def init(self, signal: Any, ideal: Any, tables: Any) -> Any:
        return list(signal)

    def step(self, memory: Any, signal: Any, ideal: Any, sample: int, tables: Any) -> Any:
        noisy = [x + 0.01 * normal for x, normal in zip(signal, tables[STREAM](sample), strict=True)]
        after = [before + 0.8 * (x - before) for before, x in zip(memory, noisy, strict=True)]
        return after, after


@dataclass(frozen=True)
class Counting(SensorStage):
    """An effect that hangs on the sample's number."""

    def step(self, memory: Any, signal: Any, ideal: Any, sample: int, tables: Any) -> Any:
        return memory, [x + 0.001 * sample for x in signal]


class Hoarding(SensorStage):
    """An effect whose memory is elsewhere."""

    before: Any = None

    def step(self, memory: Any, signal: Any, ideal: Any, sample: int, tables: Any) -> Any:
        before, self.before = self.before or signal, signal
        return memory, [0.5 * (x + last) for x, last in zip(signal, before, strict=True)]


@dataclass(frozen=True)
class Smoothing:
    """A mean of two commands."""

    def init(self, u: Any) -> Any:
        return (u,)

    def step(self, memory: Any, u: Any) -> Any:
        return (u,), 0.5 * (memory[0] + u)


def with_stages(patch: pytest.MonkeyPatch, effect: SensorStage, *commands: Any) -> None:
    """Put an effect into the accelerometers of every controller that is made, and stages on its command."""
    make_axis = Design.axis_control

    def axis_control(self: Design, *arguments: Any, **options: Any) -> AxisControl:
        made = make_axis(self, *arguments, **options)
        accelerometer, *others = made.at_work
        stages = (*accelerometer.stages[:-1], effect, accelerometer.stages[-1])
        return replace(
            made, at_work=(replace(accelerometer, stages=stages), *others), commands=(*made.commands, *commands)
        )

    patch.setattr(Design, "axis_control", axis_control)


@needs_compiler
def test_stages_of_ones_own_without_a_line_of_c(monkeypatch: pytest.MonkeyPatch) -> None:
    with_stages(monkeypatch, Lagging(), Smoothing())
    check_against_runner(make("linear", *SHORT, *EFFECTS, "sensors.accelerometer.counts_per_g=0"))


@pytest.mark.parametrize(
    ("effect", "words"),
    [
        (Counting(), "depends on the number of the sample"),
        (Hoarding(), r"remembered from an earlier recording \(.*test_own_stages"),
    ],
)
def test_a_stage_that_is_no_formula_is_refused(
    effect: SensorStage, words: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    with_stages(monkeypatch, effect)
    with pytest.raises(InputError, match=words):
        make_plugin(prepare(load_scenario("push_recovery", SHORT, "linear")))
