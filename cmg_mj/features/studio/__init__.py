"""Runs a scenario in MuJoCo Studio: shown, pushed and changed while its controller runs.

- `session.py`: the plant, its controller, and the user's pushes and changes; independent of Studio
- `settings.py`: the settings that can be changed; independent of Studio
- `stepping.py`: the simulation's thread
- `panel.py`: the viewer's thread, and the messages between the threads
- `open.py`: all together, and the choice of a viewer

Nothing else imports mujoco.studio. Import these modules only to open a session.
"""
