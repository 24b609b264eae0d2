"""A step beyond the papers. Not part of `reproduce all`: a hundred seeds a cell take about half an hour."""

from cmg_mj.papers.beyond.claims import SECTIONS

__all__ = ["SECTIONS"]
