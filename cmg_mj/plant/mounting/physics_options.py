"""The physics that a mounted pair needs of a robot's file."""

from __future__ import annotations

import mujoco
import numpy as np

LARGEST_STEP_S = 0.005
"""A robot's file that asks for larger steps is given these: the gimbals' servos need them [s]."""
ITERATIONS, TOLERANCE = 100, 1e-8
"""Of the solver, MuJoCo's own: a file that is content with less lets held joints creep."""


def set_options(spec: mujoco.MjSpec) -> list[str]:
    """Fast flywheels need RK4, servos steps that they can follow; what was changed, in clauses."""
    notes = []
    option = spec.option
    gravity = np.asarray(option.gravity)
    down = [0.0, 0.0, -float(np.linalg.norm(gravity))]
    if gravity.tolist() != down and gravity[2] < 0.0 and np.linalg.norm(gravity[:2]) < 1e-3 * -gravity[2]:
        notes.append(f"its gravity of {' '.join(f'{part:g}' for part in gravity)} is now straight down")
        option.gravity = down
    if int(option.integrator) != int(mujoco.mjtIntegrator.mjINT_RK4):
        option.integrator = mujoco.mjtIntegrator.mjINT_RK4
        notes.append("its integrator is now RK4, which fast flywheels need")
    if int(option.solver) != int(mujoco.mjtSolver.mjSOL_NEWTON):
        option.solver = mujoco.mjtSolver.mjSOL_NEWTON
        notes.append("its solver is now Newton: another does not hold joints stiffly")
    option.iterations, option.tolerance = max(option.iterations, ITERATIONS), min(option.tolerance, TOLERANCE)
    if option.timestep > LARGEST_STEP_S:
        notes.append(f"its physics steps of {option.timestep * 1e3:g} ms are now {LARGEST_STEP_S * 1e3:g} ms")
        option.timestep = LARGEST_STEP_S
    return notes
