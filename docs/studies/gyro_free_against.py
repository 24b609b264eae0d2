"""`gyro_free` against other observers under sensor errors, moving pivots and bending frames.

    python docs/studies/gyro_free_against.py [--worlds 20] [--jobs 2] [--only pivot]

About 12 minutes on two busy cores (11 minutes of processor time); a bar shows the progress. The table of
docs/which_observer.md, with more rows. The study changes one thing at a time in push_recovery: 400 ug/rtHz of noise, an
equilibrium bias of 0.5 degrees, a push of 1 N m for 0.1 s. Each observer is in a loop of its own, with the same noise
for all. A cell is the velocity RMS error over the run [1e-3 rad/s], the mean over the worlds that stood, and the number
of worlds that fell. `zero` and `mems_fused` close no loop: their motion is that of a loop with the true rate.
"""

import argparse
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from typing import NamedTuple

import numpy as np
from rich.console import Console
from rich.progress import track

from cmg_mj import load_scenario, prepare
from cmg_mj.results.result import Result
from cmg_mj.results.tables import markdown_table
from cmg_mj.runs.side_by_side import run_jobs, run_of

SEED = 160_000
OBSERVERS = ("gyro_free", "free_pivot", "adaptive", "homogeneous", "kalman")
BASELINES = ("zero", "mems_fused")
ERROR = "velocity_rms_error_rad_s"


class Case(NamedTuple):
    """One row of the table.

    Attributes:
        name: What differs from the scenario.
        settings: The fields that make the difference.
    """

    name: str
    settings: tuple[str, ...] = ()


def sensor_errors() -> Iterator[Case]:
    """Yield errors of the accelerometers, of their sampling, and of their places."""
    sensor = "sensors.accelerometer."
    yield Case("nothing")
    for name, skew_s in (("a fifth of a", 0.001), ("half a", 0.0025), ("four fifths of a", 0.004), ("one", 0.005)):
        yield Case(f"skew of {name} sample period", (f"{sensor}skew_s={skew_s}",))
    late = (f"{sensor}skew_s=0.005", "controller.angle_source=estimated")
    yield Case("skew of one period, estimated angle fed back", late)
    for size in (4, 20, 50, 100):
        yield Case(f"vibration of {size} mg", (f"{sensor}vibration_mg={size}",))
    for size in (20, 100):
        yield Case(
            f"vibration of {size} mg, low-pass of 94 Hz", (f"{sensor}vibration_mg={size}", f"{sensor}bandwidth_hz=94")
        )
    for place, size in (("inner", 5), ("inner", -5), ("outer", 5), ("outer", -5), ("inner", 20), ("inner", -20)):
        moved = "outwards" if size > 0 else "inwards"
        yield Case(
            f"{place} sensor {abs(size)} mm too far {moved}", (f"plant.accelerometer_{place}_misplaced_mm={size}",)
        )
    yield Case("outer sensor turned by 1 deg", (f"{sensor}misalignment_deg=[0,1]",))


def pivots() -> Iterator[Case]:
    """Yield pivots that move."""
    for size, corner_hz in ((0.05, 5.0), (0.2, 5.0), (0.5, 5.0), (1.0, 5.0), (0.5, 0.5), (1.0, 0.5)):
        motion = f'pivot=[{{kind="noise", acceleration_m_s2={size}, corner_hz={corner_hz}}}]'
        yield Case(f"pivot moves by {size:g} m/s^2, up to {corner_hz:g} Hz", (motion,))


def bends() -> Iterator[Case]:
    """Yield frames that bend: a fifth of the inertia on a mast with the sensors, or half of it above a base."""
    for frequency_hz in (8, 10, 14, 20, 40):
        mast = (f"bend.frequency_hz={frequency_hz}", "bend.share=0.2", "bend.beyond=sensors")
        yield Case(f"mast of {frequency_hz} Hz", mast)
        if frequency_hz <= 20:
            yield Case(f"mast of {frequency_hz} Hz, notch", (*mast, f"controller.notch_hz={frequency_hz}"))
    base = ("bend.frequency_hz=10", "bend.share=0.5", "bend.beyond=both")
    yield Case("base of 10 Hz", base)
    yield Case("base of 10 Hz, notch", (*base, "controller.notch_hz=10"))


def cell(result: Result, baseline: str | None = None) -> str:
    """Return the mean error of the worlds that stood, and the worlds that fell."""
    errors = result.values(ERROR, baseline)
    known = errors[np.isfinite(errors)]
    error = f"{1e3 * known.mean():.0f}" if known.size else "-"
    fell = int(result.fell.sum())
    return error if baseline or not fell else f"{error} ({fell} fell)"


def row(case: Case, worlds: int) -> list[str]:
    """Return the cells of one case."""
    settings = [f"seed={SEED}", *case.settings]
    loops = [(name, settings) for name in OBSERVERS] + [("gyro_free", [*settings, "controller.feedback=truth"])]
    jobs = [run_of(prepare(load_scenario("push_recovery", given, name)), worlds) for name, given in loops]
    *own, true = run_jobs(jobs, keep_trajectory=False)
    return [case.name, *map(cell, own), *(cell(true, name) for name in BASELINES), str(int(true.fell.sum()))]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--worlds", type=int, default=20)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--only", default="", help="cases whose names contain this")
    options = parser.parse_args()
    cases = [case for case in (*sensor_errors(), *pivots(), *bends()) if options.only in case.name]
    with ProcessPoolExecutor(options.jobs, mp_context=get_context("spawn")) as pool:
        waiting = [pool.submit(row, case, options.worlds) for case in cases]
        rows = [each.result() for each in track(waiting, "cases", console=Console(stderr=True))]
    heads = ["disturbance", *(f"`{name}`" for name in (*OBSERVERS, *BASELINES)), "fell with the true rate"]
    print(f"velocity RMS error [1e-3 rad/s], {options.worlds} worlds\n")
    print(markdown_table(heads, rows))


if __name__ == "__main__":
    main()
