"""Prints the tables of docs/real_rigs.md about a frame that bends: who stands, as is and with each cure.

python docs/studies/bending_frame.py [WORLDS]
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor

from cmg_mj import load_scenario, prepare

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
    "mast": ["plant.bend_beyond=sensors", "plant.bend_share=0.2"],
    "base": ["plant.bend_beyond=both", "plant.bend_share=0.5"],
}
SOFTER = "controller.lqr={state_cost=[405.6, 2.26, 0.223, 0.096], input_cost=10.0}"
CURES = {
    "as is": [],
    "estimated angle": ["controller.angle_source=estimated"],
    "lower bandwidth": [SOFTER],
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
    return [f"plant.bend_frequency_hz={hz:g}", *PLACES[place]]


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


def main() -> None:
    """Print the tables."""
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
