"""A pair on a robot of Gymnasium's: the inverted pendulum, balanced by gyroscopes while its cart rolls as it likes.

python -m pip install ".[gymnasium]" brings the robot; any file of your own goes the same way.
"""

import tempfile
from pathlib import Path

import gymnasium

import cmg_mj
from cmg_mj.features.mounting.limits import push_limits
from cmg_mj.features.mounting.write import write_scenario

ROBOT = Path(gymnasium.__path__[0]) / "envs" / "mujoco" / "assets" / "inverted_pendulum.xml"

mounted = cmg_mj.mount(ROBOT, body="pole", axis="hinge", release=["slider"])
with tempfile.TemporaryDirectory() as folder:
    model = mounted.save(Path(folder) / "balanced.xml")
    can = push_limits(write_scenario(model, ROBOT, "gyro_free"))
    experiment = write_scenario(model, ROBOT, "gyro_free", can)
print(f"falls with {can.limit.pole:.2f} 1/s; any controller recovers at most {can.limit.tilt:.3f} rad")
for share in (0.6, 1.8):
    push = {"push.0.torque_n_m": share * can.push_margin.median_impulse / 0.1}
    stood = experiment.with_settings(push).run_many(5, keep_trajectory=False).stood.sum()
    print(f"pushed with {share} of E: {stood} of 5 stood")
