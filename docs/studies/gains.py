"""Table 2's gains, scaled gains and an LQR, on the papers' rig and on rigs that changed.

python docs/studies/gains.py (two minutes, longer on a busy machine) prints two tables: the gains with `gyro_free`, and
with scaled gains `ltv` with its default and its scaled parameters. Every loop is pushed as in `push_recovery`.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

import mujoco
import numpy as np
from tabulate import tabulate

import cmg_mj
from cmg_mj.inputs.files import folder
from cmg_mj.laws.state_feedback import StateFeedback
from cmg_mj.linear.verdict import judge_gains
from cmg_mj.observers.scaling import scaled_parameters, scales_of

WEIGHTS = "controller.lqr.state_cost=[405.6,2.26,0.223,0.096]"
"""The weights with which an LQR has Table 2's gains on the papers' rig."""
GAINS = {"Table 2": [], '`gains = "scaled"`': ["controller.gains=scaled"], "`lqr`": [WEIGHTS]}
RADIAL = np.array([1.0, 0.0, 1.0]) / np.sqrt(2.0)
"""From the pivot through the centre of mass, in the frame's axes."""
MASSES = {
    "heavier: 3 kg at the centre of mass": [(3.0, 0.134)],
    "longer: 2 kg at 0.4 m": [(2.0, 0.4)],
    "more inertia: 2 kg at +0.3 m and -0.3 m": [(2.0, 0.3), (2.0, -0.3)],
}
"""Rig -> masses added to the frame [kg], each at a distance from the pivot [m]."""


def rigs(place: Path) -> dict[str, list[str]]:
    """Write the changed models; rig -> the assignments that make it."""
    made = {"the papers'": [], "wheels at half speed": ["plant.flywheel_speed_rad_s=157"]}
    for number, (name, masses) in enumerate(MASSES.items()):
        spec = mujoco.MjSpec.from_file(str(folder("models") / "scissored_pair.xml"))
        for mass, distance in masses:
            spec.body("frame").add_body(
                pos=distance * RADIAL, mass=mass, inertia=3 * [1e-3], explicitinertial=True, ipos=3 * [0.0]
            )
        spec.compile()
        path = place / f"rig_{number}.xml"
        path.write_text(spec.to_xml(), encoding="utf-8")
        made[name] = [f"plant.model={path}"]
    return made


def prepared(observer: str, assignments: list[str]) -> cmg_mj.Experiment:
    """The push of `push_recovery`, judged after 10 s."""
    return cmg_mj.prepare(cmg_mj.load_scenario("push_recovery", ["duration_s=10", *assignments], observer=observer))


def distance(experiment: cmg_mj.Experiment) -> float:
    """The least distance of the loop's transfer from -1, with the observer in the loop; NaN if it is not stable."""
    loop = experiment.linear_closed_loop()
    if np.abs(loop.poles()).max() >= 1.0:
        return float("nan")
    z = np.exp(2j * np.pi * np.geomspace(0.05, 99.0, 2000) * experiment.law.dt)
    return 1.0 / float(np.abs(1.0 + loop["u_rad_s", "gimbal_rate_noise_rad_s"](z)).max())


def pushed(experiment: cmg_mj.Experiment, worlds: int) -> list[str]:
    """Return how many worlds stood, and their mean RMS of the tilt and peak of the gimbals."""
    result = experiment.run_many(worlds, keep_trajectory=False)
    figures = [result.mean(key) for key in ("tilt_rms_deg", "gimbal_peak_deg")]
    shown = ["-" if figure is None else f"{figure:.{digits}f}" for figure, digits in zip(figures, (2, 0), strict=True)]
    return [f"{result.stood.sum()} of {worlds}", *shown]


def main() -> None:
    """Print both tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--worlds", type=int, default=10)
    worlds = parser.parse_args().worlds
    with tempfile.TemporaryDirectory() as place:
        changed = rigs(Path(place))
        gains_rows, observer_rows, scale_rows = [], [], []
        for rig, assignments in changed.items():
            model = prepared("gyro_free", assignments).plant.reduced
            for name, choice in GAINS.items():
                experiment = prepared("gyro_free", [*assignments, *choice])
                law = experiment.law
                assert isinstance(law, StateFeedback)
                loop = judge_gains(experiment.design).loop
                margins = [f"{loop.slowest:.2f}", f"{loop.damping:.2f}", f"{distance(experiment):.2f}"]
                gains = ", ".join(f"{gain:.3g}" for gain in law.gains)
                gains_rows.append([rig, name, gains, *margins, *pushed(experiment, worlds)])
            tau, inertia = scales_of(model)
            authority = model.J_d * model.omega_d / model.J1
            scale_rows.append([rig, f"{tau:.2f}", f"{inertia:.2f}", f"{authority:.2f}"])
            for name in ("default", "scaled"):
                values = scaled_parameters("ltv", model) if name == "scaled" else {}
                given = [f"observer.{field}={list(value)}" for field, value in values.items()]  # type: ignore[arg-type]
                experiment = prepared("ltv", [*assignments, "controller.gains=scaled", *given])
                observer_rows.append([rig, name, f"{distance(experiment):.2f}", *pushed(experiment, worlds)])
    print(
        tabulate(scale_rows, ["rig", "tau", "inertia", "authority [1/s]"], "github", disable_numparse=True), end="\n\n"
    )
    figures = ["stood", "tilt RMS [deg]", "gimbal peak [deg]"]
    head = ["rig", "gains", "K_e", "slowest pole [1/s]", "least damping", "distance from -1", *figures]
    print(tabulate(gains_rows, head, "github", disable_numparse=True), end="\n\n")
    head = ["rig", "parameters of `ltv`", "distance from -1", *figures]
    print(tabulate(observer_rows, head, "github", disable_numparse=True))


if __name__ == "__main__":
    main()
