"""Runs many experiments and compares them: comparisons, sweeps, tuning, push limits, benchmarks."""
