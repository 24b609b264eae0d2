"""Reads a scenario file, checks it, and holds it as one value."""
