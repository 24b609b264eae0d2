"""Observers on measured logs of a balancer with two accelerometers, two gyros and an angle sensor on one rigid frame.

    git clone https://github.com/AodhAnd/p6-cubli-report
    git clone https://github.com/agnieszkaszczesna/RepoIMU
    python docs/studies/measured.py p6-cubli-report --pendulum RepoIMU

Half a minute. The rig is identified on the log sensorstestwSimon3 alone. Judged are sensorstestwSimon1, pushed by hand,
and the second half of sisotool1, in closed loop; the pendulum of the observers with a model is that of its first half.
Errors are RMS against the mean of both gyros, less their offset [rad/s], from 1 s on; one gyro is judged by the other.
No parameter is tuned.

The clone is of commit ebfeaa08 (Aalborg University, group 630, 2016). It has no licence, so the logs are not here.

With `--pendulum`, beside: a pendulum that hangs, with one IMU and its angle by motion capture (commit 24145fc4,
Silesian University of Technology, 2016, no licence). Identified on trial 02a, judged on 02b against the gyro, which no
observer gets.
"""

from __future__ import annotations

import argparse
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from cmg_mj.core.errors import InputError
from cmg_mj.features.identify.identify import Identified, identify_rig
from cmg_mj.features.identify.report import noises, rig_fields
from cmg_mj.features.replay.log import ReadOptions
from cmg_mj.features.replay.log_replay import replay_prepared
from cmg_mj.features.replay.reading import read_channels, read_log
from cmg_mj.features.replay.rig import PlacedAccelerometer, Rig
from cmg_mj.observers import OBSERVERS
from cmg_mj.results.tables import markdown_table

BY_HAND, CLOSED_LOOP = "figures/original/Matlab/IMUtest", "CD/Test Files/SISOControllerFinalTest"
RADIANS, MIDDLE = 1.5769 / (1411.3483 - 2.3893), 640.5645
"""The builders' calibration of the potentiometer: its size of a count [rad], and the count of zero."""
TORQUE_N_M_A = -0.0335
"""The motor's torque on the frame by its current [N m/A]."""
HALF_S = 55.55
"""Middle of the closed loop's log [s]."""
HEADINGS = ("count", "tilt", "x1", "y1", "x2", "y2", "gyro1", "gyro2", "mean", "current", "wheel")
TILT_ALONE = ("linear", "super_twisting", "linear_high_gain")
MODELS = ("ltv", "homogeneous", "high_gain", "adaptive", "kalman", "luenberger")


def table_of(path: Path) -> np.ndarray:
    """Read a log of the clone, with the columns `HEADINGS`, (n, 11) [rad, m/s^2, rad/s, A]."""
    rows = np.loadtxt(path, delimiter=",")
    if "sisotool" in path.name:  # signs of the forces are turned there
        count, tilt, forces, gyros, motor = rows[:, :1], rows[:, 1:2], -rows[:, 9:13], rows[:, 7:9], rows[:, [3, 6]]
    else:
        count, tilt, forces, gyros = rows[:, :1], RADIANS * (rows[:, 1:2] - MIDDLE), rows[:, 2:6], rows[:, 6:8]
        motor = np.zeros((len(rows), 2))
    time = 0.01 * count[:, 0]
    offset = gyros.mean(axis=0) - np.polyfit(time, tilt[:, 0], 1)[0]
    gyros = gyros - offset
    return np.hstack([count, tilt, forces, gyros, gyros.mean(axis=1, keepdims=True), motor])


def options_of(roles: str, rig: Rig | None = None) -> ReadOptions:
    """Name the columns of these roles."""
    known = {"time": "count", "tilt": "tilt", "rate": "mean", "gyro": "gyro1", "torque": "current", "wheel": "wheel"}
    columns = {role: known[role] for role in ("time", *roles.split())}
    if "gyro" in columns:
        columns["rate"] = "gyro2"
    units = {"time": "ms", "tilt": "rad", "rate": "rad_s", "gyro": "rad_s", "torque": "n_m", "wheel": "rad_s"}
    scale = {"time": 10.0, "torque": TORQUE_N_M_A}
    accelerometers = [PlacedAccelerometer(columns=(f"x{i}", f"y{i}"), place_m=(0.0, 0.0)) for i in (1, 2)]
    return ReadOptions(
        columns,
        {role: units[role] for role in columns},
        {role: scale[role] for role in columns if role in scale},
        rig=rig or Rig(accelerometer=tuple(accelerometers)),
    )


def rig_of(found: Identified, delays: bool = False) -> Rig:
    """Return the rig, by default without the delays: observers have to live with them."""
    fields = rig_fields(found, noises(found.geometry))
    late = {**fields["delays_s"], "rate": fields["log"].get("delay_s", 0.0)} if delays else {}
    return Rig.model_validate({**fields, "log": {}, "delays_s": late})


def hanging(clone: Path, folder: Path) -> str:
    """Judge observers on the top segment of a hanging pendulum.

    The repository holds rows at 88 Hz, and repeats the accelerometer, at 26 Hz, in between; rows with a new force are
    used. Its x points up at rest, so the tilt is near 0 and the sensor is below the pivot.
    """
    roles = {"time": "t_s", "tilt": "angle_rad", "rate": "gyro_rad_s"}
    accelerometer = PlacedAccelerometer(columns=("across", "up"), place_m=(0.0, 0.0))
    logs = {}
    for trial in ("02a", "02b"):
        rows = np.loadtxt(clone / f"Pendulum/Pendulum_Test{trial}_Trial1_Segment_1.csv", delimiter=";", skiprows=2)
        rows = rows[np.append(True, np.any(np.diff(rows[:, 5:8], axis=0), axis=1))]
        angle = np.unwrap(2.0 * np.arctan2(rows[:, 4], rows[:, 1]))
        logs[trial] = folder / f"{trial}.csv"
        table = np.column_stack([rows[:, 0], angle, rows[:, [6, 5, 10]]])
        np.savetxt(logs[trial], table, delimiter=",", header="t_s,angle_rad,across,up,gyro_rad_s", comments="")
        apart = float(np.std(np.gradient(angle, rows[:, 0]) - rows[:, 10]))
    found = identify_rig(read_channels(logs["02a"], ReadOptions(roles, rig=Rig(accelerometer=(accelerometer,)))))
    rig = rig_of(found)
    alone = {"time": "t_s", "ax": "across", "az": "up", "rate": "gyro_rad_s"}
    forces = {"ax": "m_s2", "az": "m_s2"}
    rows = []
    for source, options, observers in (
        ("nothing", ReadOptions(roles), ("zero",)),
        ("accelerometer alone", ReadOptions(alone, forces), ("linear",)),
        ("motion capture", ReadOptions(roles), (*TILT_ALONE, "finite_difference")),
        ("motion capture, accelerometer, pivot at rest", ReadOptions(roles, rig=rig), ("gyro_free", "free_pivot")),
    ):
        row = errors(logs["02b"], options, tuple(o for o in observers if o in OBSERVERS) or ("linear",))
        rows += [[source, f"`{o}`", row[o]] for o in observers]
    rows.append(["motion capture, not causal", "central difference", f"{apart:.3f}"])
    return f"{markdown_table(['from', 'observer', 'pendulum'], rows)}\n\nplace: {rig.accelerometer[0].place_m}"


def errors(path: Path, options: ReadOptions, observers: tuple[str, ...]) -> dict[str, str]:
    """Replay observers on a log; the error of each [rad/s]."""
    log = read_log(path, options)
    replayed = replay_prepared(log, observers, model=options.rig.model)
    found = {name: f"{row['velocity_rms_error_rad_s']:.3f}" for name, row in replayed.summaries.items()}
    return found | dict.fromkeys(replayed.left_out, "-")


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("clone", type=Path)
    parser.add_argument("--pendulum", type=Path)
    arguments = parser.parse_args()
    clone = arguments.clone
    files = {"identified": f"{BY_HAND}/sensorstestwSimon3.csv", "by hand": f"{BY_HAND}/sensorstestwSimon1.csv"}
    files["closed loop"] = f"{CLOSED_LOOP}/sisotool1.csv"
    for name in files.values():
        if not (clone / name).is_file():
            raise SystemExit(f"{clone / name}: no such file; clone https://github.com/AodhAnd/p6-cubli-report")
    with tempfile.TemporaryDirectory() as folder:
        if arguments.pendulum:
            print(hanging(arguments.pendulum, Path(folder)))
        logs, second = {}, (HALF_S, 1e6)
        for name, file in files.items():
            logs[name] = Path(folder) / f"{name}.csv"
            np.savetxt(logs[name], table_of(clone / file), delimiter=",", header=",".join(HEADINGS), comments="")
        found = identify_rig(read_channels(logs["identified"], options_of("tilt rate")))
        rig, in_time = rig_of(found), rig_of(found, delays=True)
        first = replace(options_of("tilt rate torque wheel"), time_range_s=(0.0, HALF_S))
        pendulum = rig_of(identify_rig(read_channels(logs["closed loop"], first))).pendulum
        one = rig.model_copy(update={"accelerometer": rig.accelerometer[:1]})
        apart = rig.model_copy(update={"pivot_moves": True})
        driven = Rig(pendulum=pendulum)
        both = ("gyro_free", "free_pivot")
        rows = []
        for source, roles, known, observers in (
            ("nothing", "tilt rate", Rig(), ("zero",)),
            ("angle sensor", "tilt rate", Rig(), TILT_ALONE),
            ("angle sensor, motor, model", "tilt rate torque", driven, MODELS),
            ("accelerometers alone, 5 cm apart", "rate", rig, ("linear", *both)),
            ("angle sensor, both accelerometers, pivot unknown", "tilt rate", apart, both),
            ("angle sensor, one accelerometer, pivot at rest", "tilt rate", one, both),
            ("angle sensor, both accelerometers, pivot at rest", "tilt rate", rig, both),
            ("the same, the angle sensor's delay taken out", "tilt rate", in_time, both),
            ("angle sensor, one gyro, by the other gyro", "tilt gyro rate", Rig(), ("mems_fused",)),
        ):
            found = {}
            for name in ("by hand", "closed loop"):
                if "torque" in roles and name == "by hand":
                    continue
                options = options_of(roles, known)
                if name == "closed loop":
                    options = replace(options, time_range_s=second)
                try:
                    found[name] = errors(
                        logs[name], options, tuple(o for o in observers if o in OBSERVERS) or ("linear",)
                    )
                except InputError as error:
                    raise SystemExit(f"{source}, {name}: {error}") from error
            rows += [
                [source, f"`{o}`", *(found.get(n, {}).get(o, "-") for n in ("by hand", "closed loop"))]
                for o in observers
            ]
        print(markdown_table(["from", "observer", "by hand", "closed loop"], rows))
        print(f"\nplaces: {[one.place_m for one in rig.accelerometer]}; pendulum: {pendulum}")


if __name__ == "__main__":
    main()
