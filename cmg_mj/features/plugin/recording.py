"""Records a rig's sensors and decisions as C functions on the numbers of a plugin's state."""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import count
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

OF = "\n"
"""Between a given number's name and the function whose own it is; numbers of all functions have none."""

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
        self._owners = count()

    def begin(self, name: str) -> None:
        """Begin a function."""
        self.name = name
        self.steps = self.functions[name] = []
        self.owner = next(self._owners)

    def inputs(self, name: str, count: int) -> list[Symbol]:
        """Append numbers that the function is given; `{}` in their name stands for their index."""
        return [self.tape.input(f"{name.format(i)}{OF}{self.owner}") for i in range(count)]

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
            before = self.inputs(f"{_part(name)} {{}}", len(_leaves(tree)))
            after, results = run(_rebuilt(tree, iter(before)))
            if form(after) != form(tree):
                raise InputError(f"{name}: its memory changes its form")
            self.steps.append([*self.remembered(after), *results])
            recorded.append(self._lines(name))
            tree = after
        if any(one != recorded[0] for one in recorded):
            raise InputError(f"{name}: depends on the number of the sample or the step otherwise than by its noise")
        return tree

    def remembered(self, tree: Any) -> Row:
        """List the numbers of a memory of the function that is recorded, with their names."""
        return row(f"{_part(self.name)} {{}}", _leaves(tree))

    def used(self, parts: Collection[str]) -> set[str]:
        """Find the names of the numbers that the functions of some parts take."""
        steps = [step for name in self.functions if _part(name) in parts for step in self.functions[name]]
        places = [self.tape.place(number) for step in steps if not isinstance(step, str) for _, number in step]
        return {name for name, _ in self._given(places).values()}

    def locate(self, names: Sequence[str], first: int) -> int:
        """Give names the next places; the state's first one is given. Return the first of them."""
        first += len(self.places)
        self.places |= {name: first + i for i, name in enumerate(names)}
        return first

    def printed(self, parts: Collection[str]) -> str:
        """Print the functions of some parts in C."""
        functions = [name for name in self.functions if _part(name) in parts]
        text = f"static formula {', '.join(functions)};\n\n"
        for name in functions:
            inside = "".join(f"    {line}\n" for line in ["(void)s, (void)x, (void)y;", *self._lines(name)])
            text += f"static void {name}(double *s, const double *x, double *y)\n{{\n{inside}}}\n\n"
        return text

    def _lines(self, function: str) -> list[str]:
        """Print the body of a function."""
        lines: list[str] = []
        owners = set()
        for step in self.functions[function]:
            if isinstance(step, str):
                lines.append(step)
                continue
            places = [self.tape.place(number) for _, number in step]
            given = self._given(places)
            owners |= {owner for _, owner in given.values() if owner}
            names = [self._text(name) for name, _ in given.values()]
            targets = [self._text(name) for name, _ in step]
            lines += ["{", *body(Formula(self.tape, [*given], places), names, targets, "double", "double"), "}"]
        if len(owners) > 1:
            raise InputError(f"{function}: remembers a number elsewhere than in its memory, which C would not have")
        return lines

    def _given(self, places: Sequence[int]) -> dict[int, tuple[str, str]]:
        """Find the given numbers that others depend on: place -> name, and the function whose own it is."""
        operations = self.tape.operations
        given = [place for place in sorted(self.tape.needed(places)) if operations[place].name == INPUT]
        values = [operations[place].value.partition(OF) for place in given]
        return {place: (name, owner) for place, (name, _, owner) in zip(given, values, strict=True)}

    def _text(self, name: str) -> str:
        return f"s[{self.places[name]}]" if name in self.places else name


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
        recorder = self._recorder
        number, size = len(recorder.steps), len(memory)
        looping = f"{recorder.name}_{number}"
        words = f"{generator(self._number)}, {self._width}, {looping}, r{number}, {samples}, {piece}"
        recorder.steps.append(f"double r{number}[{size}];")
        recorder.steps.append(row(f"r{number}[{{}}]", memory))
        recorder.steps.append(f"const double m{number} = noise_mean(s + {words});")
        behind = recorder.inputs(f"r{number}[{{}}]", size)
        (mean,) = recorder.inputs(f"m{number}", 1)
        outer = recorder.name, recorder.steps, recorder.owner
        recorder.begin(looping)
        after, result = formula(recorder.inputs("s[{}]", size), recorder.inputs("x[{}]", self._width))
        recorder.steps.append([*row("s[{}]", after), ("y[0]", result)])
        recorder.name, recorder.steps, recorder.owner = outer
        self._next += samples
        return behind, mean


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
    pairs = [_configured(recorder.tape, i, axis) for i, axis in enumerate(control.axes)]
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


def _configured(tape: Tape, number: int, axis: AxisControl) -> tuple[AxisControl, list[float]]:
    """Return an axis with symbols as its settings, whose observer and law may remember symbols; and the settings."""
    at_work, values = list(axis.at_work), []
    for i, (part, kind, name) in enumerate(CONFIGURED):
        stages: list[Any] = list(at_work[part].stages)
        (place,) = (k for k, stage in enumerate(stages) if type(stage) is kind)
        values.append(getattr(stages[place], name))
        stages[place] = replace(stages[place], **{name: tape.input(f"setting {number} {i}")})
        at_work[part] = replace(at_work[part], stages=tuple(stages))
    observers, law = copy.deepcopy((axis.observers, axis.law))
    return replace(axis, observers=observers, law=law, at_work=tuple(at_work)), values


def _sensor(recorder: Recorder, name: str, sensor: Sensor, ideal: Any, streams: Mapping[int, Stream]) -> RecordedSensor:
    """Record a sensor: its signal, its first sample, and a sample after others."""
    signal = sensor.ideal(ideal)
    recorder.begin(f"{name}_ideal")
    recorder.steps.append(row("y[{}]", signal))
    recorder.begin(f"{name}_init")
    memory, reading = sensor.started(recorder.inputs("x[{}]", len(signal)), ideal, streams)
    remembered = recorder.remembered(memory)
    recorder.steps.append([*remembered, *row("y[{}]", reading)])

    def taken(before: Any, sample: int) -> tuple[Any, Row]:
        x = recorder.inputs("x[{}]", len(signal))
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
