"""Checks what users write: field types, limits of size, names, overrides, files; and words what is wrong."""
