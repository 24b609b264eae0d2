"""Draws figures with matplotlib, which only this package imports, and only to draw."""
