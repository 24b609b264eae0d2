"""The tables of docs/real_rigs_evidence.md about a frame that bends: who stands, and with which cure.

python docs/studies/bending_frame.py [WORLDS] (about three minutes on two quiet cores)
python docs/studies/bending_frame.py --border (about a minute: check's verdicts beside the simulation, near the border
    of stability)
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor

from cmg_mj import load_scenario, prepare
from cmg_mj.features.bend.verdict import judge_bend

WORLDS = 20
RATES = {
    "true rate": ["controller.feedback=truth"],
    "gyro": ["controller.feedback=fog"],
    "homogeneous": ["observer.kind=homogeneous"],
    "kalman": ["observer.kind=kalman"],
    "gyro_free": ["observer.kind=gyro_free"],
}
"""Whose rate the law uses, and the settings for that."""
NO_RATE = ["controller.gains=[35.0, 0.0, -1.0, 0.3]"]
PLACES = {
    "mast": ["bend.beyond=sensors", "bend.share=0.2"],
    "base": ["bend.beyond=both", "bend.share=0.5"],
}
LOW_BANDWIDTH = "controller.lqr={state_cost=[405.6, 2.26, 0.223, 0.096], input_cost=10.0}"
CURES = {
    "as is": [],
    "estimated angle": ["controller.angle_source=estimated"],
    "lower bandwidth": [LOW_BANDWIDTH],
    "notch": ["controller.notch_hz={hz}"],
}
FREQUENCIES_HZ = {"mast": (5.0, 10.0, 20.0, 40.0), "base": (5.0, 10.0)}
OFF = (0.85, 0.92, 1.0, 1.08, 1.15)
"""A notch's middle over the mode's frequency."""


def cell(job: tuple[Sequence[str], int]) -> str:
    """Falls out of so many worlds; where none falls, the RMS of the command [rad/s]."""
    settings, worlds = job
    result = prepare(load_scenario("push_recovery", ["duration_s=6.0", "seed=23", *settings])).run_many(worlds)
    falls = int(sum(result.fell))
    return f"{falls} fall" if falls else f"{result.mean('command_rms_rad_s'):.2f}"


def bend(hz: float, place: str) -> list[str]:
    """The settings of a bend."""
    return [f"bend.frequency_hz={hz:g}", *PLACES[place]]


Row = tuple[str, list[tuple[Sequence[str], int]]]
"""A head, and the cells: their settings and the number of worlds."""


def row(head: str, cells: Sequence[Sequence[str]], worlds: int) -> Row:
    """A row of the tables."""
    return head, [(settings, worlds) for settings in cells]


def rows(worlds: int) -> list[Row]:
    """All rows of the tables."""
    result = [row("rigid", list(RATES.values()), worlds), row("rigid, no rate", [NO_RATE], worlds)]
    for place, frequencies in FREQUENCIES_HZ.items():
        for hz in frequencies:
            for cure, settings in CURES.items():
                changes = [setting.replace("{hz}", f"{hz:g}") for setting in settings]
                cells = [[*bend(hz, place), *rate, *changes] for rate in RATES.values()]
                result.append(row(f"{place} {hz:g} Hz, {cure}", cells, worlds))
    for hz in (10.0, 20.0):
        cells = [[*bend(hz, "mast"), *RATES["gyro_free"], f"controller.notch_hz={hz * off:g}"] for off in OFF]
        head = f"mast {hz:g} Hz, gyro_free, notch off by {', '.join(f'{off:g}' for off in OFF)}"
        result.append(row(head, cells, worlds))
    return result


NEAR_THE_BORDER: dict[str, tuple[list[str], tuple[float, ...]]] = {
    "mast, gyro_free": ([*PLACES["mast"], *RATES["gyro_free"]], (18.0, 20.0, 21.0, 22.0, 24.0, 26.0)),
    "mast, gyro_free, notch": (
        [*PLACES["mast"], *RATES["gyro_free"], *CURES["notch"]],
        (5.0, 5.5, 6.0, 6.5, 7.0),
    ),
    "mast, homogeneous": ([*PLACES["mast"], *RATES["homogeneous"]], (5.5, 6.0, 6.5, 7.0, 8.0)),
    "base, kalman": ([*PLACES["base"], *RATES["kalman"]], (14.0, 16.0, 17.0, 18.0, 20.0)),
}
"""Settings, and frequencies of the mode about the one at which the loop becomes stable."""


def border() -> None:
    """Print the verdicts of `check` beside falls, or the command's RMS, of three worlds in 12 s."""
    print("| loop | bend [Hz] | check | nearest to -1 | simulation |")
    for name, (settings, frequencies) in NEAR_THE_BORDER.items():
        for hz in frequencies:
            changes = [f"bend.frequency_hz={hz:g}", *(setting.replace("{hz}", f"{hz:g}") for setting in settings)]
            experiment = prepare(load_scenario("push_recovery", ["duration_s=12.0", "seed=23", *changes]))
            trial = judge_bend(experiment.design, experiment.plant)
            assert trial is not None
            result = experiment.run_many(3)
            falls, rms = int(sum(result.fell)), result.mean("command_rms_rad_s")
            motion = f"{falls} fall" if falls else f"{rms:.2f}"
            verdict = "stable" if trial.is_stable else "unstable"
            distance = "-" if trial.distance is None else f"{trial.distance:.2f}"
            print(f"| {name} | {hz:g} | {verdict} | {distance} | {motion} |", flush=True)


def main() -> None:
    """Print the tables."""
    if "--border" in sys.argv:
        return border()
    worlds = int(sys.argv[1]) if len(sys.argv) > 1 else WORLDS
    table = rows(worlds)
    print(f"{worlds} worlds a cell; falls, or the RMS of the command [rad/s]")
    print("|", " | ".join(["bend", *RATES]), "|")
    with ProcessPoolExecutor(2) as executor:
        cells = executor.map(cell, [job for _, jobs in table for job in jobs])
        for head, jobs in table:
            print("|", " | ".join([head, *(next(cells) for _ in jobs)]), "|", flush=True)


if __name__ == "__main__":
    main()
