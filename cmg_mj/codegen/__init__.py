"""Generates C from a controller, and runs it on an emulated board."""
