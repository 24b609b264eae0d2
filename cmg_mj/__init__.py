"""cmg_mj."""
