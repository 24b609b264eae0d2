"""A pivot that moves."""
