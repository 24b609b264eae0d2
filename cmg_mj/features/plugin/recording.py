"""Records a rig's sensors and decisions as C functions on the numbers of a plugin's state."""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import mujoco

from cmg_mj.core.arrays import Symbolic
from cmg_mj.core.axis import AxisControl
from cmg_mj.core.errors import InputError
from cmg_mj.core.rig import Decision, Readings, RigControl, RigDeciding, ideals_of
from cmg_mj.core.sensor import Digital, Sensor, SensorState
from cmg_mj.core.tape import INPUT, Operand, Symbol, Tape
from cmg_mj.core.tree import FLOATS, form, numbers, rebuild
from cmg_mj.features.export.c_code import body
from cmg_mj.features.export.formula import Formula
from cmg_mj.plant.elements import joint_sizes
from cmg_mj.plant.plant import Plant
from cmg_mj.stages.pair import White

OF_STAGES = (Symbolic, *FLOATS)
"""Numbers of a stage's memory; its whole numbers count samples, by which it looks up noise."""
CONFIGURED = (0, White, "sigma"), (0, Digital, "resolution"), (1, Digital, "resolution")
"""Numbers of an axis that a model's <config> may change: the sensor, its stage, the stage's field."""

Row = list[tuple[str, Operand]]
"""Numbers that are written at once: name of a number in the state, or its text in C -> number."""


class Recorder:
    """Records functions in C of a state's numbers `s`, of a signal `x`, to a signal `y`.

    Attributes:
        tape: Their operations.
        functions: Name -> lines, and rows of numbers that it writes. What a name has before its first `_` it has in
            common with those of the same part.
        places: Name of a number -> its place in the state.
    """

    def __init__(self) -> None:
        self.tape = Tape()
        self.functions: dict[str, list[str | Row]] = {}
        self.places: dict[str, int] = {}

    def begin(self, name: str) -> None:
        """Begin a function."""
        self.name = name
        self.steps = self.functions[name] = []

    def inputs(self, name: str, count: int) -> list[Symbol]:
        """Append numbers that are given; `{}` in their name stands for their index."""
        return [self.tape.input(name.format(i)) for i in range(count)]

    def repeated(self, name: str, tree: Any, runs: Sequence[Callable[[Any], tuple[Any, Row]]]) -> Any:
        """Record a function with a memory several times, each time with the memory that the time before has left.

        Args:
            name: The function's name.
            tree: The memory before.
            runs: What it does at each time: (memory) -> (next memory, results).

        Returns:
            The memory behind.

        Raises:
            InputError: The times differ, or the memory's form does.
        """
        recorded = []
        for run in runs:
            self.begin(name)
            before = [self.tape.input(one) for one, _ in self.remembered(tree)]
            after, results = run(_rebuilt(tree, iter(before)))
            if form(after) != form(tree):
                raise InputError(f"{name}: its memory changes its form")
            results = [*self.remembered(after), *results]
            recorded.append((list(self.steps), [(target, self.tape.place(number)) for target, number in results]))
            self.steps.append(results)
            tree = after
        if any(one != recorded[0] for one in recorded):
            raise InputError(f"{name}: depends on the number of the sample or the step otherwise than by its noise")
        return tree

    def remembered(self, tree: Any) -> Row:
        """List the numbers of a memory of the function that is recorded, with their names."""
        return row(f"{self.name.partition('_')[0]} {{}}", _leaves(tree))

    def used(self, parts: Collection[str]) -> set[str]:
        """Find the names of the numbers that the functions of some parts take."""
        steps = [step for name in self.functions if _part(name) in parts for step in self.functions[name]]
        places = [self.tape.place(number) for step in steps if not isinstance(step, str) for _, number in step]
        operations = [self.tape.operations[place] for place in self.tape.needed(places)]
        return {operation.value for operation in operations if operation.name == INPUT}

    def locate(self, names: Sequence[str], first: int) -> int:
        """Give names the next places; the state's first one is given. Return the first of them."""
        first += len(self.places)
        self.places |= {name: first + i for i, name in enumerate(names)}
        return first

    def printed(self, parts: Collection[str]) -> str:
        """Print the functions of some parts in C."""
        text = ""
        for name, steps in self.functions.items():
            if _part(name) in parts:
                lines = [line for step in steps for line in ([step] if isinstance(step, str) else self._block(step))]
                inside = "".join(f"    {line}\n" for line in ["(void)s, (void)x, (void)y;", *lines])
                text += f"static void {name}(double *s, const double *x, double *y)\n{{\n{inside}}}\n\n"
        return text

    def _block(self, written: Row) -> list[str]:
        places = [self.tape.place(number) for _, number in written]
        operations = self.tape.operations
        given = [place for place in sorted(self.tape.needed(places)) if operations[place].name == INPUT]
        names = [self._text(operations[place].value) for place in given]
        targets = [self._text(name) for name, _ in written]
        return ["{", *body(Formula(self.tape, given, places), names, targets, "double", "double"), "}"]

    def _text(self, name: str) -> str:
        return f"s[{self.places[name]}]" if name in self.places else name


def row(name: str, values: Sequence[Operand]) -> Row:
    """Name numbers; `{}` in the name stands for their index."""
    return [(name.format(i), value) for i, value in enumerate(values)]


def generator(stream: int) -> str:
    """Name the place of a noise stream's generator in the state."""
    return f"NOISE_{stream}"


def _part(name: str) -> str:
    return name.partition("_")[0]


def _leaves(tree: Any) -> list[Any]:
    """List the numbers of a memory: of observers and laws all of them."""
    if isinstance(tree, RigDeciding):
        return [*(leaf.value for leaf in numbers(tree.axes)), *_leaves(tree.between)]
    return [leaf.value for leaf in numbers(tree) if isinstance(leaf.value, OF_STAGES)]


def _rebuilt(tree: Any, values: Iterator[Any]) -> Any:
    if isinstance(tree, RigDeciding):
        return RigDeciding(rebuild(tree.axes, values), rebuild(tree.between, values, OF_STAGES))
    return rebuild(tree, values, OF_STAGES)


class Stream:
    """A noise stream while functions are recorded: its samples come one after the other, as a generator's."""

    def __init__(self, recorder: Recorder, number: int, width: int) -> None:
        self._recorder, self._number, self._width = recorder, number, width
        self._next = 0
        self._steps: list[str | Row] = []
        self._drawn: Sequence[Symbol] = ()

    def __call__(self, sample: int) -> Sequence[Symbol]:
        """Return the normals of a sample.

        Raises:
            InputError: It is neither the next one nor the last one of the same function.
        """
        steps = self._recorder.steps
        if sample == self._next:
            drawn = f"d{len(steps)}"
            steps.append(f"double {drawn}[{self._width}];")
            steps.append(f"noise_normals(s + {generator(self._number)}, {drawn}, {self._width});")
            self._drawn = self._recorder.inputs(f"{drawn}[{{}}]", self._width)
            self._steps = steps
            self._next += 1
        elif sample != self._next - 1 or steps is not self._steps:
            raise InputError(
                f"noise stream {self._number}: sample {sample} is looked up, and {self._next} is next: a plugin draws "
                "one after the other"
            )
        return self._drawn

    def mean(
        self,
        formula: Callable[..., tuple[Sequence[Operand], Operand]],
        memory: Sequence[Operand],
        samples: int,
        piece: int,
    ) -> tuple[Sequence[Operand], Operand]:
        """Record a loop over the next samples.

        Args:
            formula: Takes a memory and the normals of a sample; returns the next memory, and a result.
            memory: The memory before the loop.
            samples: Number of the samples.
            piece: Number of those whose results are summed together.

        Returns:
            The memory behind the loop, and the mean of the results.
        """
        recorder, name, steps, count = self._recorder, self._recorder.name, self._recorder.steps, len(memory)
        number = len(steps)
        steps.append(f"double r{number}[{count}];")
        steps.append(row(f"r{number}[{{}}]", memory))
        del recorder.functions[name]  # it comes behind the one that it calls
        recorder.begin(f"{name}_{number}")
        after, result = formula(recorder.inputs("s[{}]", count), recorder.inputs("x[{}]", self._width))
        recorder.steps.append([*row("s[{}]", after), ("y[0]", result)])
        words = f"{generator(self._number)}, {self._width}, {recorder.name}, r{number}, {samples}, {piece}"
        steps.append(f"const double m{number} = noise_mean(s + {words});")
        recorder.name, recorder.steps = name, steps
        recorder.functions[name] = steps
        self._next += samples
        return recorder.inputs(f"r{number}[{{}}]", count), recorder.tape.input(f"m{number}")


class RecordedSensor(NamedTuple):
    """A sensor whose functions have been recorded: NAME_ideal, NAME_init and NAME_take."""

    name: str
    sensor: Sensor
    channels: int
    """Numbers of its signal."""
    memory: list[str]
    """Names of what it remembers."""
    delivered: list[str]
    """Names of its reading, as the decisions take it."""


class RecordedRig(NamedTuple):
    """A rig whose functions have been recorded."""

    recorder: Recorder
    sensors: list[RecordedSensor]
    """Those that the decisions depend on."""
    settings: list[list[float]]
    """The numbers of each axis that a model's <config> may change."""
    memory: list[str]
    """Names of what the decisions remember."""
    inputs: list[str]
    """Names of the numbers that MuJoCo gives: see `given_by`."""

    @property
    def parts(self) -> list[str]:
        """Names of the parts that are in use."""
        return ["rig", *(one.name for one in self.sensors)]


def record(control: RigControl, plant: Plant) -> RecordedRig:
    """Record the functions of a rig.

    Args:
        control: The control, whose observers and laws can be traced.
        plant: The plant.

    Returns:
        The functions.

    Raises:
        InputError: Plain C cannot do what one of the stages does.
    """
    for stage in control.between:
        if stage.actuators or stage.tables:
            raise InputError(f"{type(stage).__name__}: moves actuators or follows a plan: a plugin does not have it")
    parts = [*(sensor for axis in control.axes for sensor in axis.at_work), *control.between]
    if sum(len(part.draws) for part in parts) > len(control.draws):
        raise InputError("two sensors share a noise stream: a plugin draws each stream for one")
    recorder = Recorder()
    given = given_by(plant.model)
    ideal = plant.ideal_readings(*([recorder.tape.input(name) for name in names] for names in given))
    streams = {number: Stream(recorder, number, width) for number, width in control.draws.items()}
    pairs = [
        _configured(axis, recorder.inputs(f"setting {i} {{}}", len(CONFIGURED))) for i, axis in enumerate(control.axes)
    ]
    control = replace(control, axes=tuple(axis for axis, _ in pairs))
    sensors = [
        [_sensor(recorder, f"a{i}s{k}", sensor, own, streams) for k, sensor in enumerate(axis.at_work)]
        for i, (axis, own) in enumerate(zip(control.axes, ideals_of(ideal), strict=True))
    ]
    memory = _decisions(recorder, control, sensors, ideal, streams)
    taken = recorder.used(["rig"])
    needed = [one for of_axis in sensors for one in of_axis if taken.intersection(one.delivered)]
    names = recorder.used(["rig", *(one.name for one in needed)])
    inputs = [name for row in given for name in row if name in names]
    return RecordedRig(recorder, needed, [values for _, values in pairs], memory, inputs)


def given_by(model: mujoco.MjModel) -> tuple[list[str], list[str]]:
    """Name the numbers in sensordata and in qvel, each as an `input_type` in C."""
    sensors, joints = (model.sensor(i) for i in range(model.nsensor)), (model.joint(i) for i in range(model.njnt))
    return (
        [f"{{{c_text(one.name)}, 0, {one.type[0]}, {k}}}" for one in sensors for k in range(one.dim[0])],
        [
            f"{{{c_text(one.name)}, 1, {one.type[0]}, {k}}}"
            for one in joints
            for k in range(joint_sizes(one.type[0])[1])
        ],
    )


def c_text(text: str) -> str:
    """Print a text as C reads it; in octal whatever is no plain letter, and ?, which begins trigraphs."""
    letters = (chr(byte) if 32 <= byte < 127 and byte not in b'"\\?' else f"\\{byte:03o}" for byte in text.encode())
    return f'"{"".join(letters)}"'


def _configured(axis: AxisControl, symbols: Sequence[Symbol]) -> tuple[AxisControl, list[float]]:
    """Return an axis with symbols as its settings, whose observer and law may remember symbols; and the settings."""
    at_work, values = list(axis.at_work), []
    for symbol, (part, kind, name) in zip(symbols, CONFIGURED, strict=True):
        stages = list(at_work[part].stages)
        (place,) = (i for i, stage in enumerate(stages) if type(stage) is kind)
        values.append(getattr(stages[place], name))
        stages[place] = replace(stages[place], **{name: symbol})
        at_work[part] = replace(at_work[part], stages=tuple(stages))
    observers, law = copy.deepcopy((axis.observers, axis.law))
    return replace(axis, observers=observers, law=law, at_work=tuple(at_work)), values


def _sensor(recorder: Recorder, name: str, sensor: Sensor, ideal: Any, streams: Mapping[int, Stream]) -> RecordedSensor:
    """Record a sensor: its signal, its first sample, and a sample after others."""
    signal = sensor.ideal(ideal)
    recorder.begin(f"{name}_ideal")
    recorder.steps.append(row("y[{}]", signal))
    x = recorder.inputs("x[{}]", len(signal))
    recorder.begin(f"{name}_init")
    memory, reading = sensor.started(x, ideal, streams)
    remembered = recorder.remembered(memory)
    recorder.steps.append([*remembered, *row("y[{}]", reading)])

    def taken(before: Any, sample: int) -> tuple[Any, Row]:
        after, reading = sensor.passed(before, x, ideal, sample, streams)
        return after, row("y[{}]", reading)

    recorder.repeated(f"{name}_take", memory, [lambda before, n=n: taken(before, n) for n in (1, 2)])
    delivered = [f"delivered {name} {i}" for i in range(len(reading))]
    return RecordedSensor(name, sensor, len(signal), [one for one, _ in remembered], delivered)


def _decisions(
    recorder: Recorder,
    control: RigControl,
    sensors: Sequence[Sequence[RecordedSensor]],
    readings: Readings,
    streams: Mapping[int, Stream],
) -> list[str]:
    """Record the first decision, one while a memory is trimmed, and a later one; return names of what they remember."""

    def state(one: RecordedSensor) -> SensorState:
        return SensorState(1, (), ([recorder.tape.input(name) for name in one.delivered],) * one.sensor.kept)

    sampled = tuple(tuple(map(state, of_axis)) for of_axis in sensors)

    def decided(before: RigDeciding | None, tick: int) -> tuple[RigDeciding, Row]:
        step = tick * control.period
        axes, ticks = control.decide(sampled, before, step, readings)
        after, decision = control.drive(axes, before and before.between, step, ticks, readings, streams)
        return after, _shown(decision)

    recorder.begin("rig_first")
    memory, results = decided(None, 0)
    remembered = recorder.remembered(memory)
    recorder.steps.append([*remembered, *results])
    settled = max(1, math.ceil(max(axis.settled for axis in control.axes) / control.period))
    for name, ticks in (("rig_trimmed", (1, settled - 1)), ("rig_later", (settled, settled + 1))):
        if ticks[-1]:
            memory = recorder.repeated(name, memory, [lambda before, n=n: decided(before, n) for n in ticks])
    return [name for name, _ in remembered]


def _shown(decision: Decision) -> Row:
    """Name what a decision shows and commands."""
    results: Row = []
    for i, (tick, rate) in enumerate(zip(decision.ticks, decision.rates, strict=True)):
        shown = [tick.y1, tick.y2, tick.acceleration, tick.u, tick.x_e, *tick.estimates[0]]
        results += [*row(f"shown {i} {{}}", shown), (f"rate {i}", rate)]
    return results
