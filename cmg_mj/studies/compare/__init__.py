"""Compares observers on the same plant, pushes and noise."""
