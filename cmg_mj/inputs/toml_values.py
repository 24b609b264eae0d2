"""The values that a TOML file can hold."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

TomlValue = bool | int | float | str | None | Sequence["TomlValue"] | Mapping[str, "TomlValue"]
"""A number, a text, a list or a section; None where there is no such field."""
