"""The rig as a Gymnasium environment: an agent that does nothing, and the bench's own observer and law as one."""

from __future__ import annotations

import gymnasium
import numpy as np

import cmg_mj
import cmg_mj.features.gymnasium

env = gymnasium.make(cmg_mj.features.gymnasium.ID, scenario="push_recovery", settings=["duration_s=4.0"])
rig = cmg_mj.load_plant(model="scissored_pair.xml")
law = cmg_mj.StateFeedback(dt=0.005)
observer = cmg_mj.make_observer("homogeneous", law.dt, rig.reduced)

for agent in ("nothing", "observer and law"):
    observed, info = env.reset(seed=3)
    y = cmg_mj.Measurement(observed[0], observed[1], 0.0)
    state, estimate, memory, u = observer.init(y), (y.y1, 0.0, y.y2), law.init(y), 0.0
    total, fell, ended = 0.0, False, False
    while not (fell or ended):
        if agent == "observer and law":
            memory, u = law.step(memory, y, cmg_mj.FeedbackState(y.y1, estimate[1], y.y2), u)
        observed, reward, fell, ended, info = env.step(np.array([u / law.rate_limit]))
        y = cmg_mj.Measurement(observed[0], observed[1], 0.0)
        state, estimate = observer.step(state, y, u)
        total += float(reward)
    end = "fell" if fell else "stood"
    print(f"{agent}: {end} until {info['time_s']:.2f} s, sum of rewards {total:.2f}")
env.close()
