"""Everything in this folder is about the papers' claims: `python -m pytest -m papers`."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from cmg_mj.papers.claim import Claim
from cmg_mj.papers.sentences import too_long


@pytest.fixture(autouse=True, scope="session")
def _short_sentences() -> Iterator[None]:
    """Every claim that a test makes, whatever its figures are, must be readable."""
    post_init = Claim.__post_init__

    def check_sentences(claim: Claim) -> None:
        post_init(claim)
        for text in (claim.statement, claim.result, claim.conditions, claim.otherwise):
            for sentence in too_long(text):
                raise AssertionError(f"{claim.place}: a sentence is too long: {sentence}")

    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(Claim, "__post_init__", check_sentences)
        yield
