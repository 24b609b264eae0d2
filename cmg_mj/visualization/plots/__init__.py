"""Draws figures with matplotlib, which only `run_plot.py` imports."""
