"""Records a rig's sensors and decisions as C functions on the numbers of a plugin's state."""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import mujoco

from cmg_mj.core.arrays import Symbolic
from cmg_mj.core.axis import AxisControl
from cmg_mj.core.errors import InputError
from cmg_mj.core.rig import Decision, Readings, RigControl, RigDeciding, ideals_of
from cmg_mj.core.sensor import Digital, Sensor, SensorState
from cmg_mj.core.straight_line import Count, Phase
from cmg_mj.core.tape import INPUT, Operand, Symbol, Tape
from cmg_mj.core.tree import FLOATS, form, numbers, rebuild
from cmg_mj.core.types import IdealReading
from cmg_mj.features.export.c_code import body
from cmg_mj.features.export.formula import Formula
from cmg_mj.plant.elements import joint_sizes
from cmg_mj.plant.plant import Plant
from cmg_mj.stages.pair import White

OF_STAGES = (Symbolic, *FLOATS)
"""Numbers of a stage's memory; its whole numbers count samples, by which it looks up noise."""
HEAD = 10
"""Numbers at the state's beginning, which rig.h names."""
CONFIGURED = (0, White, "sigma"), (0, Digital, "resolution"), (1, Digital, "resolution")
"""Numbers of an axis that a model's <config> may change: the sensor, its stage, the stage's field."""

Row = list[tuple[str, Operand]]
"""Numbers that are written at once: name of a number in the state, or its text in C -> number."""


class Function(NamedTuple):
    """A function in C of the state's numbers `s`, of a signal `x`, to a signal `y`."""

    name: str
    """The name; before its first `_` it is the same for all functions of a part."""
    tape: Tape
    """Its operations."""
    steps: list[str | tuple[list[str], list[int]]]
    """Lines; and names of numbers that it writes, with their places on the tape."""

    def write(self, numbers: Row) -> None:
        """Append numbers that are written at once."""
        self.steps.append(([name for name, _ in numbers], [self.tape.place(number) for _, number in numbers]))

    def given(self, places: Sequence[int]) -> dict[int, str]:
        """Find the given numbers that others depend on: place -> name."""
        operations = self.tape.operations
        needed = sorted(self.tape.needed(places))
        return {place: operations[place].value for place in needed if operations[place].name == INPUT}


class Recorder:
    """Records functions.

    Args:
        control: The control of the rig.
        plant: The plant.

    Attributes:
        control: The control.
        function: The function that is recorded.
        functions: The recorded functions, by name.
        given: Names of the numbers in sensordata and in qvel.
        places: Name of a number -> its place in the state.
    """

    def __init__(self, control: RigControl, plant: Plant) -> None:
        self.control, self._plant = control, plant
        self.given = given_by(plant.model)
        self.functions: dict[str, Function] = {}
        self.places: dict[str, int] = {}

    def begin(self, name: str) -> None:
        """Begin a function."""
        self.function = self.functions[name] = Function(name, Tape(), [])

    def inputs(self, name: str, count: int) -> list[Symbol]:
        """Append numbers that the function is given; `{}` in their name stands for their index."""
        return self.named([name.format(i) for i in range(count)])

    def named(self, names: Sequence[str]) -> list[Symbol]:
        """Append numbers of these names that the function is given."""
        return list(map(self.function.tape.input, names))

    def rig(self) -> tuple[RigControl, Readings]:
        """Return the control and the readings of perfect sensors, of symbols of the function."""
        axes = [
            _configured(axis, self.inputs(f"setting {i} {{}}", len(CONFIGURED)))
            for i, axis in enumerate(self.control.axes)
        ]
        return replace(self.control, axes=tuple(axes)), self._plant.ideal_readings(*map(self.named, self.given))

    def repeated(self, name: str, tree: Any, runs: Sequence[Callable[[Any], tuple[Any, Row]]]) -> Any:
        """Record a function with a memory several times, each time with the memory that the time before has left.

        Args:
            name: The function's name.
            tree: The memory before.
            runs: The function of each time: (memory) -> (next memory, results).

        Returns:
            The memory behind.

        Raises:
            InputError: The times differ, or the memory's form does.
        """
        recorded = []
        for run in runs:
            self.begin(name)
            before = self.inputs(f"{_part(name)} {{}}", len(_leaves(tree)))
            after, results = run(_rebuilt(tree, iter(before)))
            if form(after) != form(tree):
                raise InputError(f"{name}: its memory changes its form")
            self.function.write([*self.remembered(after), *results])
            recorded.append((self.function.steps, self.function.tape.operations))
            tree = after
        if any(one != recorded[0] for one in recorded):
            raise InputError(f"{name}: depends on the number of the sample or the step otherwise than by its noise")
        return tree

    def remembered(self, tree: Any) -> Row:
        """List the numbers of a memory of the function that is recorded, with their names."""
        return row(f"{_part(self.function.name)} {{}}", _leaves(tree))

    def of(self, parts: Collection[str]) -> list[Function]:
        """List the functions of some parts."""
        return [function for name, function in self.functions.items() if _part(name) in parts]

    def used(self, parts: Collection[str]) -> set[str]:
        """Find the names of the numbers that the functions of some parts take."""
        written = [(one, step[1]) for one in self.of(parts) for step in one.steps if not isinstance(step, str)]
        return {name for function, places in written for name in function.given(places).values()}

    def locate(self, names: Sequence[str]) -> int:
        """Give names the next places in the state; return the first of them."""
        first = HEAD + len(self.places)
        self.places |= {name: first + i for i, name in enumerate(names)}
        return first

    def printed(self, parts: Collection[str]) -> str:
        """Print the functions of some parts in C."""
        text = f"static formula {', '.join(function.name for function in self.of(parts))};\n\n"
        for function in self.of(parts):
            lines = ["(void)s, (void)x, (void)y;"]
            for step in function.steps:
                if isinstance(step, str):
                    lines.append(step)
                    continue
                names, places = step
                given = function.given(places)
                formula = Formula(function.tape, list(given), places)
                inputs, outputs = self._texts(given.values()), self._texts(names)
                lines += ["{", *body(formula, inputs, outputs, "double", "double"), "}"]
            inside = "".join(f"    {line}\n" for line in lines)
            text += f"static void {function.name}(double *s, const double *x, double *y)\n{{\n{inside}}}\n\n"
        return text

    def _texts(self, names: Iterable[str]) -> list[str]:
        return [f"s[{self.places[name]}]" if name in self.places else name for name in names]


def row(name: str, values: Iterable[Operand]) -> Row:
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
        self._function: Function | None = None
        self._drawn: Sequence[Symbol] = ()

    def __call__(self, sample: int) -> Sequence[Symbol]:
        """Return the normals of a sample.

        Raises:
            InputError: It is neither the next one nor the last one of the same function.
        """
        function, sample = self._recorder.function, int(sample)
        if sample == self._next:
            drawn = f"d{len(function.steps)}"
            words = f"s + {generator(self._number)}, {drawn}, {self._width}"
            function.steps.append(f"double {drawn}[{self._width}]; noise_normals({words});")
            self._drawn = self._recorder.inputs(f"{drawn}[{{}}]", self._width)
            self._function = function
            self._next += 1
        elif sample != self._next - 1 or function is not self._function:
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
        recorder, outer = self._recorder, self._recorder.function
        number, size = len(outer.steps), len(memory)
        looping = f"{outer.name}_{number}"
        words = f"{generator(self._number)}, {self._width}, {looping}, r{number}, {samples}, {piece}"
        outer.steps.append(f"double r{number}[{size}];")
        outer.write(row(f"r{number}[{{}}]", memory))
        outer.steps.append(f"const double m{number} = noise_mean(s + {words}); (void)m{number};")
        recorder.begin(looping)
        after, result = formula(recorder.inputs("s[{}]", size), recorder.inputs("x[{}]", self._width))
        recorder.function.write([*row("s[{}]", after), ("y[0]", result)])
        recorder.function = outer
        self._next += samples
        return recorder.inputs(f"r{number}[{{}}]", size), recorder.named([f"m{number}"])[0]


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
    """The sensors on which the decisions depend."""
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
    recorder = Recorder(control, plant)
    streams = {number: Stream(recorder, number, width) for number, width in control.draws.items()}
    sensors = [
        [_sensor(recorder, i, k, streams) for k in range(len(axis.at_work))] for i, axis in enumerate(control.axes)
    ]
    memory = _decisions(recorder, sensors, streams)
    taken = recorder.used(["rig"])
    needed = [one for of_axis in sensors for one in of_axis if taken.intersection(one.delivered)]
    names = recorder.used(["rig", *(one.name for one in needed)])
    inputs = [name for row in recorder.given for name in row if name in names]
    return RecordedRig(recorder, needed, memory, inputs)


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


def settings_of(axis: AxisControl) -> list[float]:
    """List the numbers of an axis that a model's <config> may change."""
    stages = [(next(one for one in axis.at_work[k].stages if type(one) is kind), name) for k, kind, name in CONFIGURED]
    return [getattr(stage, name) for stage, name in stages]


def _configured(axis: AxisControl, symbols: Sequence[Symbol]) -> AxisControl:
    """Return an axis with symbols as its settings, whose observer and law may remember symbols."""
    at_work = list(axis.at_work)
    for symbol, (k, kind, name) in zip(symbols, CONFIGURED, strict=True):
        stages: list[Any] = [replace(one, **{name: symbol}) if type(one) is kind else one for one in at_work[k].stages]
        at_work[k] = replace(at_work[k], stages=tuple(stages))
    observers, law = copy.deepcopy((axis.observers, axis.law))
    return replace(axis, observers=observers, law=law, at_work=tuple(at_work))


def _sensor(recorder: Recorder, axis: int, number: int, streams: Mapping[int, Stream]) -> RecordedSensor:
    """Record a sensor: its signal, its first sample, and a sample after others."""
    name = f"a{axis}s{number}"

    def begun() -> tuple[Sensor, IdealReading, list[Symbol]]:
        control, readings = recorder.rig()
        sensor, ideal = control.axes[axis].at_work[number], ideals_of(readings)[axis]
        return sensor, ideal, recorder.inputs("x[{}]", len(sensor.ideal(ideal)))

    recorder.begin(f"{name}_ideal")
    sensor, ideal, x = begun()
    recorder.function.write(row("y[{}]", sensor.ideal(ideal)))
    channels = len(x)
    recorder.begin(f"{name}_init")
    sensor, ideal, x = begun()
    memory, reading = sensor.started(x, ideal, streams)
    remembered = recorder.remembered(memory)
    recorder.function.write([*remembered, *row("y[{}]", reading)])

    def taken(before: Any, sample: int) -> tuple[Any, Row]:
        sensor, ideal, x = begun()
        after, reading = sensor.passed(before, x, ideal, sample, streams)
        return after, row("y[{}]", reading)

    recorder.repeated(f"{name}_take", memory, [lambda before, n=n: taken(before, Count(n, "sample")) for n in (1, 2)])
    delivered = [f"delivered {name} {i}" for i in range(len(reading))]
    return RecordedSensor(name, sensor, channels, [one for one, _ in remembered], delivered)


def _decisions(
    recorder: Recorder, sensors: Sequence[Sequence[RecordedSensor]], streams: Mapping[int, Stream]
) -> list[str]:
    """Record the first decision, one while a memory is trimmed, and a later one; return names of what they remember."""

    def decided(before: RigDeciding | None, tick: int) -> tuple[RigDeciding, Row]:
        control, readings = recorder.rig()
        rows = [[(one, recorder.named(one.delivered)) for one in of_axis] for of_axis in sensors]
        sampled = [tuple(SensorState(1, (), (x,) * one.sensor.kept) for one, x in of_axis) for of_axis in rows]
        step = Phase(tick * control.period, "step")
        axes, ticks = control.decide(tuple(sampled), before, step, readings)
        after, decision = control.drive(axes, before and before.between, step, ticks, readings, streams)
        return after, _shown(decision)

    recorder.begin("rig_first")
    memory, results = decided(None, 0)
    remembered = recorder.remembered(memory)
    recorder.function.write([*remembered, *results])
    axes = recorder.control.axes
    settled = max(1, math.ceil(max(axis.settled for axis in axes) / axes[0].period))
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
