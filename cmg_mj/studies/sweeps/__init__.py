"""Sweeps: a scenario on many rigs, at many noises, with many observers, in chunks that survive being killed."""
