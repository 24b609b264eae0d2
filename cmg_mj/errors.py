"""The two ways a run ends that are not results."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


class InputError(ValueError):
    """The user's input is wrong. The message is one line: what, where, and what is allowed."""


class RunStopped(RuntimeError):
    """A run could not go on (an observer returned NaN, the plant diverged). What was recorded is kept."""


def nearest(name: str, allowed: Iterable[str]) -> str:
    """Say what is allowed, and the nearest name for a typo.

    Args:
        name: What the user wrote.
        allowed: The names that exist.

    Returns:
        A clause for an error message.
    """
    names = sorted(allowed)
    match = difflib.get_close_matches(name, names, n=1)
    listing = "allowed: " + ", ".join(names)
    return f"did you mean {match[0]!r}? {listing}" if match else listing
