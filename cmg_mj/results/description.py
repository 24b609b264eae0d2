"""Values as `--set` takes them, and labelled rows."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from cmg_mj.core.errors import TomlValue


def lines(title: str, rows: Iterable[tuple[str, str]]) -> str:
    """Join a title, and rows of a label and a text."""
    return "\n".join([title, *(f"  {label:10}  {text}" for label, text in rows)])


def assignments(values: Mapping[str, TomlValue]) -> str:
    """Parameters and their values, as `--set` takes them."""
    return "  ".join(f"{name}={number(value)}" for name, value in values.items())


def number(value: TomlValue) -> str:
    """Return a value as TOML writes it, to six digits."""
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(number(item) for item in value)}]"
    if isinstance(value, bool):
        return "true" if value else "false"
    return f"{value:.6g}" if isinstance(value, float) else str(value)
