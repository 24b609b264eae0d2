"""Features that can be removed, a folder each."""
