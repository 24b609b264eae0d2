"""Runs a scenario in MuJoCo Studio: shown, pushed, changed and scrubbed in time while its controller runs.

Independent of Studio:

- `live.py`: the plant, its controller, and the user's changes
- `history.py`: the controller at an earlier moment
- `user_push.py`: torques from outside
- `drawn_plant.py`: the model with its visual geoms
- `settings.py`: the settings that can be changed

Dependent on Studio:

- `messages.py`: messages between the simulation's thread and the viewer's
- `stepping.py`: the simulation's thread
- `panel.py`: the viewer's thread
- `viewers.py`, `probe.py`: choice and trial of a viewer
- `open.py`: all together

Nothing else imports mujoco.studio. Import these modules only to open a session.
"""
