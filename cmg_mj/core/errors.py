"""The two ways a run ends that are not results, and how messages show names and values."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Iterable, Mapping, Sequence
from datetime import date, time
from typing import TypeAlias

TomlValue: TypeAlias = "bool | int | float | str | date | time | Sequence[TomlValue] | Mapping[str, TomlValue] | None"
"""A value that a TOML file can hold."""
MAX_SHOWN = 80  # characters of a value in a message
MAX_LIST = 800  # characters of a list of names
MAX_RAISED = 300  # characters of what a user's code says


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
    match = difflib.get_close_matches(name[:MAX_SHOWN].casefold(), folded, n=1)
    listing = f"{label}: {listed(names) or 'none'}"
    return f"did you mean {shown(folded[match[0]])}? {listing}" if match else listing


def listed(names: Sequence[str]) -> str:
    """Names with commas between, each shortened; of very many the first, and how many more there are."""
    parts: list[str] = []
    room = MAX_LIST
    for name in names:
        parts.append(shortened(name))
        room -= len(parts[-1]) + 2
        if room < 0 and len(parts) < len(names):
            return f"{', '.join(parts)} and {len(names) - len(parts):,} more"
    return ", ".join(parts)


def counted(n: int, noun: str) -> str:
    """Put a number before a noun: `1 world`, `2 worlds`."""
    return f"{n:,} {noun}{'' if n == 1 else 's'}"


def raised(error: BaseException) -> str:
    """Describe what a user's code raised, `ValueError: too large`, shortened, even if its own message raises."""
    text = shortened(_safely(lambda: str(error), "its message cannot be shown"), MAX_RAISED)
    name = shortened(type(error).__name__, MAX_SHOWN)
    return f"{name}: {text}" if text else name


def shortened(text: str, longest: int = MAX_SHOWN) -> str:
    """Return the beginning of a text, with `...` where more follows."""
    return text if len(text) <= longest else f"{text[:longest]}..."


def _safely(make: Callable[[], str], otherwise: str) -> str:
    """Return a user's object as text; its own methods may raise anything."""
    try:
        return make()
    except KeyboardInterrupt:
        raise
    except BaseException:
        return otherwise


def shown(value: TomlValue) -> str:
    """Return a value as the user wrote it in TOML, shortened; strings in Python's quotes, which TOML takes too."""
    return _safely(lambda: shortened(_as_toml(value)), "what cannot be shown")


def _as_toml(value: TomlValue) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(_as_toml(item) for item in value)}]"
    if isinstance(value, dict):
        return "{...}"
    return repr(value) if isinstance(value, str) else str(value)
