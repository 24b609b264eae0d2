"""Shows runs: matplotlib plots, rerun recordings, MuJoCo Studio."""
