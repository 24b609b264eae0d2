"""Records a rig's sensors and decisions as C functions on the numbers of a plugin's state."""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

from cmg_mj.core.arrays import Symbolic
from cmg_mj.core.axis import AxisControl
from cmg_mj.core.errors import InputError
from cmg_mj.core.rig import Decision, Readings, RigControl, RigDeciding, ideals_of
from cmg_mj.core.sensor import Digital, Sensor, SensorState
from cmg_mj.core.tape import INPUT, Operand, Symbol, Tape
from cmg_mj.core.tree import FLOATS, form, numbers, rebuild
from cmg_mj.features.export.c_code import body
from cmg_mj.features.export.formula import Formula
from cmg_mj.plant.plant import Plant
from cmg_mj.stages.pair import White

OF_STAGES = (Symbolic, *FLOATS)
"""Numbers of a stage's memory; its whole numbers count samples, by which it looks up noise."""
SETTINGS = 3
"""Numbers of an axis that a model's <config> may change: sigma and step of the forces, step of the angles."""

Results = list[tuple[str, Operand]]
"""What a function writes: name of a number, or its text in C -> number."""


@dataclass
class Function:
    """A function in C.

    Attributes:
        name: Its name.
        arguments: Its arguments, after the state's numbers `s`.
        steps: What comes before its results: lines, and numbers that are written to a row of its own.
        results: What it writes.
        streams: Number of each noise stream that it draws from.
        helpers: Functions that it calls.
    """

    name: str
    arguments: tuple[str, ...] = ()
    steps: list[str | Results] = field(default_factory=list)
    results: Results = field(default_factory=list)
    streams: set[int] = field(default_factory=set)
    helpers: list[Function] = field(default_factory=list)


IDEAL = ("double *x",)
SAMPLE = ("const double *x", "double *y")
REPEATED = ("const double *n", "double *result")


class RecordedSensor(NamedTuple):
    """A sensor as functions in C."""

    name: str
    sensor: Sensor
    ideal: Function
    """Its signal, of the inputs."""
    init: Function
    take: Function
    width: int
    """Numbers of a reading."""


class Stream:
    """A noise stream while functions are recorded: its samples come one after the other, as a generator's."""

    def __init__(self, recorder: Recorder, number: int, width: int) -> None:
        self._recorder, self._number, self._width = recorder, number, width
        self._next = 0
        self._function: Function | None = None
        self._looked: dict[int, Sequence[Symbol]] = {}

    def __call__(self, sample: int) -> Sequence[Symbol]:
        """Return the normals of a sample.

        Raises:
            InputError: It is not the next one.
        """
        function = self._recorder.function
        if function is not self._function:
            self._function, self._looked = function, {}
        if sample not in self._looked:
            self._draw(sample)
            row = f"d{len(function.steps)}"
            function.steps.append(f"double {row}[{self._width}];")
            function.steps.append(f"noise_normals(s + {generator(self._number)}, {row}, {self._width});")
            self._looked[sample] = self._recorder.inputs(f"{row}[{{}}]", self._width)
        return self._looked[sample]

    def mean(
        self,
        formula: Callable[..., tuple[Sequence[Symbol], Symbol]],
        memory: Sequence[Operand],
        samples: int,
        piece: int,
    ) -> tuple[list[Symbol], Symbol]:
        """Record a loop over the next samples.

        Args:
            formula: Takes a memory and the normals of a sample; returns the next memory, and a result.
            memory: The memory before the loop.
            samples: Number of the samples.
            piece: Number of those whose results are summed together.

        Returns:
            The memory behind the loop, and the mean of the results.
        """
        recorder, function = self._recorder, self._recorder.function
        next_one = Function(f"{function.name}_{len(function.steps)}", REPEATED)
        after, result = formula(recorder.inputs("s[{}]", len(memory)), recorder.inputs("n[{}]", self._width))
        next_one.results = [*zip(_row("s", len(memory)), after, strict=True), ("*result", result)]
        function.helpers.append(next_one)
        row, mean = f"r{len(function.steps)}", f"m{len(function.steps)}"
        function.steps.append(f"double {row}[{len(memory)}];")
        function.steps.append(list(zip(_row(row, len(memory)), memory, strict=True)))
        words = f"{generator(self._number)}, {self._width}, {next_one.name}, {row}, {samples}, {piece}"
        function.steps.append(f"const double {mean} = noise_mean(s + {words});")
        self._draw(self._next)
        self._next += samples - 1
        return recorder.inputs(f"{row}[{{}}]", len(memory)), recorder.tape.input(mean)

    def _draw(self, sample: int) -> None:
        if sample != self._next:
            raise InputError(
                f"noise stream {self._number}: sample {sample} is looked up, and {self._next} is next: a plugin draws "
                "one after the other"
            )
        self._next += 1
        self._recorder.function.streams.add(self._number)


def generator(stream: int) -> str:
    """Name the place of a stream's generator in the state."""
    return f"NOISE_{stream}"


def _row(name: str, count: int) -> list[str]:
    return [f"{name}[{i}]" for i in range(count)]


class Recorder:
    """Records functions.

    Attributes:
        tape: Their operations.
        function: The function that is being recorded.
        places: Name of a number -> its place in the state.
    """

    def __init__(self) -> None:
        self.tape = Tape()
        self.function = Function("")
        self.places: dict[str, int] = {}

    def inputs(self, name: str, count: int) -> list[Symbol]:
        """Append numbers that are given, `{}` in their name stands for their index."""
        return [self.tape.input(name.format(i)) for i in range(count)]

    @contextmanager
    def recording(self, name: str, *arguments: str) -> Iterator[Function]:
        """Record a function of this name and these arguments."""
        self.function = Function(name, arguments)
        yield self.function

    def repeated(
        self,
        name: str,
        arguments: Sequence[str],
        tree: Any,
        runs: Sequence[Callable[[Any], tuple[Any, Results]]],
    ) -> tuple[Function, Any]:
        """Record a function with a memory, each time with the memory that the time before has left.

        Args:
            name: The function's name; before its first `_` stands what the memory's numbers are named with.
            arguments: Its arguments.
            tree: The memory before.
            runs: What it does, (memory) -> (next memory, results), in several calls.

        Returns:
            The function, and the memory behind the last call.

        Raises:
            InputError: The calls differ, or the memory's form does.
        """
        recorded = []
        for run in runs:
            with self.recording(name, *arguments) as function:
                names = self.names_of(name, tree)
                after, results = run(_rebuilt(tree, iter([self.tape.input(one) for one in names])))
                function.results = [*zip(names, _leaves(after), strict=True), *results]
            if form(after) != form(tree):
                raise InputError(f"{name}: its memory changes its form")
            tree = after
            places = [(target, self.tape.place(number)) for target, number in function.results]
            recorded.append((places, [step for step in function.steps if isinstance(step, str)]))
        if any(one != recorded[0] for one in recorded):
            raise InputError(f"{name}: depends on the number of the sample or the step otherwise than by its noise")
        return function, tree

    def names_of(self, name: str, tree: Any) -> list[str]:
        """Name the numbers of a memory."""
        return [f"{name.partition('_')[0]} {i}" for i in range(len(_leaves(tree)))]

    def used(self, functions: Sequence[Function]) -> set[str]:
        """Find the names of the numbers that functions take."""
        written = [row for one in functions for row in (one.results, *one.steps) if not isinstance(row, str)]
        places = [self.tape.place(number) for row in written for _, number in row]
        operations = [self.tape.operations[place] for place in self.tape.needed(places)]
        return {operation.value for operation in operations if operation.name == INPUT}

    def prune(self, memory: Sequence[str], functions: Sequence[Function]) -> list[str]:
        """Leave out what functions remember and never use; return the names of the rest of a memory."""
        kept: set[str] = set()
        while True:
            thinned = [
                replace(one, results=[result for result in one.results if result[0] not in memory or result[0] in kept])
                for one in functions
            ]
            found = self.used(thinned).intersection(memory)
            if found == kept:
                break
            kept = found
        for function, thin in zip(functions, thinned, strict=True):
            function.results = thin.results
        return [name for name in memory if name in kept]

    def printed(self, function: Function) -> str:
        """Print a function in C."""
        lines = []
        for step in function.steps:
            lines += [step] if isinstance(step, str) else ["{", *self._body(step), "}"]
        lines += self._body(function.results)
        arguments = ["double *s", *function.arguments]
        unused = ", ".join(f"(void){argument.split('*')[-1]}" for argument in arguments)
        helpers = "".join(map(self.printed, function.helpers))
        text = "".join(f"    {line}\n" for line in [f"{unused};", *lines])
        return f"{helpers}static void {function.name}({', '.join(arguments)})\n{{\n{text}}}\n\n"

    def _body(self, results: Results) -> list[str]:
        written = [(self._text(target), self.tape.place(number)) for target, number in results]
        operations = self.tape.operations
        written = [
            (target, place)
            for target, place in written
            if operations[place].name != INPUT or self._text(operations[place].value) != target
        ]
        needed = sorted(self.tape.needed(place for _, place in written))
        given = [place for place in needed if operations[place].name == INPUT]
        names = [self._text(operations[place].value) for place in given]
        formula = Formula(self.tape, given, [place for _, place in written])
        return body(formula, names, [target for target, _ in written], "double", "double")

    def _text(self, name: str) -> str:
        return f"s[{self.places[name]}]" if name in self.places else name


def _leaves(tree: Any) -> list[Any]:
    """List the numbers of a memory: of observers and laws all of them."""
    if isinstance(tree, RigDeciding):
        return [*(leaf.value for leaf in numbers(tree.axes)), *_leaves(tree.between)]
    return [leaf.value for leaf in numbers(tree) if isinstance(leaf.value, OF_STAGES)]


def _rebuilt(tree: Any, values: Iterator[Any]) -> Any:
    if isinstance(tree, RigDeciding):
        return RigDeciding(rebuild(tree.axes, values), rebuild(tree.between, values, OF_STAGES))
    return rebuild(tree, values, OF_STAGES)


class RecordedRig(NamedTuple):
    """A rig as functions in C."""

    recorder: Recorder
    control: RigControl
    sensors: list[list[RecordedSensor]]
    """Those of each axis that the decisions depend on."""
    settings: list[list[float]]
    """The numbers of each axis that a model's <config> may change."""
    first: Function
    trimmed: Function
    later: Function
    memory: dict[str, list[str]]
    """Names of what each sensor remembers, and under `rig` of what the decisions do."""
    inputs: list[str]
    """Names of the numbers that MuJoCo gives: `sensordata` or `qvel`, then a place there."""

    @property
    def all_sensors(self) -> list[RecordedSensor]:
        """The sensors of all axes."""
        return [sensor for of_axis in self.sensors for sensor in of_axis]

    @property
    def functions(self) -> list[Function]:
        """All functions."""
        of_sensors = [part for one in self.all_sensors for part in (one.ideal, one.init, one.take)]
        decisions = [self.first, self.trimmed, self.later]
        return [*of_sensors, *decisions[: 1 if self.trimmed is self.later else 2], self.later]


def record(control: RigControl, plant: Plant) -> RecordedRig:
    """Record the functions of a rig.

    Args:
        control: The control, whose observers and laws can be traced.
        plant: The plant, whose sensors give the readings.

    Returns:
        The functions.

    Raises:
        InputError: Plain C cannot do what one of the stages does.
    """
    require_recordable(control)
    recorder = Recorder()
    model = plant.model
    readings = plant.ideal_readings(
        recorder.inputs("sensordata {}", model.nsensordata), recorder.inputs("qvel {}", model.nv)
    )
    streams = {number: Stream(recorder, number, width) for number, width in control.draws.items()}
    settings = [_settings(axis) for axis in control.axes]
    axes = [_with_settings(axis, recorder.inputs(f"setting {i} {{}}", SETTINGS)) for i, axis in enumerate(control.axes)]
    control = replace(control, axes=tuple(axes))
    sensors = [
        [_sensor(recorder, f"a{i}s{k}", sensor, ideal, streams) for k, sensor in enumerate(axis.at_work)]
        for i, (axis, ideal) in enumerate(zip(axes, ideals_of(readings), strict=True))
    ]
    first, trimmed, later, names = _decisions(recorder, control, sensors, readings, streams)
    memory = {"rig": recorder.prune(names, [later, trimmed, first])}
    delivered = recorder.used([first, trimmed, later])
    needed = [[one for one in of_axis if delivered.intersection(delivered_names(one))] for of_axis in sensors]
    for one in (one for of_axis in needed for one in of_axis):
        init_names = [target for target, _ in one.init.results if target.startswith(f"{one.name} ")]
        memory[one.name] = recorder.prune(init_names, [one.take, one.init])
    made = RecordedRig(recorder, control, needed, settings, first, trimmed, later, memory, [])
    used = recorder.used(made.functions)
    given = [f"sensordata {i}" for i in range(model.nsensordata)] + [f"qvel {i}" for i in range(model.nv)]
    return made._replace(inputs=[name for name in given if name in used])


def require_recordable(control: RigControl) -> None:
    """Refuse what depends on more than the tick before.

    Raises:
        InputError: A stage moves other actuators or looks up a plan, or two sensors share their noise.
    """
    for stage in control.between:
        if stage.actuators or stage.tables:
            raise InputError(f"{type(stage).__name__}: moves actuators or follows a plan: a plugin does not have it")
    sensors = [sensor.draws for axis in control.axes for sensor in axis.at_work]
    if sum(map(len, (*sensors, *(stage.draws for stage in control.between)))) > len(control.draws):
        raise InputError("two sensors share a noise stream: a plugin draws each stream for one")


def _settings(axis: AxisControl) -> list[float]:
    accelerometer, encoder, *_ = axis.at_work
    (sigma,) = (stage.sigma for stage in accelerometer.stages if isinstance(stage, White))
    steps = [
        stage.resolution for part in (accelerometer, encoder) for stage in part.stages if isinstance(stage, Digital)
    ]
    return [sigma, *steps]


def _with_settings(axis: AxisControl, settings: Sequence[Any]) -> AxisControl:
    """Return an axis whose settings are symbols, with an observer and a law that may remember symbols."""
    sigma, force_step, angle_step = settings
    accelerometer, encoder, *others = axis.at_work
    at_work = [_set(accelerometer, sigma, force_step), _set(encoder, sigma, angle_step), *others]
    observers, law = copy.deepcopy((axis.observers, axis.law))
    return replace(axis, observers=observers, law=law, at_work=tuple(at_work))


def _set(sensor: Sensor, sigma: Any, step: Any) -> Sensor:
    stages = [
        replace(stage, sigma=sigma)
        if isinstance(stage, White)
        else replace(stage, resolution=step)
        if isinstance(stage, Digital)
        else stage
        for stage in sensor.stages
    ]
    return replace(sensor, stages=tuple(stages))


def delivered_names(one: RecordedSensor) -> list[str]:
    """Name the numbers of a sensor that the decisions take."""
    return [f"delivered {one.name} {i}" for i in range(one.width)]


def _sensor(recorder: Recorder, name: str, sensor: Sensor, ideal: Any, streams: Mapping[int, Stream]) -> RecordedSensor:
    """Record a sensor: its signal, its first sample, and a sample after others."""
    signal = sensor.ideal(ideal)
    x = recorder.inputs("x[{}]", len(signal))
    with recorder.recording(f"{name}_ideal", *IDEAL) as shown:
        shown.results = list(zip(_row("x", len(signal)), signal, strict=True))
    with recorder.recording(f"{name}_init", *SAMPLE) as init:
        memory, reading = sensor.started(x, ideal, streams)
        rows = _row("y", len(reading))
        names = recorder.names_of(name, memory)
        init.results = [*zip(names, _leaves(memory), strict=True), *zip(rows, reading, strict=True)]

    def taken(sample: int, before: Any) -> tuple[Any, Results]:
        after, reading = sensor.passed(before, x, ideal, sample, streams)
        return after, list(zip(rows, reading, strict=True))

    runs = [lambda before, sample=sample: taken(sample, before) for sample in (1, 2)]
    take, _ = recorder.repeated(f"{name}_take", SAMPLE, memory, runs)
    return RecordedSensor(name, sensor, shown, init, take, len(reading))


def _decisions(
    recorder: Recorder,
    control: RigControl,
    sensors: Sequence[Sequence[RecordedSensor]],
    readings: Readings,
    streams: Mapping[int, Stream],
) -> tuple[Function, Function, Function, list[str]]:
    """Record the first decision, those while a memory is trimmed, and the later ones; and name what they remember."""
    sampled = []
    for of_axis in sensors:
        rows = [[recorder.tape.input(name) for name in delivered_names(one)] for one in of_axis]
        states = [SensorState(1, (), (row,) * one.sensor.kept) for one, row in zip(of_axis, rows, strict=True)]
        sampled.append(tuple(states))

    def decided(step: int, before: RigDeciding | None) -> tuple[RigDeciding, Results]:
        axes, ticks = control.decide(tuple(sampled), before, step, readings)
        after, decision = control.drive(axes, before and before.between, step, ticks, readings, streams)
        return after, _shown(decision)

    period = control.period
    settled = max(1, math.ceil(max(axis.settled for axis in control.axes) / period))
    with recorder.recording("rig_first") as first:
        memory, results = decided(0, None)
        names = recorder.names_of("rig", memory)
        first.results = [*zip(names, _leaves(memory), strict=True), *results]

    def repeated(name: str, memory: RigDeciding, *ticks: int) -> tuple[Function, RigDeciding]:
        runs = [lambda before, tick=tick: decided(tick * period, before) for tick in ticks]
        return recorder.repeated(name, (), memory, runs)

    trimmed = None
    if settled > 1:
        trimmed, memory = repeated("rig_trimmed", memory, 1, settled - 1)
    later, _ = repeated("rig_later", memory, settled, settled + 1)
    return first, trimmed or later, later, names


def _shown(decision: Decision) -> Results:
    """Name what a decision shows and commands."""
    results: Results = []
    for i, (tick, rate) in enumerate(zip(decision.ticks, decision.rates, strict=True)):
        shown = [tick.y1, tick.y2, tick.acceleration, tick.u, tick.x_e, *tick.estimates[0]]
        results += [(f"shown {i} {k}", number) for k, number in enumerate(shown)]
        results.append((f"rate {i}", rate))
    return results
