"""The rig's reduced model in python-control: poles, an initial response, and LQR gains beside those of Table 2."""

# pyright: reportArgumentType=false, reportAttributeAccessIssue=false
# (python-control has no types)

from __future__ import annotations

import control
import numpy as np

import cmg_mj
from cmg_mj.laws.state_feedback import TABLE_2_GAINS

model = cmg_mj.load_plant(model="scissored_pair.xml").reduced
linear, nonlinear = model.linear_system(), model.nonlinear_system()
print("poles of the open loop [1/s]:", np.round(np.sort(linear.poles().real), 3))

# Both models let go at 5 degrees, the gimbals still.
times = np.linspace(0.0, 0.4, 81)
start = [np.radians(5.0), 0.0, 0.0]
falls = {
    "linear": control.initial_response(linear, times, start).outputs[0],
    "nonlinear": control.input_output_response(nonlinear, times, np.zeros_like(times), start).outputs[0],
}
for name, tilt in falls.items():
    print(f"{name} model: {np.degrees(tilt[-1]):.2f} deg after {times[-1]} s")

# The law (8) acts on [x1, x2, x3, x_e]; A_e and B_e have the integrator.
gains = {"Table 2": np.array([TABLE_2_GAINS])}
for weight in (1.0, 100.0):
    cost = np.diag([weight, 1.0, 1.0, 0.1])
    gains[f"LQR, tilt weighted {weight:g}"] = control.lqr(model.A_e, model.B_e, cost, 1.0)[0]
for name, K in gains.items():
    poles = np.linalg.eigvals(model.A_e - model.B_e @ K)
    print(f"{name}: K_e = {np.round(K[0], 2)}, slowest pole {poles.real.max():.2f}, fastest {poles.real.min():.2f} 1/s")
