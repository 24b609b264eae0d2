"""Turns ticks into metrics, trajectories and summaries, and writes them to a run's folder."""
