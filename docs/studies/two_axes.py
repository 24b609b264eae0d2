"""The two-axis rig in numbers: its measures, the coupling of its axes, and the effect of unlike wheels and gimbals.

    python docs/studies/two_axes.py [--parts rig,turning,unlike,loop] [--worlds 8] [--observer homogeneous]

Torques are those of the full model's joints at given rates, without accelerations. The torques with the wheels at
rest are subtracted. docs/two_axes_evidence.md has the tables.
"""

from __future__ import annotations

import argparse
import copy
import math
import tempfile
from collections.abc import Mapping
from pathlib import Path

import mujoco
import numpy as np

from cmg_mj.inputs.files import folder
from cmg_mj.plant.plant import Plant, load_plant
from cmg_mj.results.tables import markdown_table
from cmg_mj.runs.experiment import prepare
from cmg_mj.scenario.loading import load_scenario

TILTS = ("yaw", "roll", "pitch")
SLOW = {"0 0 0 0 314 0 -314": "0 0 0 0 282.6 0 -314", "0 0 314 0 -314": "0 0 282.6 0 -314"}
"""In two_axes.xml: roll/cube1's wheel 10 % slow, in qvel and in ctrl."""
FREE = {'<velocity name="yaw_servo" joint="yaw" kv="10"/>': "", 'ctrl="0 ': 'ctrl="'}
"""Without the yaw servo."""
NO_NOISE = (
    "sensors.accelerometer.noise_density_ug_rthz=0",
    "sensors.accelerometer.counts_per_g=0",
    "sensors.encoder.counts_per_revolution=0",
)
AHEAD = math.radians(5.0)


def rig(changes: Mapping[str, str], place: str) -> str:
    """A copy of the rig's files with other text: its path."""
    for path in folder("models").glob("*.xml"):
        text = path.read_text(encoding="utf-8")
        for old, new in changes.items():
            text = text.replace(old, new)
        (Path(place) / path.name).write_text(text, encoding="utf-8")
    return str(Path(place) / "two_axes.xml")


def asked(
    plant: Plant, rates: Mapping[str, float], x3: tuple[float, float], u: tuple[float, float], ahead: float = 0.0
) -> np.ndarray:
    """Torques on yaw, roll and pitch [N m]: roll/cube1's gimbal is ahead of its partner by an angle [rad]."""
    torques = []
    for share in (1.0, 0.0):
        model = copy.copy(plant.model)
        data = mujoco.MjData(model)
        mujoco.mj_resetDataKeyframe(model, data, plant.key)
        for axis, angle, rate in zip(plant.axes, x3, u, strict=True):
            for module in axis.modules:
                data.qpos[module.gimbal] = module.gimbal_zero + module.direction * angle
                data.qvel[module.gimbal_dof] = module.direction * rate
                data.qvel[module.flywheel_dof] *= share
        first = plant.axis.modules[0]
        data.qpos[first.gimbal] += first.direction * ahead
        for name, rate in rates.items():
            data.joint(name).qvel[0] = rate
        mujoco.mj_inverse(model, data)
        torques.append([data.joint(name).qfrc_inverse[0] for name in TILTS])
    return np.array(torques[0]) - torques[1]


def the_rig() -> str:
    """Describe the rig, by axis."""
    rows = []
    for name in ("two_axes.xml", "two_axes_free_base.xml"):
        plant = load_plant(model=name, equilibrium_bias_deg=0.0)
        mass = float(plant.model.body("frame").subtreemass[0])
        for axis in plant.axes:
            own = axis.reduced
            gravity, inertia = own.gimbals * own.gravity_torque, own.gimbals * own.J1
            row = (mass, gravity / (mass * plant.gravity), inertia, own.J_d * own.omega_d / own.J1)
            pole = math.sqrt(gravity / inertia)
            cells = (f"{row[0]:.1f}", f"{row[1]:.4f}", f"{row[2]:.4f}", f"{row[3]:.3f}", f"{pole:.3f}")
            rows.append([name, axis.name, *cells, f"{own.J2:.2g}"])
    headings = ("model", "axis", "mass [kg]", "h [m]", "I [kg m^2]", "b [1/s]", "pole [1/s]", "J2 [kg m^2]")
    return markdown_table(headings, rows, text_columns=2)


def turning() -> str:
    """Torques that a turn at 1 rad/s asks of the tilts at x3 = 40 and 10 degrees, at several gimbal rates."""
    plant = load_plant(model="two_axes.xml", equilibrium_bias_deg=0.0)
    c = np.array(plant.turning.flywheels)
    print("c =", ", ".join(f"[{', '.join(f'{value:+.0f}' for value in row + 0.0)}]" for row in np.round(c, 9)), "\n")
    d = np.array(plant.turning.inertia) + 0.0
    print("d =", ", ".join(f"[{', '.join(f'{value:+.3f}' for value in row)}]" for row in np.round(d, 9)), "s\n")
    roll, pitch = x3 = math.radians(40.0), math.radians(10.0)
    exact = c[0, 1] * math.sin(pitch) / math.cos(roll), c[1, 0] * math.sin(roll) / math.cos(pitch)
    tangent = c[0, 1] * math.tan(pitch), c[1, 0] * math.tan(roll)
    wrong = -exact[0], -exact[1]
    rows = [
        [name, *(f"{value:+.3f}" for value in (*u, *(asked(plant, {"yaw": 1.0}, x3, u)[1:] + 0.0).round(9)))]
        for name, u in (
            ("gimbals held", (0.0, 0.0)),
            ("w c sin(x3 other)/cos(x3 own)", exact),
            ("w c tan(x3 other)", tangent),
            ("the wrong sign", wrong),
        )
    ]
    return markdown_table(("", "u roll [rad/s]", "u pitch [rad/s]", "on roll [N m]", "on pitch [N m]"), rows)


def unlike() -> str:
    """Coupling by a wheel that is 10 % slow, or a gimbal 5 degrees ahead of its partner."""
    rows = []
    with tempfile.TemporaryDirectory() as place:
        alike = load_plant(model="two_axes.xml", equilibrium_bias_deg=0.0)
        slow = load_plant(model=rig(SLOW, place), equilibrium_bias_deg=0.0)
    still = (0.0, 0.0)
    for name, plant, ahead in (
        ("alike", alike, 0.0),
        ("roll/cube1's wheel 10 % slow", slow, 0.0),
        ("roll/cube1's gimbal 5 deg ahead", alike, AHEAD),
    ):
        own = plant.reduced
        rows.append(
            [
                name,
                *(
                    f"{abs(value):.4f}"
                    for value in (
                        asked(plant, {"pitch": 1.0}, still, still, ahead)[1],
                        asked(plant, {"yaw": 1.0}, still, still, ahead)[2],
                        asked(plant, {"pitch": 1.0}, (0.5, 0.0), still, ahead)[0],
                        asked(plant, {}, (0.5, 0.0), (1.0, 0.0), ahead)[0],
                        own.J_d * own.omega_d / own.J1,
                    )
                ),
            ]
        )
    headings = (
        "wheels and gimbals",
        "on roll, pitch at 1 rad/s [N m]",
        "on pitch, yaw at 1 rad/s [N m]",
        "on yaw, pitch at 1 rad/s, x3 0.5 [N m]",
        "on yaw, u 1 rad/s, x3 0.5 [N m]",
        "roll's b [1/s]",
    )
    return markdown_table(headings, rows)


def loop(worlds: int, observer: str) -> str:
    """The loop closed, roll pushed with 2 N m for 0.1 s: how far yaw goes, and pitch, which nobody pushes."""
    rows = []
    settings = [
        *("controller.gains=scaled", "plant.initial_tilt_deg=0", "plant.equilibrium_bias_deg=0", "duration_s=6"),
        *("push.0.axis=roll", "push.0.start_s=2", "push.0.torque_n_m=2"),
    ]
    for wheels, slow in (("alike", {}), ("one 10 % slow", SLOW)):
        for yaw, free in (("held", {}), ("free", FREE)):
            angles = []
            for more, count in ((NO_NOISE, 1), ((), worlds)):
                with tempfile.TemporaryDirectory() as place:
                    model = f"plant.model={rig({**slow, **free}, place)}"
                    scenario = load_scenario("push_recovery", [model, *settings, *more]).with_observer(observer)
                    experiment = prepare(scenario)
                    found = experiment.run_many(count)
                assert found.trajectory is not None
                names = experiment.plant.joint_names
                angles.append(np.degrees(found.trajectory.qpos()[..., [names.index(name) for name in TILTS]]))
            (_, _, quiet), (yaw_peak, roll, pitch) = (np.abs(each).max(axis=0).mean(axis=0) for each in angles)
            figures = (roll, quiet, pitch, yaw_peak, np.abs(angles[1][-1, :, 0]).mean())
            rows.append([wheels, yaw, f"{int(found.stood.sum())}/{worlds}", *(f"{value:.3f}" for value in figures)])
    headings = (
        *("wheels", "yaw", "stood", "roll peak [deg]", "pitch peak without noise [deg]", "pitch peak [deg]"),
        *("yaw peak [deg]", "yaw at the end [deg]"),
    )
    return markdown_table(headings, rows, text_columns=3)


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--parts", default="rig,turning,unlike,loop")
    parser.add_argument("--worlds", type=int, default=8)
    parser.add_argument("--observer", default="homogeneous")
    of = parser.parse_args()
    parts = {
        "rig": the_rig,
        "turning": turning,
        "unlike": unlike,
        "loop": lambda: loop(of.worlds, of.observer),
    }
    for part in of.parts.split(","):
        print(parts[part](), end="\n\n")


if __name__ == "__main__":
    main()
