"""The plant linearised, its closed loop sampled, and the verdict on it."""
