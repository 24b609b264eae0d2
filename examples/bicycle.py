"""A bicycle that stands still: a pair in its frame, about the line through what its wheels stand on."""

import tempfile
from pathlib import Path

import cmg_mj
from cmg_mj.features.mounting.write import write_scenario

ROBOT = Path(__file__).parent / "robots" / "bicycle.xml"

mounted = cmg_mj.mount(ROBOT, body="frame", axis="x", position=(0.0, 0.0, 0.3))
with tempfile.TemporaryDirectory() as folder:
    model = mounted.save(Path(folder) / "balanced.xml")
    standing = write_scenario(model, ROBOT, "gyro_free").with_settings({"push": [], "duration_s": 10.0})
for feedback in ("observer", "fog"):
    result = standing.with_settings({"controller.feedback": feedback}).run_many(5, keep_trajectory=False)
    tilt = result.mean("tilt_rms_deg")
    print(f"fed back by the {feedback}: {result.stood.sum()} of 5 stood, with a tilt of {tilt:.2f} deg (RMS)")
