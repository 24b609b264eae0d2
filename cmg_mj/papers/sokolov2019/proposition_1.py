"""Section IV: Proposition 1, whose proof is not printed."""

from __future__ import annotations

from cmg_mj.papers import plvcc
from cmg_mj.papers.claim import Claim, OnShare


def claims(on_share: OnShare) -> list[Claim]:
    """Judge Proposition 1."""
    return [plvcc.claim("sokolov2019")]
