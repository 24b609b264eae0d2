"""Figs 4 to 7: the observers in open loop and in the loop, which of them is best by which measure, and why."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Literal, NamedTuple

import numpy as np

from cmg_mj.features.tuning.simulations import window_of
from cmg_mj.papers.aranovskiy2020.paper import OBSERVERS
from cmg_mj.papers.aranovskiy2020.rig import DURATION_S, push_recovery
from cmg_mj.papers.assumed import PUSH_RECOVERY
from cmg_mj.papers.claim import Claim, OnShare
from cmg_mj.papers.recorded import loop_panels, push_intervals, rms, trajectory_of
from cmg_mj.papers.scales import on_common_scales
from cmg_mj.papers.words import join_with_and
from cmg_mj.results.intervals import Interval, known_interval, mean_interval
from cmg_mj.results.result import Result
from cmg_mj.results.summary_keys import KEYS
from cmg_mj.results.trajectory import Trajectory
from cmg_mj.runs.experiment import prepare
from cmg_mj.runs.side_by_side import run_of, run_side_by_side
from cmg_mj.scenario.loading import load_scenario
from cmg_mj.view.plots.figure import Line, Panel, Picture

SEED_4 = 72_000
WORLDS_4 = 20
COMPARABLE = 1.5
"""Errors within this factor count as comparable."""


class OpenLoopRuns(NamedTuple):
    """The observers open loop, on one motion."""

    whole: dict[str, np.ndarray]
    """RMS of the estimated rate less the gyro's over the whole run, (n_worlds,) [rad/s]; `zero`: of zero."""
    after_push: dict[str, np.ndarray]
    """Errors from the push to one second after its end."""
    example: Trajectory
    """World 0."""


def run_open_loop(worlds: int, seed: int) -> OpenLoopRuns:
    """Run the tuning experiment with the three observers in open loop."""
    scenario = load_scenario(
        "observer_tuning", [f"seed={seed}", 'open_loop_observers=["ltv", "homogeneous"]'], "linear"
    )
    whole = trajectory_of(prepare(scenario).run_many(worlds))
    window = whole.between(*window_of(scenario))

    def errors(trajectory: Trajectory) -> dict[str, np.ndarray]:
        gyro = trajectory["fog_rad_s"]
        rms_errors = {name: rms(trajectory[f"estimate/{name}/x2_rad_s"] - gyro) for name in OBSERVERS}
        return rms_errors | {"zero": rms(gyro)}

    return OpenLoopRuns(errors(whole), errors(window), whole.world(0))


def largest_by_smallest(errors: Mapping[str, Interval]) -> float:
    """Return the largest of the three observers' errors by the smallest."""
    means = [errors[name].mean for name in OBSERVERS]
    return max(means) / min(means)


def figure_4(worlds: int = WORLDS_4, seed: int = SEED_4) -> list[Claim]:
    """Judge whether the three are comparable: from the push to a second after it, and over the whole run.

    Most of the whole run is stillness, where they are judged by their noise: there zero is closer than any.
    """
    runs = run_open_loop(worlds, seed)
    return [
        _comparable(
            "from the push to a second after it", runs.after_push, "_after_push", [_open_loop_picture(runs.example)]
        ),
        _comparable("over all 10 s", runs.whole, "", []),
    ]


def _comparable(span: str, rms_errors: Mapping[str, np.ndarray], suffix: str, pictures: list[Picture]) -> Claim:
    """Judge one span of the run."""
    errors = {name: mean_interval(values) for name, values in rms_errors.items()}
    spread = largest_by_smallest(errors)
    return Claim(
        place=f"Fig. 4, {span}",
        statement="With the loop closed on the gyro and a push at 2 s, the three tuned observers are comparable open "
        "loop.",
        assumes={**PUSH_RECOVERY, "threshold": f"comparable is within a factor of {COMPARABLE:g}"},
        missing_data="The paper gives neither this recording, with its push, e and noise, nor a limit for comparable.",
        holds=spread < COMPARABLE,
        conditions=_zero_sentence(errors),
        otherwise=(
            "With ours they are not. (10) and (11) know the command but not the push, and take the command's effect "
            f"for a rate. {_zero_sentence(errors)}"
        ),
        figures={
            **{f"rms{suffix}_{name}_rad_s": interval for name, interval in errors.items()},
            f"largest_by_smallest{suffix}": spread,
        },
        pictures=pictures,
    )


def _find_beaten(errors: Mapping[str, Interval]) -> list[str]:
    """Return the equations that an estimate of zero is closer than."""
    return [equation for name, equation in OBSERVERS.items() if errors[name].mean > errors["zero"].mean]


def _describe_zero(errors: Mapping[str, Interval]) -> str:
    beaten = _find_beaten(errors)
    return f"an estimate of zero is closer than {join_with_and(beaten)}" if beaten else "all are closer than zero"


def _zero_sentence(errors: Mapping[str, Interval]) -> str:
    sentence = _describe_zero(errors)
    return f"{sentence[0].upper()}{sentence[1:]}."


def _open_loop_picture(example: Trajectory) -> Picture:
    t, shaded = example["time_s"], push_intervals(example)
    panels = [
        Panel("tilt y1 [deg]", [Line(t, np.degrees(example["y1_rad"]), "measured", width=0.7)], "(a)", shaded=shaded),
        Panel("command u [rad/s]", [Line(t, example["u_rad_s"], "u", color=3, width=0.7)], shaded=shaded),
    ]
    for i, (name, equation) in enumerate(OBSERVERS.items()):
        lines = [
            Line(t, example[f"estimate/{name}/x2_rad_s"], f"{equation} {name}", color=name, width=0.7),
            Line(t, example["fog_rad_s"], "gyro", "k-", width=1.0),
        ]
        panels.append(Panel("tilt rate [rad/s]", lines, "(b)" if i == 0 else "", shaded=shaded, y_range=(-0.5, 0.45)))
    return Picture(
        "aranovskiy2020-fig-4", "aranovskiy2020, Fig. 4: tuning, the law fed by the gyro, a push at 2 s", panels
    )


def figure_4_claims(on_share: OnShare) -> list[Claim]:
    """Judge Fig. 4."""
    return figure_4()


Numbers = Mapping[str, np.ndarray]
"""Observer -> a measure in the loop, (n_worlds,); NaN for a world that did not stand. Less is better."""

AngleSource = Literal["measured", "estimated"]
"""The angles that the law is fed with."""

Order = Literal["holds", "is inverted", "does not hold"]

PAIRS = (("ltv", "homogeneous"), ("linear", "ltv"))
"""The worse and the better of Section V's ranking."""
JUDGED = "velocity_rms_error_rad_s"
"""The measure of the paper's subject, velocity observers: the first."""
MEASURES = (JUDGED, "velocity_rms_error_push_rad_s", "tilt_rms_deg", "command_rms_rad_s")
"""Summary keys that an observer could be better by; the paper names none."""


def differences(numbers: Numbers) -> list[Interval | None]:
    """Subtract the better's numbers from the worse's, world by world, for each of `PAIRS`."""
    return [known_interval(numbers[worse] - numbers[better]) for worse, better in PAIRS]


def judge_order(numbers: Numbers) -> Order:
    """Judge the order homogeneous < ltv < linear: it holds beyond chance, is inverted, or neither."""
    steps = differences(numbers)
    if all(step is not None and step.low > 0.0 for step in steps):
        return "holds"
    if all(step is not None and step.high < 0.0 for step in steps):
        return "is inverted"
    return "does not hold"


class Measure(NamedTuple):
    """One measure, with the law on either kind of angles."""

    key: str
    numbers: Mapping[AngleSource, Numbers]
    """Angle source -> observer -> numbers."""

    @property
    def orders(self) -> dict[AngleSource, Order]:
        """Angle source -> the order."""
        return {angles: judge_order(numbers) for angles, numbers in self.numbers.items()}

    @property
    def best_observers(self) -> dict[AngleSource, str]:
        """Angle source -> the observer with the least mean over the worlds that stood."""
        return {
            angles: min(numbers, key=lambda name: float(np.nanmean(numbers[name])))
            for angles, numbers in self.numbers.items()
        }

    def has_order(self, order: Order) -> bool:
        """Return true if the order is this one on all angles."""
        return set(self.orders.values()) == {order}


def read_measures(results: Mapping[AngleSource, Mapping[str, Result]]) -> list[Measure]:
    """Read the measures off the runs: angle source -> observer -> runs."""
    return [
        Measure(
            key,
            {
                angles: {name: result.values(key) for name, result in by_name.items()}
                for angles, by_name in results.items()
            },
        )
        for key in MEASURES
    ]


def orders(measures: list[Measure]) -> list[Claim]:
    """Judge Section V's ranking by each measure, that of `JUDGED` first; the picture is the first one's."""
    return [_order(measure, [] if i else [_measures_picture(measures)]) for i, measure in enumerate(measures)]


def _order(measure: Measure, pictures: list[Picture]) -> Claim:
    label = KEYS[measure.key].label
    turns = (
        "At low noise or large bias the order turns round, because (11) mistakes the bias for a rate most: the map "
        "over noise and bias is in docs/results.md."
    )
    return Claim(
        place=f"Section V, the comparison: {label}",
        statement="The homogeneous differentiator performs best, the time-varying observer second, the linear one "
        f"last; judged by the {label}.",
        assumes=PUSH_RECOVERY,
        holds={f"{angles} angles": order == "holds" for angles, order in measure.orders.items()},
        conditions=turns if measure.key == JUDGED else "",
        otherwise=_in_which_order(measure) + (f" {turns}" if measure.key == JUDGED else ""),
        figures={
            f"{worse}_less_{better}_{angles}_angles_{measure.key}": step
            for angles, numbers in measure.numbers.items()
            for (worse, better), step in zip(PAIRS, differences(numbers), strict=True)
        },
        pictures=pictures,
    )


def _in_which_order(measure: Measure) -> str:
    """Say how the order is not the ranking's."""
    if measure.has_order("is inverted"):
        return "It is inverted: (9), (10), (11)."
    best_equations = join_with_and(sorted({OBSERVERS[name] for name in measure.best_observers.values()}))
    return f"The best is {best_equations}."


def _measures_picture(measures: list[Measure]) -> Picture:
    panels = []
    for i, measure in enumerate(measures):
        most = max(float(np.nanmax(values)) for numbers in measure.numbers.values() for values in numbers.values())
        for angles, numbers in measure.numbers.items():
            marks = [
                Line(np.arange(len(numbers[name])), numbers[name], "" if i else equation, "o", color=name)
                for name, equation in OBSERVERS.items()
            ]
            label = KEYS[measure.key].heading.replace(" RMS", "\nRMS")
            panels.append(Panel(label, marks, "" if i else f"{angles} angles", "world", y_range=(0.0, 1.05 * most)))
    return Picture(
        "aranovskiy2020-section-5",
        "aranovskiy2020, Section V: measures of the closed loop, world by world",
        panels,
        columns=len(next(iter(measures)).numbers),
    )


_HERE = "cmg_mj.papers.aranovskiy2020.forms_of_10"
TEN, ELEVEN = "(10)", "(11)"
TEN_BY_EULER, TEN_EXACT_GAIN, ELEVEN_BY_EULER = "(10), Euler", "(10), Euler, exact H", "(11), Euler"
CASES: Mapping[str, tuple[str, Sequence[str]]] = {
    TEN: ("ltv", []),
    ELEVEN: ("homogeneous", []),
    TEN_BY_EULER: (f"{_HERE}:TenByEuler", []),
    TEN_EXACT_GAIN: (f"{_HERE}:TenByEuler", ["observer.exact_gain=true"]),
    ELEVEN_BY_EULER: (f"{_HERE}:ElevenByEuler", []),
}
"""Form -> the observer in the loop and its settings."""

Errors = Mapping[str, np.ndarray]
"""Form -> velocity RMS error in the loop, (n_worlds,) [rad/s]; NaN for a world that did not stand."""


def errors_of(forms: Sequence[str], worlds: int, seed: int) -> dict[str, np.ndarray]:
    """Close the loop on some of `CASES`, the push and noise of Figs 5 to 7, the law on measured angles."""
    experiments = [push_recovery(observer, seed, settings) for observer, settings in (CASES[form] for form in forms)]
    results = run_side_by_side([run_of(experiment, worlds) for experiment in experiments], keep_trajectory=False)
    return {form: result.values("velocity_rms_error_rad_s") for form, result in zip(forms, results, strict=True)}


def all_errors(known_errors: Errors, worlds: int, seed: int) -> dict[str, np.ndarray]:
    """Return the errors of every form, those that are known among them."""
    return dict(known_errors) | errors_of([form for form in CASES if form not in known_errors], worlds, seed)


def cause(errors: Errors) -> Claim:
    """Judge the cause that Section V gives for the second place of (10).

    Partly is more than nothing and less than all: by one method for both, the distance between (10) and (11) must be
    larger by Euler's than by an exact one, and must not vanish by the exact one.
    """
    exact = known_interval(errors[TEN] - errors[ELEVEN])
    by_euler = known_interval(errors[TEN_BY_EULER] - errors[ELEVEN_BY_EULER])
    method = known_interval((errors[TEN_BY_EULER] - errors[TEN]) - (errors[ELEVEN_BY_EULER] - errors[ELEVEN]))
    gain = known_interval(errors[TEN_BY_EULER] - errors[TEN_EXACT_GAIN])
    share = None if method is None or by_euler is None else method.mean / by_euler.mean
    share_text = "-" if share is None else f"{share:.0%}"
    return Claim(
        place="Section V, the cause of the second place",
        statement="(10) comes after (11) partly because of the numerical computations that (10) takes.",
        assumes={**PUSH_RECOVERY, "method": "explicit Euler at 200 Hz"},
        holds=_positive(method) and _positive(exact),
        conditions=(
            f"By explicit Euler at 200 Hz, of which the paper says nothing: then {share_text} of the distance is the "
            "method's, and the rest is there without any error of method. "
            + (
                "Nearly all of it comes from the step of the estimate, and none to speak of from the equations of H, "
                "which Remark 1 blames."
                if gain is not None and method is not None and abs(gain.mean) < 0.05 * method.mean
                else "The equations of H, which Remark 1 blames, have a part in it."
            )
        ),
        otherwise="The distance is not in part the method's.",
        figures={
            "ltv_less_homogeneous_exact_rad_s": exact,
            "ltv_less_homogeneous_euler_rad_s": by_euler,
            "of_it_by_the_method_rad_s": method,
            "of_it_by_the_method_share": share,
            "ltv_euler_less_euler_with_exact_gain_rad_s": gain,
        },
    )


def _positive(interval: Interval | None) -> bool:
    """Return true if the interval lies above zero."""
    return interval is not None and interval.low > 0.0


FIGURES = {"linear": "Fig. 5", "ltv": "Fig. 6", "homogeneous": "Fig. 7"}
ANGLES: tuple[AngleSource, AngleSource] = ("measured", "estimated")
"""The angles that the law is fed with."""
SEED = 72_001
WORLDS = 20


def close_loops(
    observers: Sequence[str], angles: AngleSource, worlds: int, seed: int, duration_s: float = DURATION_S
) -> dict[str, Result]:
    """Close the loop on each observer, a push at 2 s."""
    settings = [f'controller.angle_source="{angles}"']
    runs = [run_of(push_recovery(observer, seed, settings, duration_s), worlds) for observer in observers]
    return dict(zip(observers, run_side_by_side(runs), strict=True))


def figure(name: str, results: Mapping[AngleSource, Result]) -> Claim:
    """Judge one of Figs 5 to 7."""
    error = {angles: known_interval(result.values("velocity_rms_error_rad_s")) for angles, result in results.items()}
    tilt = {angles: known_interval(result.values("tilt_rms_deg")) for angles, result in results.items()}
    falls = {angles: float(result.fell.mean()) for angles, result in results.items()}
    settles = {angles: float(np.isfinite(result.values("settle_time_s")).mean()) for angles, result in results.items()}
    return Claim(
        place=FIGURES[name],
        statement=f"With the estimate of {OBSERVERS[name]} in the law the rig stands, and recovers from a push.",
        assumes=PUSH_RECOVERY,
        holds=max(falls.values()) == 0.0 and min(settles.values()) == 1.0,
        otherwise="It falls in some worlds, or does not settle.",
        figures={
            key: value
            for angles in results
            for key, value in (
                (f"velocity_rms_error_{angles}_angles_rad_s", error[angles]),
                (f"tilt_rms_{angles}_angles_deg", tilt[angles]),
                (f"fell_fraction_{angles}_angles", falls[angles]),
                (f"settled_fraction_{angles}_angles", settles[angles]),
            )
        },
        pictures=[_loop_picture(name, {angles: trajectory_of(result).world(0) for angles, result in results.items()})],
    )


def _loop_picture(name: str, examples: Mapping[AngleSource, Trajectory]) -> Picture:
    """Draw two columns: the law on measured angles, the law on estimated ones."""
    columns = []
    for angles, example in examples.items():
        column = loop_panels(example, name, OBSERVERS[name], f"{angles} angles", 0.6)
        gimbal = [Line(example["time_s"], np.degrees(example["x3_rad"]), "true x3", color=0)]
        column.insert(2, Panel("gimbal angle [deg]", gimbal, shaded=column[0].shaded))
        columns.append(column)
    number = FIGURES[name].removeprefix("Fig. ")
    return Picture(
        f"aranovskiy2020-fig-{number}",
        f"aranovskiy2020, Fig. {number}: the loop closed on {OBSERVERS[name]}, the law on measured and on estimated "
        "angles",
        [panel for row in zip(*columns, strict=True) for panel in row],
        columns=2,
    )


def claims(on_share: OnShare) -> list[Claim]:
    """Judge the three figures, and what Section V concludes from the same runs."""
    results: dict[AngleSource, dict[str, Result]] = {}
    for i, angles in enumerate(ANGLES):
        results[angles] = close_loops(list(OBSERVERS), angles, WORLDS, SEED)
        on_share((i + 1) / 3.0)
    exact = {
        TEN: results["measured"]["ltv"].values("velocity_rms_error_rad_s"),
        ELEVEN: results["measured"]["homogeneous"].values("velocity_rms_error_rad_s"),
    }
    errors = all_errors(exact, WORLDS, SEED)
    return [
        *on_common_scales([figure(name, {angles: results[angles][name] for angles in ANGLES}) for name in FIGURES]),
        *orders(read_measures(results)),
        cause(errors),
    ]
