"""Generates an engine plugin of MuJoCo: sensors, observer and law as a shared library that a model names.

`c/` holds what all plugins have in common; `recording` records a rig's sensors and decisions, and `tables` prints them
as C.
"""
