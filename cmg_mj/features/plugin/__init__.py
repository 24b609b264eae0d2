"""Generates an engine plugin of MuJoCo: sensors, observer and law as a shared library that a model names.

`c/` holds what all plugins have in common; a controller's own numbers are printed by `tables`, its observer and law by
`codegen.export`. Nothing here imports MuJoCo: the model is written by `plant.plugin_model`.
"""
