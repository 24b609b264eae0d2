"""A frame that bends."""
