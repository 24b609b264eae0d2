"""Computes the largest push that a rig, and one controller on it, can recover from."""
