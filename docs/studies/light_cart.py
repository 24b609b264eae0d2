"""Observers that stand on a cart that slides freely, and how light that may be: the tables of docs/mount_evidence.md.

python docs/studies/light_cart.py (about five minutes on a quiet core)
python docs/studies/light_cart.py --rubbing (what the cart slides on is not free of friction; about three minutes)
python docs/studies/light_cart.py --height (the tilt is taken about another point than the mass centre; a minute)

--carts 1,3 --worlds 2 make it shorter. The cart-pole has the sizes of dm_control's: a pole of 1 m and 0.1 kg; the cart
there has 1 kg. A pair of the papers' size is mounted on the pole with `--release slider`. Each cell has ten worlds of
20 s, from the tilt that `mount` starts with, sensors with their noise. No limit was tuned on the seed, 7. A cell is
the number of worlds that stand.
"""

import argparse
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

import mujoco

from cmg_mj import mount
from cmg_mj.core.tilt import PairTilt
from cmg_mj.features.mounting.limits import PushLimits, push_limits
from cmg_mj.features.mounting.write import write_scenario
from cmg_mj.results.tables import markdown_table
from cmg_mj.runs.experiment import Experiment, prepare
from tests.features.mounting.push_robots import cart_pole

WORLDS = 10
SECONDS = 20.0
CARTS_KG = (0.01, 0.1, 0.3, 1.0, 1.5, 2.0, 3.0, 10.0)
RUBBING = ((0.0, 1.0), (0.0, 10.0), (0.0, 30.0), (0.5, 0.0), (1.0, 0.0), (2.0, 0.0))
"""Dry friction [N] and damping [N s/m] of the slider."""
RATES = {
    "true rate": ("gyro_free", "truth"),
    "gyro": ("gyro_free", "fog"),
    "gyro_free": ("gyro_free", "observer"),
    "free_pivot": ("free_pivot", "observer"),
    "kalman": ("kalman", "observer"),
    "homogeneous": ("homogeneous", "observer"),
}
HEIGHTS_M = (-0.2, -0.1, 0.02, 0.03, 0.05)
"""So much above the mass centre lies the point that the tilt is taken about."""
PIVOT, CENTRE = "about the pivot", "about the mass centre"
LOOPS = [(about, name, "measured") for about in (PIVOT, CENTRE) for name in RATES]
LOOPS += [(PIVOT, name, "estimated") for name in ("gyro_free", "free_pivot", "kalman")]
RUBBED = [loop for loop in LOOPS if loop[0] == CENTRE]


def mounted(mass: float, friction: float = 0.0, damping: float = 5e-4) -> tuple[Experiment, PushLimits]:
    """The cart-pole with a pair, and its limits."""
    with tempfile.TemporaryDirectory() as folder:
        spec = mujoco.MjSpec.from_string(cart_pole(mass, friction, damping))
        model = mount(spec, "pole", axis="hinge", release=["slider"]).save(Path(folder) / "cart.xml")
        experiment = write_scenario(model, model, "gyro_free")
    return experiment, push_limits(experiment)


def standing(
    experiment: Experiment, limits: PushLimits, loop: tuple[str, str, str], worlds: int = WORLDS, off: float = 0.0
) -> str:
    """Count the worlds that stand, in a cell's words, if the tilt is taken about a point so much too high [m]."""
    about, name, angle_source = loop
    observer, feedback = RATES[name]
    settings = {
        "observer.kind": observer,
        "controller.feedback": feedback,
        "controller.angle_source": angle_source,
        "plant.pivot_slides": about == CENTRE,
        "plant.initial_tilt_deg": limits.start_tilt_deg,
        "duration_s": SECONDS,
        "seed": 7,
    }
    loop_experiment = experiment.with_settings(settings)
    if off:
        plant = loop_experiment.plant
        plant.axes = tuple(
            replace(axis, pair_tilt=PairTilt(*axis.pair_tilt.radii).about(axis.pair_tilt.height + off))
            for axis in plant.axes
        )
        loop_experiment = prepare(loop_experiment.scenario, plant)
    return str(int(loop_experiment.run_many(worlds, keep_trajectory=False).stood.sum()))


def figures(experiment: Experiment, limits: PushLimits) -> list[str]:
    """Inertia, pole, ceiling and y1 by the reduced model; the loop's poles with the true rate, linearised."""
    plant, poles = experiment.plant, limits.sliding_poles
    assert poles is not None
    model = plant.reduced
    c1, d = model.measured_tilt(0.0, plant.gravity)
    return [
        f"{model.gimbals * model.J1:.3g}",
        f"{limits.limit.pole:.3g}, {limits.pole:.3g}",
        f"{limits.limit_push_impulse:.2f}",
        f"{model.pivot_arm:.3g}",
        f"{c1:.3g} x1 + {d:.2g} u",
        f"{poles.about_pivot:.3g}",
        f"{poles.about_centre:.3g}",
    ]


def names_of(loops: list[tuple[str, str, str]]) -> list[str]:
    """Headings of loops."""
    return [f"{name}{', estimated angle' if angle == 'estimated' else ''}, {about}" for about, name, angle in loops]


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser()
    for part in ("--rubbing", "--height"):
        parser.add_argument(part, action="store_true")
    parser.add_argument("--carts", default=",".join(map(str, CARTS_KG)))
    parser.add_argument("--worlds", type=int, default=WORLDS)
    options = parser.parse_args()
    masses, worlds = [float(mass) for mass in options.carts.split(",")], options.worlds
    if options.rubbing:
        rows = []
        for friction, damping in RUBBING:
            cart = mounted(1.0, friction, damping)
            rows.append([f"{friction:g}", f"{damping:g}", *(standing(*cart, loop, worlds) for loop in RUBBED)])
            print(*rows[-1], sep=" | ", file=sys.stderr, flush=True)
        print(markdown_table(["dry friction [N]", "damping [N s/m]", *names_of(RUBBED)], rows, text_columns=1))
        return
    if options.height:
        loops, rows, cart = RUBBED[:4], [], mounted(1.0)
        for off in HEIGHTS_M:
            rows.append([f"{off:g}", *(standing(*cart, loop, worlds, off) for loop in loops)])
        print(markdown_table(["above the mass centre [m]", *names_of(loops)], rows, text_columns=1))
        return
    carts = {mass: mounted(mass) for mass in masses}
    names = ["cart [kg]", "inertia left [kg m^2]", "pole: reduced, simulated [1/s]", "ceiling [N m s]", "c [m]"]
    names += ["y1 about the pivot", "loop's pole about the pivot [1/s]", "about the mass centre"]
    print(
        markdown_table(names, [[f"{mass:g}", *figures(*cart)] for mass, cart in carts.items()], text_columns=1),
        flush=True,
    )
    rows = []
    for name, loop in zip(names_of(LOOPS), LOOPS, strict=True):
        rows.append([name, *(standing(*cart, loop, worlds) for cart in carts.values())])
        print(*rows[-1], sep=" | ", file=sys.stderr, flush=True)
    print(
        markdown_table(
            [f"worlds of {worlds} that stand; cart [kg]", *(f"{mass:g}" for mass in masses)], rows, text_columns=1
        )
    )


main()
