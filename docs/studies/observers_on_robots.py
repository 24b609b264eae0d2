"""Every observer on the robots of docs/mount_evidence.md: as in the papers, scaled by `mount`, and tuned there.

python docs/studies/observers_on_robots.py [ROBOT ...] [--keep FILE] [--minutes M] [--rows loop,fit,tuned,E]

ROBOT is a part of a name. Each row is written to FILE as soon as the row is there, and is not computed again. After M
minutes no other row begins, and the finished rows are printed. All rows take about twenty minutes on a quiet core. The
scenario is that of `cmg-mj mount --quick`. First every observer is in its own loop. Then the loop is closed on the
gyro, so that one recording serves all observers (`cmg-mj tune`). The fit is 1 - error/motion from the push to one
second after it, on six worlds that no parameter was tuned on. Tuning starts at the scaled parameters, takes those in
`TUNED`, and ends after five seconds of CPU. E is the push margin of the reduced model with the observer in the loop.
"""

import json
import math
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from functools import cached_property
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2]))


from cmg_mj import mount
from cmg_mj.core.reduced_model import hold_matrices
from cmg_mj.features.mounting.limits import push_limits, push_margin
from cmg_mj.features.mounting.write import write_scenario
from cmg_mj.features.tuning import Recorded, halves, recorder, tune
from cmg_mj.features.tuning.search import StopSearch
from cmg_mj.features.tuning.simulations import window_of
from cmg_mj.observers import OBSERVERS
from cmg_mj.observers.scaling import scaled_parameters, scales_of
from cmg_mj.results.floors import FLOOR_Y1, TiltFloor, acceleration_floor
from cmg_mj.results.summary_keys import SummaryValue, section
from cmg_mj.results.tables import markdown_table
from cmg_mj.runs.experiment import Experiment, prepare
from cmg_mj.scenario.schema import ObserverSettings, Scenario
from tests.features.mounting.robots import ROBOTS

WORLDS, LOOP_WORLDS = 6, 4
TUNING_S = 5.0
RIG, FLOORS = "the robot", ("floor_y1", "floor_model", "floor_accel")
TUNED = {
    "linear": ("tau",),
    "linear_high_gain": ("epsilon",),
    "super_twisting": ("L",),
    "homogeneous": ("k1", "k2"),
    "kalman": ("torque_walk", "torque_white"),
}
"""Parameters to tune, by observer. Observers that `floor_model` bounds need none to show that no fit is positive."""
IN_THE_LOOP = ("gyro_free", "linear", "super_twisting", "homogeneous", "luenberger", "kalman", "adaptive")


def model_floor(experiment: Experiment, window_s: float) -> float:
    """Least error of a time-invariant linear observer of y1 that knows all but the push and the noise [rad/s].

    One that is slower than the window is long may be a little below: the window ends before its error has faded.

    The error of an observer whose model and gimbals' rate are exact obeys e'' = g e + w whatever the loop does. In the
    mean square over the window a blow P/J has the effect of white w of intensity (P/J)^2/window, and the stationary
    Kalman filter of that is the best.
    """
    from scipy.linalg import solve_discrete_are

    dt, model, noise = experiment.design.constructor_arguments
    push = experiment.scenario.push[0]
    jump = push.torque_n_m * push.duration_s / (model.gimbals * model.J1)
    F, into, _ = hold_matrices(
        np.array([[0.0, 1.0], [model.gravity_torque / model.J1, 0.0]]), np.array([[0.0], [1.0]]), dt
    )
    Q = into @ into.T * jump**2 / window_s / dt
    C, R = np.array([[1.0, 0.0]]), np.array([[noise.tilt**2]])
    P = solve_discrete_are(F.T, C.T, Q, R)
    return math.sqrt((P - P @ C.T @ np.linalg.solve(C @ P @ C.T + R, C @ P))[1, 1])


def floors(experiment: Experiment, held: Recorded) -> dict[str, float]:
    """Fits that the floors leave, from the push on."""
    trajectory, dt = held.trajectory, experiment.law.dt
    worlds = len(held.zero_errors)
    start, end = window_of(experiment.scenario)
    pushed = np.repeat((trajectory["time_s"] >= start - 1e-9)[:, None], worlds, axis=1)
    tilt = TiltFloor(dt, worlds)
    tilt.add(trajectory["y1_rad"], trajectory["x2_rad_s"], np.ones_like(pushed), pushed)
    y1 = [tilt.errors(world)[1] or math.nan for world in range(worlds)]
    noise = experiment.design.constructor_arguments[2]
    errors = float(np.mean(y1)), model_floor(experiment, end - start), acceleration_floor(noise, dt)
    return {name: 1.0 - error / held.zero_rms for name, error in zip(FLOORS, errors, strict=True)}


def with_parameters(scenario: Scenario, kind: str, parameters: dict) -> Scenario:
    """The scenario with an observer."""
    return scenario.model_copy(update={"observer": ObserverSettings.model_validate({"kind": kind, **parameters})})


def fits(experiment: Experiment, kind: str, held: Recorded) -> dict:
    """Fits on the held-out worlds."""
    models = {"papers": {}, "scaled": scaled_parameters(kind, experiment.plant.reduced)}
    row = {}
    for name, parameters in models.items():
        if name == "papers" or parameters:
            observer = with_parameters(experiment.scenario, kind, parameters).observer
            made = observer.make(*experiment.design.constructor_arguments)
            row[name] = 1.0 - float(held.errors(made).mean()) / held.zero_rms
    return row


def fit_tuned(experiment: Experiment, kind: str, recorded: Callable[..., Recorded]) -> dict:
    """The fit of tuned parameters on the held-out worlds."""
    end = time.process_time() + TUNING_S

    def on_share(share: float) -> None:
        if time.process_time() > end:
            raise StopSearch

    level = tune(
        with_parameters(experiment.scenario, kind, scaled_parameters(kind, experiment.plant.reduced)),
        worlds=WORLDS,
        parameters=TUNED[kind],
        starts=1,
        recorded=recorded,
        on_share=on_share,
    ).levels[0]
    sizes = {name: float(f"{size:.3g}") for name, size in level.sizes.items()}
    return {"tuned": level.fit, "sizes": sizes}


def margins(experiment: Experiment, kind: str, ceiling: float) -> dict:
    """E in shares of the ceiling."""
    models = {"papers": {}, "scaled": scaled_parameters(kind, experiment.plant.reduced)}
    row = {}
    for name, parameters in models.items():
        if name == "papers" or parameters:
            loop = prepare(with_parameters(experiment.scenario, kind, parameters), experiment.plant)
            row[name] = push_margin(loop.design).median_impulse / ceiling
    return row


def mean(values: Sequence[SummaryValue]) -> float:
    """The mean of those that are numbers."""
    return float(np.mean([value for value in values if isinstance(value, float)]))


def in_its_own_loop(experiment: Experiment, kind: str) -> dict:
    """Fits as `cmg-mj run` has them, over the whole run and from the push on: the mean of the worlds that stood."""
    models = {"papers": {}, "scaled": scaled_parameters(kind, experiment.plant.reduced)}
    row = {}
    for name, parameters in models.items():
        if name == "papers" or parameters:
            loop = prepare(with_parameters(experiment.scenario, kind, parameters), experiment.plant)
            result = loop.run_many(LOOP_WORLDS, keep_trajectory=False)
            stood = [summary for summary, stands in zip(result.summaries, result.stood, strict=True) if stands]
            row[f"{name} stood"] = len(stood)
            for key, figure in {"whole": "velocity_fit", "push": "velocity_fit_push"}.items():
                if stood:
                    row[f"{name} {key}"] = mean([summary[figure] for summary in stood])
                    in_floors = [section(summary, "references")[FLOOR_Y1][figure] for summary in stood]
                    row[f"{name} {key} floor"] = mean(in_floors)
    return row


class OnRobot:
    """A robot with the pair on it; what is recorded of it is made when it is needed."""

    def __init__(self, robot: str, folder: Path) -> None:
        path = ROBOTS[robot].path
        model = mount(path, **ROBOTS[robot].options).save(folder / "balanced.xml")
        limits = push_limits(write_scenario(model, path, "gyro_free"))
        self.ceiling = limits.limit_push_impulse
        self.experiment = write_scenario(model, path, "gyro_free", limits)

    @cached_property
    def recorded(self) -> Callable[..., Recorded]:
        """The recordings that `tune` asks for."""
        scenario = self.experiment.scenario
        return recorder(scenario, halves(WORLDS, [scenario.sensors.accelerometer.noise_density_ug_rthz]))

    @cached_property
    def held(self) -> Recorded:
        """Worlds that nothing is tuned on."""
        density = self.experiment.scenario.sensors.accelerometer.noise_density_ug_rthz
        return self.recorded(range(WORLDS, 2 * WORLDS), density)

    def row(self, kind: str, part: str) -> dict:
        """Compute a row."""
        if part == "loop":
            return in_its_own_loop(self.experiment, kind)
        if part == "E":
            return margins(self.experiment, kind, self.ceiling)
        if part == "tuned":
            return fit_tuned(self.experiment, kind, self.recorded)
        if kind == RIG:
            tau = scales_of(self.experiment.plant.reduced).time
            return {"tau": tau, "motion": self.held.zero_rms, **floors(self.experiment, self.held)}
        return fits(self.experiment, kind, self.held)


def cell(row: dict, names: tuple[str, ...], digits: str) -> str:
    """Numbers with an arrow between; those that there are."""
    return " → ".join(f"{row[name]:{digits}}" for name in names if name in row) or "-"


def loop_cell(row: dict, key: str) -> str:
    """Fits with an arrow between; with how many worlds stood, if not all."""
    texts = []
    for name in ("papers", "scaled"):
        stood = row.get(f"{name} stood")
        if stood == 0:
            texts.append("falls")
        elif stood:
            texts.append(f"{row[f'{name} {key}']:.2f}" + (f" ({stood}/{LOOP_WORLDS})" if stood < LOOP_WORLDS else ""))
    return " → ".join(texts)


def main() -> None:
    """Compute what is missing, and print the tables."""
    words = sys.argv[1:]
    options = {words[i]: words[i + 1] for i, word in enumerate(words) if word in ("--keep", "--minutes", "--rows")}
    parts = [word for i, word in enumerate(words) if not word.startswith("--") and not words[i - 1].startswith("--")]
    wanted = [name for name in ROBOTS if not parts or any(part in name for part in parts)]
    end = time.monotonic() + 60.0 * float(options.get("--minutes", "inf"))
    file = Path(options["--keep"]) if "--keep" in options else None
    lines = file.read_text(encoding="utf-8").splitlines() if file and file.exists() else []
    rows: dict[str, dict] = dict(json.loads(line) for line in lines)

    def keep(name: str, row: dict) -> None:
        rows[name] = row
        print(name, row, file=sys.stderr, flush=True)
        if file:
            with file.open("a", encoding="utf-8") as stream:
                stream.write(json.dumps([name, row]) + "\n")

    todo = [(robot, RIG, "fit") for robot in wanted]
    for part, kinds in {"loop": OBSERVERS, "fit": OBSERVERS, "tuned": TUNED, "E": IN_THE_LOOP}.items():
        if part in options.get("--rows", "loop,fit,tuned,E").split(","):
            todo += [(robot, kind, part) for robot in wanted for kind in kinds]
    with tempfile.TemporaryDirectory() as folder:
        on_robots: dict[str, OnRobot] = {}
        for robot, kind, part in todo:
            name = f"{robot}/{kind}/{part}"
            if name in rows or time.monotonic() > end:
                continue
            if robot not in on_robots:
                (Path(folder) / robot).mkdir()
                on_robots[robot] = OnRobot(robot, Path(folder) / robot)
            keep(name, on_robots[robot].row(kind, part))
    of = {f"{robot}/{kind}": {} for robot in wanted for kind in (RIG, *OBSERVERS)}
    for name, row in rows.items():
        of.setdefault(name.rpartition("/")[0], {}).update(row if name.endswith(("/fit", "/tuned")) else {})
    short = [name.split(",")[0].replace(" on its free cart", "") for name in wanted]
    for key in ("whole", "push"):
        body = [
            [kind, *(loop_cell(rows.get(f"{robot}/{kind}/loop", {}), key) for robot in wanted)] for kind in OBSERVERS
        ]
        print(markdown_table([f"in its own loop, {key}", *short], body, text_columns=1), end="\n\n")
    head = [["tau", "tau", ".2f"], ["motion [rad/s]", "motion", ".4f"], *([name, name, ".2f"] for name in FLOORS)]
    body = [[label, *(cell(of[f"{robot}/{RIG}"], (key,), form) for robot in wanted)] for label, key, form in head]
    names = ("papers", "scaled", "tuned")
    body += [[kind, *(cell(of[f"{robot}/{kind}"], names, ".2f") for robot in wanted)] for kind in OBSERVERS]
    print(markdown_table(["fit", *short], body, text_columns=1), end="\n\n")
    body = [
        [kind, *(cell(rows.get(f"{robot}/{kind}/E", {}), names, ".0%") for robot in wanted)] for kind in IN_THE_LOOP
    ]
    print(markdown_table(["E of the ceiling", *short], body, text_columns=1))


main()
