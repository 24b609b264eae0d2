"""Compares runs of two trees of this repository, to the last bit: `python .ci/golden.py OLD NEW [PATTERN]`.

Bits depend on the processor and on the versions of NumPy, SciPy and MuJoCo. No numbers are kept, therefore: both trees
run here, one after the other, under this interpreter. PATTERN takes the cases whose name contains it.
"""

import contextlib
import hashlib
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

OBSERVERS = (
    *("linear", "ltv", "homogeneous", "luenberger", "kalman", "gyro_free", "free_pivot", "finite_difference"),
    *("super_twisting", "linear_high_gain", "high_gain", "adaptive", "homogeneous_adaptive", "mems_fused"),
)
TRIM = {"controller.bias_trim_s": 1.0, "observer.kind": "adaptive"}
PART = "sensors.accelerometer."
STAGES = {
    "skew": {PART + "skew_s": 0.005},
    "vibration": {PART + "vibration_mg": 30.0},
    "wheel_harmonics": {PART + "wheel_harmonics_mg": [20.0, 5.0]},
    "mounting_errors": {
        PART + "scale_error": [0.02, -0.01],
        PART + "misalignment_deg": [0.5, -0.3],
        PART + "cross_axis": [0.01, -0.02],
    },
    "bias": {PART + "bias_mg": [3.0, -2.0]},
    "flicker": {PART + "bias_instability_ug": 80.0},
    "bandwidth": {PART + "bandwidth_hz": 44.0},
    "latency": {PART + "latency_s": 0.0033, "sensors.encoder.latency_s": 0.005, "sensors.fog.latency_s": 0.0021},
    "fog": {"controller.feedback": "fog"},
    "notch": {"controller.notch_hz": 15.0},
    "backlash": {"plant.gimbal_backlash_arcmin": 10.0},
    "trim": TRIM,
}
EVERY_STAGE = {name: value for stage in STAGES.values() for name, value in stage.items()} | {
    "controller.feedback": "observer"
}
WORLDS = {"worlds": 3}
UNROUNDED = {
    PART + "counts_per_g": 0.0,
    "sensors.encoder.counts_per_revolution": 0.0,
    "sensors.mems_gyro.counts_per_deg_s": 0.0,
}
"""Without counts nothing hides an error in the last bits: with them one of 1e-12 moves no column."""
MOVES = {
    "push": [{"start_s": 0.303, "duration_s": 0.0505, "torque_n_m": 1.0}, {"start_s": 0.32, "torque_n_m": -0.4}],
    "swing": [{"frequency_hz": 1.5, "amplitude_n_m": 0.2, "start_s": 0.2, "duration_s": 1.3}],
    "pivot": [
        {"kind": "sine", "acceleration_m_s2": 0.5, "frequency_hz": 2.0},
        {"kind": "step", "acceleration_m_s2": 0.2, "start_s": 1.0, "duration_s": 0.5, "direction": "vertical"},
        {"kind": "noise", "acceleration_m_s2": 0.3, "corner_hz": 5.0, "direction": "along"},
        {"kind": "noise", "acceleration_m_s2": 0.2, "corner_hz": 3.0, "start_s": 0.5},
    ],
}
TRACK_FILE = next(map(str, Path("tests").rglob("track.csv")), "track.csv")
TRACK = {"pivot": [{"kind": "track", "file": TRACK_FILE, "scale": 0.5}]}
PUSHED_AXES = [{"axis": axis, "start_s": 1.0, "torque_n_m": 1.0} for axis in ("roll", "pitch")]
PLANT_FIELDS = {
    "timestep_s": 0.001,
    "integrator": "implicitfast",
    "gimbal_armature_kg_m2": 1e-4,
    "gimbal_friction_n_m": 0.01,
    "gimbal_damping_n_m_s": 0.02,
    "servo_stiffness_n_m_rad": 30.0,
    "servo_damping_n_m_s_rad": 1.0,
    "accelerometer_inner_m": 0.05,
    "accelerometer_outer_m": 0.35,
    "accelerometer_inner_misplaced_mm": 2.0,
    "accelerometer_outer_misplaced_mm": -3.0,
    "tilt_friction_n_m": 0.01,
    "tilt_damping_n_m_s": 0.02,
    "flywheel_speed_rad_s": 300.0,
    "flywheel_imbalance_kg_m": 1e-6,
    "lock_thrust_bearing": True,
}
BEND = {"plant.bend_frequency_hz": 30.0, "plant.bend_damping_ratio": 0.02, "plant.bend_share": 0.1}
MOVED = {f"plant.bend_{name}": f"bend.{name}" for name in ("frequency_hz", "damping_ratio", "share", "beyond")}
"""Fields that have another name in the newer tree."""

CART = """
<mujoco model="cart">
  <worldbody>
    <body name="cart" pos="0 0 0.1">
      <joint name="slider" type="slide" axis="1 0 0"/>
      <geom type="box" size="0.1 0.05 0.03" mass="0.5"/>
      <body name="pole">
        <joint name="hinge" axis="0 1 0"/>
        <geom type="capsule" fromto="0 0 0 0 0 0.6" size="0.02" mass="2"/>
      </body>
    </body>
  </worldbody>
</mujoco>"""

LOG = "examples/data/stepper_encoder_gyro.csv"
LOG_COLUMNS = "time=time_s,tilt=encoder_rad,rate=gyr_y_rad_s"
COMMANDS = {
    "compare": "compare push_recovery --observers homogeneous,adaptive,gyro_free --worlds 3 --set duration_s=3",
    "compare two axes": "compare two_axes --observers homogeneous,gyro_free --worlds 2 --set duration_s=7",
    "sweep": "sweep push_recovery --vary plant.equilibrium_bias_deg=0,1 --vary push.0.torque_n_m=1,6 --worlds 2"
    " --observers linear,zero --set duration_s=3",
    "sweep of a design": "sweep push_recovery --vary plant.equilibrium_bias_deg=0:1 --sample 3 --worlds 2"
    " --set duration_s=3",
    "tune": "tune push_recovery --observer linear --parameters tau --worlds 2 --set duration_s=3",
    "replay": f"replay {LOG} --columns {LOG_COLUMNS} --observers linear_high_gain,finite_difference",
    "mount": "mount examples/robots/torso.xml --body torso --axis x --scale 1.21 --quick -o FOLDER/balanced.xml",
}
"""Name of a case -> command line, whose figures are compared."""
GONE = ("zero_phase", "residual_rad", "largest_tilt_acceleration_rad_s2", "velocity_rms_error_std_rad_s")
"""Figures that the newer tree leaves out (CHANGELOG)."""
OF_TIME = ("seconds", "cpu", "took", "elapsed", "path", "folder", "written")
"""Words in the names of figures that no two runs have alike."""


def cases() -> dict[str, tuple[str, dict, dict]]:
    """Name -> bundled scenario, its fields that are set otherwise, keyword arguments."""
    table: dict[str, tuple[str, dict, dict]] = {}

    def case(name: str, settings: dict, scenario: str = "push_recovery", **options: object) -> None:
        pushed = {"push": PUSHED_AXES} if scenario == "two_axes" and "duration_s" not in settings else {}
        table[name] = scenario, {"duration_s": 3.0, **pushed, **settings}, options

    for path in sorted(Path("scenarios").glob("*.toml")):
        case(f"scenario {path.stem}", {"duration_s": 8.0}, path.stem)
    for kind in OBSERVERS:
        case(f"observer {kind}", {"observer.kind": kind, "open_loop_observers": []})
    case("observers open loop", {"open_loop_observers": "all"})
    case("observers open loop, 3 worlds", {"open_loop_observers": "all"}, **WORLDS)
    case("20 worlds", {"duration_s": 4.0}, worlds=20)
    case("two axes, 20 worlds", {}, "two_axes", worlds=20)
    for name, settings in STAGES.items():
        case(f"stage {name}", settings)
        case(f"stage {name}, 3 worlds", settings, **WORLDS)
    case("every stage", EVERY_STAGE)
    case("every stage, 3 worlds", EVERY_STAGE, **WORLDS)
    case("every stage, two axes", EVERY_STAGE, "two_axes")
    case("every stage, two axes, 3 worlds", EVERY_STAGE, "two_axes", **WORLDS)
    case("two axes, turn not compensated", {"controller.compensate_turning": False}, "two_axes")
    case("two axes, locked", {"plant.locked_axes": ["roll"], "push": []}, "two_axes")
    case("feedback truth", {"controller.feedback": "truth"})
    case("feedback fog, two axes", {"controller.feedback": "fog"}, "two_axes")
    case("angles estimated", {"controller.angle_source": "estimated"})
    case("lqg", {"controller.kind": "lqg"})
    case("lqg, 3 worlds", {"controller.kind": "lqg"}, **WORLDS)
    for name, value in MOVES.items():
        case(name, {name: value})
        case(f"{name}, 3 worlds", {name: value}, **WORLDS)
    case("every move", MOVES)
    case("track", TRACK)
    for name, value in PLANT_FIELDS.items():
        case(f"plant.{name}", {f"plant.{name}": value})
    for beyond, share in (("sensors", 0.1), ("modules", 0.7), ("both", 0.8)):
        case(f"bend {beyond}", {**BEND, "plant.bend_share": share, "plant.bend_beyond": beyond})
    case("bend, 3 worlds", BEND, **WORLDS)
    slow = {PART + "rate_hz": 50.0, "sensors.encoder.rate_hz": 100.0, "sensors.fog.rate_hz": 40.0}
    case("slow sensors", slow)
    case("slow sensors, late, 3 worlds", {**slow, **STAGES["latency"]}, **WORLDS)
    case("control at 100 Hz", {"controller.rate_hz": 100.0, PART + "rate_hz": 500.0})
    case("callback", {}, driver="callback")
    case("callback, every stage", EVERY_STAGE, driver="callback")
    differing = {"equilibrium_bias_deg": [0.0, 0.5, -1.0], PART + "noise_density_ug_rthz": [0.0, 400.0, 900.0]}
    case("worlds that differ", {PART + "vibration_mg": 5.0}, vary=differing, **WORLDS)
    pushed = {"push.0.torque_n_m": [1.0, 2.0, 6.0], "plant.gimbal_backlash_arcmin": [0.0, 5.0, 20.0]}
    case("worlds that differ, one falls", {}, vary=pushed, **WORLDS)
    for name, (scenario, settings, options) in list(table.items()):
        if options.get("driver") != "callback":
            table[f"unrounded: {name}"] = scenario, {**settings, **UNROUNDED}, options
    walk = {"controller.compensate_turning": False, "gait.steps": 4, "duration_s": 9.0}
    case("walk, turn not compensated", walk, "walk")
    case("walk, turn not compensated, 3 worlds", walk, "walk", **WORLDS)
    tiles = {**walk, "gait.tiles_m": 0.002, "plant.equilibrium_bias_deg": 0.25}
    case("unrounded: walk, turn not compensated, tiles", {**tiles, **UNROUNDED}, "walk")
    case("unrounded: walk, turn not compensated, tiles, 3 worlds", {**tiles, **UNROUNDED}, "walk", **WORLDS)
    robots = {
        "torso": ("examples/robots/torso.xml", {"body": "torso", "axis": "x", "scale": 1.3}),
        "bicycle": ("examples/robots/bicycle.xml", {"body": "frame", "axis": "x", "position": (0.0, 0.0, 0.3)}),
        "cart": (CART, {"body": "pole", "axis": "hinge", "release": ["slider"]}),
    }
    for name, robot in robots.items():
        case(
            f"mounted {name}",
            {"duration_s": 8.0, "plant.initial_tilt_deg": 0.2, "plant.equilibrium_bias_deg": 0.0},
            mounted=robot,
        )
    case(
        "mounted cart, 3 worlds",
        {"plant.initial_tilt_deg": 0.2, "plant.equilibrium_bias_deg": 0.0},
        mounted=robots["cart"],
        **WORLDS,
    )
    return table


def figures(scenario: str, settings: dict, options: dict, folder: str) -> dict[str, object]:
    """Run one case in the tree that this process imports: hash by column, each world's summary and outcome."""
    import mujoco

    import cmg_mj

    worlds, vary = options.pop("worlds", None), options.pop("vary", None)
    loaded = cmg_mj.load_scenario(f"scenarios/{scenario}.toml")
    if mounted := options.pop("mounted", None):
        path, place = mounted
        if path.lstrip().startswith("<"):
            robot = cmg_mj.mount(mujoco.MjSpec.from_string(path), **place)
        else:
            robot = cmg_mj.mount(path, **place)
        model = str(robot.save(Path(folder) / f"{place['body']}.xml"))
        fields = {"plant": {"model": model}, "controller": {"gains": "scaled"}, "observer": {"kind": "gyro_free"}}
        loaded = cmg_mj.parse_scenario(fields)
    base = cmg_mj.prepare(loaded)
    try:
        experiment = base.with_settings(settings)
    except cmg_mj.InputError:
        experiment = base.with_settings({MOVED.get(field, field): value for field, value in settings.items()})
    result = experiment.run_many(worlds, None, vary) if worlds else experiment.run(**options)
    found: dict[str, object] = {}
    for column, values in result.trajectory.columns.items():
        values = result.trajectory.columns[column]
        found[f"column {column}"] = hashlib.sha256(values.tobytes()).hexdigest(), float(abs(values + 0.0).sum())
    for world, summary in enumerate(result.summaries):
        found |= {f"world {world}: {key}": repr(value) for key, value in summary.items()}
    found |= {f"world {world}: outcome": repr(outcome) for world, outcome in enumerate(result.outcomes)}
    return found


def printed(name: str, line: str, folder: str) -> dict[str, object]:
    """Run a command in the tree that this process imports: each of the numbers that it prints."""
    call = "from cmg_mj.cli import main; main()"
    arguments = [*line.replace("FOLDER", folder).split(), "--json"]
    if arguments[0] != "mount":
        arguments += ["--out", f"{folder}/{name}"]
    done = subprocess.run([sys.executable, "-c", call, *arguments], capture_output=True, text=True, check=False)
    if done.returncode:
        return {"refused": done.stderr}
    found: dict[str, object] = {}

    def collect(name: str, value: object) -> None:
        if isinstance(value, dict):
            for key, item in value.items():
                collect(f"{name}.{key}", item)
        elif isinstance(value, list):
            for i, item in enumerate(value):
                collect(f"{name}.{i}", item)
        elif isinstance(value, (int, float)) and not any(word in name for word in (*OF_TIME, *GONE)):
            found[name] = repr(value)

    collect("", json.loads(done.stdout))
    return found


def run_all(pattern: str) -> None:
    """Print a JSON line for each case."""
    with tempfile.TemporaryDirectory() as folder:
        for name, (scenario, settings, options) in cases().items():
            if pattern in name:
                with contextlib.redirect_stdout(sys.stderr):
                    try:
                        found = figures(scenario, settings, dict(options), folder)
                    except ValueError as error:
                        found = {"refused": str(error)}
                print(json.dumps([name, found]), flush=True)
        for name, line in COMMANDS.items():
            if pattern in name:
                print(json.dumps([name, printed(name, line, folder)]), flush=True)


def of_tree(tree: str, pattern: str) -> dict[str, dict[str, object]]:
    """Run the cases in a tree."""
    environment = {**os.environ, "PYTHONPATH": str(Path(tree).resolve())}
    command = [sys.executable, str(Path(__file__).resolve()), "--here", pattern]
    answer = subprocess.run(command, cwd=tree, env=environment, stdout=subprocess.PIPE, text=True, check=False)
    if answer.returncode:
        print(f"{tree}: stopped after {len(answer.stdout.splitlines())} cases")
    return dict(map(json.loads, answer.stdout.splitlines()))


def main() -> int:
    """Compare; 1 if anything differs."""
    old_tree, new_tree, *rest = sys.argv[1:]
    pattern = rest[0] if rest else ""
    old, new = of_tree(old_tree, pattern), of_tree(new_tree, pattern)
    different = 0
    for name in old | new:
        before, after = old.get(name, {}), new.get(name, {})
        wrong = [key for key in before | after if before.get(key) != after.get(key)]
        wrong += [key for key in before if key == "refused" and key not in wrong]
        different += bool(wrong)
        if wrong:
            print(f"{name}: {len(wrong)} of {len(before)} differ")
            for key in wrong[:3]:
                print(f"    {key}: {before.get(key)} -> {after.get(key)}")
    print(f"{len(old)} cases, {len(new)} in the newer tree, {different} differ")
    return int(bool(different or not old or old.keys() != new.keys()))


if __name__ == "__main__":
    if sys.argv[1:2] == ["--here"]:
        run_all(sys.argv[2])
    else:
        sys.exit(main())
