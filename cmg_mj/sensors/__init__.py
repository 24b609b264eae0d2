"""Turns the true motion into what a real rig's sensors show, and when: accelerometers, encoders, gyros."""
