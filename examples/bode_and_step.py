"""A Bode plot of the loop and its answer to a steady torque, with python-control. An argument: a file to draw to."""

# pyright: reportArgumentType=false, reportAttributeAccessIssue=false

import sys

import control
import matplotlib.pyplot as plt
import numpy as np

import cmg_mj

model = cmg_mj.load_plant(model="scissored_pair.xml").reduced
K = np.array([cmg_mj.StateFeedback(dt=0.005).gains])

# The loop, cut at the command. What is held for a control period comes half of it late.
loop = control.ss(model.A_e, model.B_e, K, 0.0)
delay = control.tf(*control.pade(0.5 * 0.005, 3))
for name, system in (("without delay", loop), ("with 2.5 ms", loop * delay)):
    _, phase, _, _, crossing, _ = control.stability_margins(system)
    print(f"{name}: phase margin {phase:.1f} deg at {crossing:.1f} rad/s")
# A torque of 0.1 N m about the tilt axis, as wind would be: the integrator leaves none of it in the gimbals' angle.
torque = np.array([[0.0], [0.1 / (model.gimbals * model.J1)], [0.0], [0.0]])
closed = control.ss(model.A_e - model.B_e @ K, torque, np.eye(4)[[0, 2]], 0.0)
answer = control.step_response(closed, np.linspace(0.0, 30.0, 3001))
tilt, gimbal = np.degrees(answer.outputs[:, 0])
print(f"tilt: at most {np.abs(tilt).max():.2f} deg, {tilt[-1]:+.2f} deg in the end; gimbals {gimbal[-1]:+.2f} deg")

if len(sys.argv) > 1:
    figure, axes = plt.subplots(3, 1, figsize=(7, 9), layout="constrained")
    control.bode_plot(loop * delay, np.logspace(-1, 2, 400), ax=np.array([[axes[0]], [axes[1]]]), title="")
    axes[0].set(title="Open loop, cut at the command, with 2.5 ms of delay", ylabel="gain [-]")
    axes[1].set(xlabel="frequency [rad/s]", ylabel="phase [deg]")
    axes[2].plot(answer.time, tilt, answer.time, gimbal)
    axes[2].legend(["tilt", "gimbals"])
    axes[2].set(title="Closed loop: answer to a torque of 0.1 N m", xlabel="time [s]", ylabel="angle [deg]")
    figure.savefig(sys.argv[1])
