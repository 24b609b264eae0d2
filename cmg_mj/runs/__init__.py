"""Runs a prepared scenario: one world or many, by the runner, a callback or a Gymnasium environment."""
