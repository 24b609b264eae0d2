"""The appendix of aranovskiy2020: the system is not partially linearisable via coordinate changes."""

from __future__ import annotations

from cmg_mj.papers import plvcc
from cmg_mj.papers.claim import Claim, OnShare


def claims(on_share: OnShare) -> list[Claim]:
    """Judge the proof, checked symbolically."""
    return [plvcc.claim("aranovskiy2020")]
