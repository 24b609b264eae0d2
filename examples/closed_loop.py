"""The closed loop with its observer in it, as a linear system: poles, margin, and the tilt after 1 N m for 0.1 s.

An argument: a file to draw a Bode plot to.
"""

# pyright: reportArgumentType=false, reportAttributeAccessIssue=false, reportOptionalSubscript=false
# (python-control has no types)

from __future__ import annotations

import sys

import control
import matplotlib.pyplot as plt
import numpy as np

import cmg_mj

loops = {}
for kind in ("linear", "ltv", "adaptive", "gyro_free"):
    experiment = cmg_mj.prepare(cmg_mj.load_scenario("push_recovery", observer=kind))
    loop = loops[kind] = experiment.linear_closed_loop()
    # Gimbals that turn by more than commanded show the loop transfer L at the gimbals: 1/(1 + L) = 1 + H.
    z = np.exp(2j * np.pi * np.linspace(0.1, 99.0, 2000) * loop.dt)
    H = loop["u_rad_s", "gimbal_rate_noise_rad_s"](z)
    times = np.arange(400) * loop.dt
    push = control.forced_response(loop["x1_rad", "push_n_m"], times, np.where(times < 0.1, 1.0, 0.0))
    pole, distance = np.abs(loop.poles()).max(), 1.0 / np.abs(1.0 + H).max()
    tilt = np.degrees(np.abs(push.outputs).max())
    print(f"{kind}: largest pole {pole:.4f}, comes within {distance:.2f} of -1, tilts by {tilt:.2f} deg")

if len(sys.argv) > 1:
    paths = [loop["estimated_x2_rad_s", "push_n_m"] for loop in loops.values()]
    control.bode_plot(paths, np.geomspace(0.5, 600.0, 400), label=list(loops))
    plt.gcf().savefig(sys.argv[1])
