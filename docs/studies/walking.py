"""The tables of docs/walking.md: how many worlds walk 22 steps.

python docs/studies/walking.py [--worlds 20] [ROWS...]

ROWS: names of the groups below; all of them take half an hour on two cores.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cmg_mj.features.gait import walk as stage
from cmg_mj.features.gait.legs import Walk
from cmg_mj.features.gait.walk import planned
from cmg_mj.inputs.files import folder
from cmg_mj.runs.experiment import prepare
from cmg_mj.scenario.loading import load_scenario

NOISE = "sensors.accelerometer.noise_density_ug_rthz="
QUIET, STOCK = NOISE + "100", NOISE + "400"
TILES = "gait.tiles_m=0.002"
HEIGHT_M = 0.342
"""Of the mass centre, at which pushes act [m]."""


def push(size: float, *starts: float) -> str:
    """Set pushes of a size [N s] for 0.1 s, about pitch and roll in turn."""
    torque = size * HEIGHT_M / 0.1
    each = [
        f'{{axis="{("pitch", "roll")[i % 2]}",start_s={start},torque_n_m={torque}}}' for i, start in enumerate(starts)
    ]
    return f"push=[{','.join(each)}]"


PUSHES = [push(0.5, 4.9, 10.4, 15.1)]
"""On one foot, on two, on one."""
HELD, STOPPED = "controller.rate_limit_rad_s=1e-6", "plant.flywheel_speed_rad_s=0.001"

Rows = Sequence[tuple[str, float, Sequence[str]]]
GROUPS: dict[str, Rows] = {
    "claim": [
        ("gyro_free, 400 ug", 0.0, [STOCK]),
        ("gyro_free, 400 ug", 0.25, [STOCK]),
        ("gyro_free, 100 ug", 0.25, [QUIET]),
        ("gyro_free, 100 ug", 0.5, [QUIET]),
        ("rate from the truth, 400 ug", 0.0, [STOCK, "controller.feedback=truth"]),
        ("mems_fused, 400 ug", 0.25, [STOCK, "observer.kind=mems_fused"]),
        ("gimbals held, wheels turning", 0.25, [QUIET, HELD]),
        ("wheels stopped", 0.25, [QUIET, STOPPED, "controller.gains=[1,1,1,1]"]),
    ],
    "rough": [
        ("gyro_free, 100 ug, tiles and pushes", 0.25, [QUIET, TILES, *PUSHES]),
        ("the same, turns not compensated", 0.25, [QUIET, TILES, *PUSHES, "controller.compensate_turning=false"]),
        ("gyro_free, 400 ug, tiles and pushes", 0.0, [STOCK, TILES, *PUSHES]),
        ("gyro_free, 400 ug, tiles", 0.0, [STOCK, TILES]),
    ],
    "observers": [
        (f"{kind}, 100 ug", 0.1, [QUIET, f"observer.kind={kind}"])
        for kind in (
            "homogeneous",
            "kalman",
            "luenberger",
            "free_pivot",
            "homogeneous_adaptive",
            "adaptive",
            "ltv",
            "linear",
            "high_gain",
            "super_twisting",
        )
    ],
    "limits": [
        *(
            (f"push of {size} N s on {feet}", 0.0, [QUIET, push(size, at)])
            for feet, at in (("one foot", 9.9), ("two feet", 10.4))
            for size in (0.8, 1.0, 1.2, 1.4, 1.7)
        ),
        *((f"wheels at {w} rad/s", 0.0, [QUIET, f"plant.flywheel_speed_rad_s={w}"]) for w in (160, 80, 40, 20)),
        ("e of 1 deg about pitch", 0.0, [QUIET, "axes.pitch.plant.equilibrium_bias_deg=1.0"]),
        ("e of 1 deg about roll", 0.0, [QUIET, "axes.roll.plant.equilibrium_bias_deg=1.0"]),
        *((f"tiles to {mm} mm", 0.0, [QUIET, f"gait.tiles_m={mm / 1e3}"]) for mm in (1, 3, 4)),
        ("10 mg of vibration", 0.0, [QUIET, "sensors.accelerometer.vibration_mg=10"]),
        ("3 mg of vibration", 0.0, [QUIET, "sensors.accelerometer.vibration_mg=3"]),
        *((f"{s} s a step", 0.0, [QUIET, f"gait.single_s={s / 2}", f"gait.double_s={s / 2}"]) for s in (0.8, 0.7, 0.6)),
        ("15 cm a step", 0.0, [QUIET, "gait.step_length_m=0.15"]),
        ("20 cm a step", 0.0, [QUIET, "gait.step_length_m=0.2"]),
        ("feet 80 mm apart", 0.0, [QUIET, "gait.width_m=0.08"]),
        ("no bias looked for, e to 0.25", 0.25, [QUIET, "gait.lean_s=0"]),
        ("hips of 2000 N m/rad", 0.0, [QUIET, "plant.model=SOFT"]),
        ("hips of 2000 N m/rad, homogeneous", 0.0, [QUIET, "plant.model=SOFT", "observer.kind=homogeneous"]),
    ],
    "known": [
        (f"{share:.0%} of the planned acceleration", 0.0, [QUIET, f"KNOWN={share}"])
        for share in (0, 0.8, 0.9, 1.1, 1.2)
    ],
    "steps": [
        (f"{integrator}, {step} s", 0.0, [QUIET, f"plant.integrator={integrator}", f"plant.timestep_s={step}"])
        for integrator in ("RK4", "implicitfast")
        for step in (0.0025, 0.001, 0.0005)
    ],
}


def scaled(plan: Walk, share: float) -> Walk:
    """Return a plan whose acceleration is known so well only."""
    return replace(plan, acceleration=share * plan.acceleration)


def walk(worlds: int, label: str, e_deg: float, settings: Sequence[str]) -> str:
    """Run worlds with e uniform in +-e_deg about each axis; return a row of the table."""
    generator = np.random.default_rng(1)
    own = {
        f"axes.{axis}.plant.equilibrium_bias_deg": generator.uniform(-e_deg, e_deg, worlds).tolist()
        for axis in ("roll", "pitch")
    }
    if "plant.model=SOFT" in settings:
        soft = Path(tempfile.mkdtemp()) / "soft.xml"
        text = (
            (folder("models") / "biped.xml")
            .read_text(encoding="utf-8")
            .replace('kp="8000" kv="40"', 'kp="2000" kv="20"')
        )
        soft.write_text(text.replace('"cube.xml"', f'"{folder("models") / "cube.xml"}"'), encoding="utf-8")
        settings = [setting.replace("SOFT", str(soft)) for setting in settings]
    share = [float(setting.removeprefix("KNOWN=")) for setting in settings if setting.startswith("KNOWN=")]
    settings = [setting for setting in settings if not setting.startswith("KNOWN=")]
    start = [f"axes.{axis}.plant.equilibrium_bias_deg=0.0" for axis in ("roll", "pitch")]
    own = own if e_deg else None
    experiment = prepare(load_scenario("walk", [*start, *settings]))
    with pytest.MonkeyPatch.context() as patch:
        if share:
            patch.setattr(stage, "planned", lambda *arguments: scaled(planned(*arguments), share[0]))
        result = experiment.run_many(worlds, settings=own, keep_trajectory=False)
    walked = int((result.stood).sum())
    figures = [
        "-" if (mean := result.mean(key)) is None else f"{mean:{digits}}"
        for key, digits in (
            ("tilt_rms_deg", ".3f"),
            ("gimbal_peak_deg", ".0f"),
            ("velocity_rms_error_rad_s", ".4f"),
            ("gimbal_energy_j", ".3f"),
            ("leg_energy_j", ".2f"),
        )
    ]
    falls = sorted(outcome.time_s for outcome in result.outcomes if outcome.kind != "done")
    when = f"{falls[0]:.1f} to {falls[-1]:.1f} s" if falls else ""
    return " | ".join([f"| {label}", f"{e_deg:g}", f"{walked}/{worlds}", when, *figures]) + " |"


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("rows", nargs="*", metavar="ROWS", choices=[[], *GROUPS], help=", ".join(GROUPS))
    parser.add_argument("--worlds", type=int, default=20)
    arguments = parser.parse_args()
    for name in arguments.rows or GROUPS:
        print(f"\n{name}\n| | e | walked | falls at | tilt RMS | gimbal peak | rate error | gimbals J | legs J |")
        for label, e_deg, settings in GROUPS[name]:
            print(walk(arguments.worlds, label, e_deg, settings), flush=True)


if __name__ == "__main__":
    main()
