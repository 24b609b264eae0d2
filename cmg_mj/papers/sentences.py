"""The sentences of a claim's words: how long they are, and which have been said before."""

from __future__ import annotations

import re
from collections.abc import Iterator

LONGEST = 40
"""Words that a sentence may have: whatever has a letter or a digit in it, between spaces."""

_END = re.compile(r"(?<=[.!?])(?<!\bFig\.)(?<!\be\.g\.)(?<!\bi\.e\.)\s+")


def split_sentences(text: str) -> list[str]:
    """Split a text into its sentences."""
    return [part for part in _END.split(text.strip()) if part]


def count_words(sentence: str) -> int:
    """Count the words of a sentence."""
    return sum(any(letter.isalnum() for letter in part) for part in sentence.split())


def too_long(text: str) -> Iterator[str]:
    """Find the sentences of a text that have more words than `LONGEST`."""
    return (sentence for sentence in split_sentences(text) if count_words(sentence) > LONGEST)


class SentenceLog:
    """Says a sentence once; where it stood before is said instead of saying it again."""

    def __init__(self) -> None:
        self._places: dict[str, str] = {}

    def omit_repeats(self, text: str, place: str) -> str:
        """Return a text without the sentences that earlier places had, which are named first.

        Args:
            text: Whole sentences.
            place: Place of their claim.

        Returns:
            The rest, after `As at Fig. 2.` where a sentence is omitted.
        """
        new, before = [], []
        for sentence in split_sentences(text):
            first_place = self._places.setdefault(sentence, place)
            if first_place == place:
                new.append(sentence)
            elif first_place not in before:
                before.append(first_place)
        reference = [f"As at {' and '.join(before)}."] if before else []
        return " ".join([*reference, *new])
