"""Two axes: what each does to the other, how fast the rig may turn, a gait's torque.

    python docs/studies/two_axes_loop.py [--worlds 20]   (three minutes)

Prints the tables of docs/two_axes_evidence.md.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence

import numpy as np

from cmg_mj.linear.ceiling import ceiling
from cmg_mj.results.result import Result
from cmg_mj.results.summary_keys import section
from cmg_mj.results.tables import markdown_table
from cmg_mj.runs.experiment import Experiment, prepare
from cmg_mj.scenario.loading import load_scenario

AXES = ("roll", "pitch")
ERROR = "velocity_rms_error_rad_s"
NO_BIAS = ("plant.equilibrium_bias_deg=0", "axes.pitch.plant.equilibrium_bias_deg=0")


def two_axes(*settings: str) -> Experiment:
    """The scenario with other settings."""
    return prepare(load_scenario("two_axes", settings))


def of_axis(result: Result, axis: str, key: str = ERROR) -> float:
    """The mean over the worlds of an axis' figure."""
    figures = [section(summary, "axes").get(axis, summary)[key] for summary in result.summaries]
    return float(np.array(figures, dtype=float).mean())


def each_on_the_other(worlds: int) -> str:
    """Each axis' velocity error beside its own with the other locked."""
    rows = []
    cases = [("homogeneous", ()), ("homogeneous, e = 0", NO_BIAS), ("adaptive", ()), ("gyro_free", ())]
    for name, settings in cases:
        kind = f"observer.kind={name.partition(',')[0]}"
        for rate in (0.0, 1.0, 2.0, 3.0):
            given = [*settings, kind, f"plant.turn_rate_rad_s={rate}"]
            both = two_axes(*given).run_many(worlds, keep_trajectory=False)
            row = [name, f"{rate:g}", f"{int(both.stood.sum())} of {worlds}"]
            for axis, other in (AXES, AXES[::-1]):
                alone = two_axes(*given, f'plant.locked_axes=["{other}"]').run_many(worlds, keep_trajectory=False)
                with_it, without = of_axis(both, axis), of_axis(alone, axis)
                row += [f"{with_it:.4f}", f"{without:.4f}", f"{with_it / without - 1.0:+.1%}"]
            rows.append(row)
    headings = ["observer", "turn [rad/s]", "stood"]
    headings += [f"{axis}{what}" for axis in AXES for what in (" [rad/s]", ", other locked", "")]
    return markdown_table(headings, rows)


def largest_tilt(worlds: int) -> str:
    """The share of the ceiling tilt, on both axes at once, from which the rig recovers."""
    rows = []
    for model in ("two_axes", "two_axes_free_base"):
        calm = ("push=[]", "plant.turn_rate_rad_s=0", *NO_BIAS, f"plant.model={model}", "duration_s=6")
        first = two_axes(*calm)
        limit = min(math.degrees(ceiling(own.design.rig.reduced, own.law.rate_limit).tilt) for own in first.axes)
        row = [model, f"{limit:.2f}"]
        for share in (0.8, 0.9, 0.95, 1.0):
            result = two_axes(*calm, f"plant.initial_tilt_deg={share * limit}").run_many(worlds, keep_trajectory=False)
            row.append(f"{int(result.stood.sum())} of {worlds}")
        rows.append(row)
    return markdown_table(["model", "ceiling [deg]", *(f"stood at {share}" for share in (0.8, 0.9, 0.95, 1.0))], rows)


def fastest_turn(rates: Sequence[float] = (0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0)) -> str:
    """At which turn rates one world stands."""
    rows = []
    for name, sign, against in (
        ("as derived", 1.0, "true"),
        ("none", 1.0, "false"),
        ("of the wrong sign", -1.0, "true"),
    ):
        row = [name]
        for rate in rates:
            experiment = two_axes(f"plant.turn_rate_rad_s={rate}", f"controller.compensate_turning={against}")
            derived = experiment.plant.turning
            flywheels = sign * np.array(derived.flywheels)
            experiment.plant.__dict__["turning"] = derived._replace(flywheels=flywheels.tolist())
            outcome = experiment.run(keep_trajectory=False).outcomes[0]
            row.append(f"fell at {outcome.time_s:.1f} s" if outcome.fell else "stands")
        rows.append(row)
    return markdown_table(["gimbals turned against it", *(f"{rate:g} rad/s" for rate in rates)], rows)


def gait(worlds: int) -> str:
    """A swinging torque on both axes, a quarter period apart."""
    rows = []
    for amplitude, frequency in ((0.5, 1.0), (1.0, 1.0), (0.5, 2.0), (1.5, 2.0)):
        swings = ",".join(
            f"{{frequency_hz={frequency}, amplitude_n_m={amplitude}, phase_deg={phase}.0, axis='{axis}'}}"
            for axis, phase in zip(AXES, (0, 90), strict=True)
        )
        for name, own in (
            ("homogeneous", ()),
            ("adaptive", ()),
            ("adaptive", (f"observer.sinusoid_hz={frequency}",)),
            ("gyro_free", ()),
        ):
            given = ("push=[]", "duration_s=30", f"swing=[{swings}]", f"observer.kind={name}", *own)
            result = two_axes(*given).run_many(worlds, keep_trajectory=False)
            known = ", with the frequency" if own else ""
            figures = [f"{of_axis(result, axis, key):.3f}" for key in (ERROR, "tilt_rms_deg") for axis in AXES]
            stood = int(result.stood.sum())
            rows.append(
                [f"{amplitude:g} N m, {frequency:g} Hz", name + known, f"{stood} of {worlds}"]
                + (figures if stood == worlds else ["-"] * 4)
            )
    headings = [f"{what} {axis} [{unit}]" for what, unit in (("error", "rad/s"), ("tilt RMS", "deg")) for axis in AXES]
    return markdown_table(["torque", "observer", "stood", *headings], rows)


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--worlds", type=int, default=20)
    worlds = parser.parse_args().worlds
    for title, table in (
        ("Each axis beside its own with the other locked", each_on_the_other(worlds)),
        ("The largest tilt, on both axes at once", largest_tilt(worlds)),
        ("How fast the rig may turn", fastest_turn()),
        ("A gait's torque on both axes", gait(worlds)),
    ):
        print(f"## {title}\n\n{table}\n", flush=True)


if __name__ == "__main__":
    main()
