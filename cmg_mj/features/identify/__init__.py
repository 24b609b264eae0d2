"""A rig identified from one log: places and errors of its sensors, delays, noise, and its pendulum."""
