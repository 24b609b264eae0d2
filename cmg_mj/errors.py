"""The two ways a run ends that are not results, and how messages show names and values."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping, Sequence
from datetime import date, time
from typing import TypeAlias

TomlValue: TypeAlias = "bool | int | float | str | date | time | Sequence[TomlValue] | Mapping[str, TomlValue] | None"
"""A value that a TOML file can hold."""
LONGEST_SHOWN = 80  # characters of a value in a message


class InputError(ValueError):
    """The user's input is wrong. The message is one line: what, where, and what is allowed."""


class RunStopped(RuntimeError):
    """A run could not go on (an observer returned NaN, the plant diverged). What was recorded is kept."""


def nearest(name: str, allowed: Iterable[str], label: str = "allowed") -> str:
    """Say what there is, and the nearest name for a typo.

    Args:
        name: What the user wrote.
        allowed: The names that exist.
        label: What to call them.

    Returns:
        A clause for an error message.
    """
    names = sorted(allowed)
    folded = {known.casefold(): known for known in names}
    match = difflib.get_close_matches(name.casefold(), folded, n=1)
    listing = f"{label}: {', '.join(names) or 'none'}"
    return f"did you mean {folded[match[0]]!r}? {listing}" if match else listing


def raised(error: BaseException) -> str:
    """Describe what a user's code raised, `ValueError: too large`, even if its own message raises."""
    try:
        text = str(error)
    except Exception:
        text = "its message cannot be shown"
    return f"{type(error).__name__}: {text}" if text else type(error).__name__


def shown(value: TomlValue) -> str:
    """A value as the user wrote it in TOML, shortened; strings in Python's quotes, which TOML takes too."""
    if isinstance(value, bool):
        text = "true" if value else "false"
    elif isinstance(value, (list, tuple)):
        text = f"[{', '.join(shown(item) for item in value)}]"
    elif isinstance(value, dict):
        text = "{...}"
    else:
        text = repr(value) if isinstance(value, str) else str(value)
    return text if len(text) <= LONGEST_SHOWN else f"{text[:LONGEST_SHOWN]}..."
