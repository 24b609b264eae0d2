"""A log of your own replayed: observers on measured angles, judged against the gyro that was there too."""

from __future__ import annotations

from pathlib import Path

import cmg_mj

csv = Path(__file__).parent / "data" / "stepper_encoder_gyro.csv"
columns = {"time": "time_s", "tilt": "encoder_rad", "rate": "gyr_y_rad_s"}
log = cmg_mj.read_log(csv, cmg_mj.ReadOptions(columns, delay_s=0.012))  # the gyro comes that much late
replayed = cmg_mj.replay_log(log, ["linear", "super_twisting", "homogeneous"])

for name, figures in replayed.summaries.items():
    print(f"{name}: velocity RMS error {figures['velocity_rms_error_rad_s']:.4f} rad/s")
for name, why in replayed.left_out.items():
    print(f"{name} is left out: {why}")
