"""Effects on a tick, one a file: what disturbs sensors, servos and the plant, and what the controller does besides."""
