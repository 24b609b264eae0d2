"""Runs one control tick: samples, tilt, observer, law, command; NumPy alone."""
