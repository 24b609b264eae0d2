"""A scenario in MuJoCo Studio, its controller running: looked at, pushed, switched and scrubbed through while it runs.

`live.py` is all of it but Studio: the rig, its controller, what a user changes. `memory.py` brings the controller back
to an earlier moment, `pushes.py` has the torques from outside, `seen.py` the rig with what is only seen, `choices.py`
what can be changed. The rest knows Studio: `said.py` what its two threads tell each other, `stepping.py` the
simulation's thread with `pace.py`, `panel.py` the viewer's, `viewers.py` which viewer there is (`probe.py` tries one),
`opened.py` all of it together. Nothing else imports mujoco.studio; what is in here is imported when it is used.
"""
