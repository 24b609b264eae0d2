"""Compiles an MJCF model into a rig with its axes, sensors and reduced model; mounts pairs on robots."""
