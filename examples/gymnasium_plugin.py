"""A robot in stock Gymnasium under random actions: a plugin balances it, and nothing of cmg_mj is imported.

cmg-mj mount inverted_pendulum.xml --body pole --axis hinge --release slider --plugin
python gymnasium_plugin.py InvertedPendulum-v5 balanced_plugin/balanced.xml [NOISE_OF_RESET SHARE_OF_ACTIONS]
"""

import sys
from pathlib import Path

import gymnasium
import mujoco
import numpy as np

FREED = {"healthy_z_range": (-np.inf, np.inf), "healthy_angle_range": (0.7, np.inf)}  # qpos[2] is the height
KEYWORDS = {"Hopper-v5": {**FREED, "healthy_state_range": (-np.inf, np.inf)}, "Walker2d-v5": FREED}  # 314 rad/s
if len(sys.argv) not in (3, 5):
    sys.exit(__doc__)
name, path = sys.argv[1], Path(sys.argv[2]).resolve()
noise, share = map(float, sys.argv[3:] or (0.001, 0.01))
for library in path.parent.glob("libcmg_mj_*.so"):
    mujoco.mj_loadPluginLibrary(str(library))
skip = round(gymnasium.make(name).get_wrapper_attr("dt") / mujoco.MjModel.from_xml_path(str(path)).opt.timestep)
keywords = {"xml_file": str(path), "frame_skip": skip, "reset_noise_scale": noise, **KEYWORDS.get(name, {})}
env = gymnasium.make(name, disable_env_checker=True, **keywords)
model, data = map(env.get_wrapper_attr, ("model", "data"))
start, falls = model.key("equilibrium"), []
env.set_wrapper_attr("init_qpos", start.qpos)  # where the robot stands, and the flywheels turn
env.set_wrapper_attr("init_qvel", start.qvel)
own = np.array([not model.actuator(i).name.endswith(("/gimbal_servo", "/flywheel_motor")) for i in range(model.nu)])
for seed in range(10):
    env.reset(seed=seed)
    env.action_space.seed(seed)
    data.act[:] = start.act
    data.plugin_state[model.plugin_stateadr + 1] = seed  # the world, before the first step: a noise for each episode
    for step in range(1, 501):
        if env.step(start.ctrl + share * own * env.action_space.sample())[2] or data.site("fog").xmat[8] < np.cos(0.2):
            falls.append(step)
            break
print(f"{name}: {10 - len(falls)} of 10 stand 500 steps; fallen after {falls}")
