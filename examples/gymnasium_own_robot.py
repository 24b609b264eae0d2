"""A robot of your own as a Gymnasium environment, which its plugin balances: nothing of cmg_mj is imported.

cmg-mj mount robot.xml --body BODY --plugin; python gymnasium_own_robot.py balanced_plugin/balanced.xml BODY
"""

import sys
from pathlib import Path

import mujoco
import numpy as np
from gymnasium.envs.mujoco import MujocoEnv
from gymnasium.spaces import Box


class Robot(MujocoEnv):
    """The reward is 1 a step; an episode ends at a tilt of 0.2 rad."""

    def step(self, action):
        """Take an action, whose part for the pair the plugin ignores."""
        self.do_simulation(action, self.frame_skip)
        fell = self.data.body(sys.argv[2]).xmat[8] < np.cos(0.2)
        return np.append(self.data.qpos, self.data.qvel), np.float64(1.0), bool(fell), False, {}

    def reset_model(self):
        """Stand where the robot balances; noise in a free joint's height would lift it off the floor."""
        noise = self.np_random.uniform(-0.0002, 0.0002, model.nq)
        noise[model.jnt_qposadr[model.jnt_type == mujoco.mjtJoint.mjJNT_FREE] + 2] = 0.0
        self.set_state(start.qpos + noise, start.qvel)
        self.data.act[:] = start.act
        return np.append(self.data.qpos, self.data.qvel)


for library in Path(sys.argv[1]).parent.glob("libcmg_mj_*.so"):
    mujoco.mj_loadPluginLibrary(str(library.resolve()))
model = mujoco.MjModel.from_xml_path(path := str(Path(sys.argv[1]).resolve()))
start, frame_skip = model.key("equilibrium"), round(0.02 / model.opt.timestep)
env = Robot(path, frame_skip, Box(-np.inf, np.inf, (model.nq + model.nv,)))
outcomes = [env.reset(seed=seed) and any(env.step(start.ctrl)[2] for _ in range(500)) for seed in range(10)]
print(f"{outcomes.count(False)} of 10 stand 500 steps of {env.dt:g} s")
