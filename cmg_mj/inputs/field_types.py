"""Types of the fields that users set, and how strictly they are taken."""

from __future__ import annotations

from typing import Annotated

from pydantic import ConfigDict, Field

Positive = Annotated[float, Field(gt=0.0)]
NonNegative = Annotated[float, Field(ge=0.0)]

LONGEST_S = 1e6
"""No time in a scenario is longer: eleven days [s]."""
Duration = Annotated[float, Field(gt=0.0, le=LONGEST_S)]
"""A time that passes [s]."""
Instant = Annotated[float, Field(ge=0.0, le=LONGEST_S)]
"""A time after the start, or a delay [s]."""
Rate = Annotated[float, Field(ge=0.1, le=1e6)]
"""Ticks or samples a second [Hz]: no slower than a rig falls, no faster than the smallest physics step."""

Line = Annotated[str, Field(max_length=200, pattern=r"^[^\x00-\x1f\x7f-\x9f]*$")]
"""A line of text, which terminals, plots and recordings show."""

STRICT = ConfigDict(extra="forbid", arbitrary_types_allowed=True, allow_inf_nan=False)
"""For pydantic's dataclasses: an unknown field, infinity and NaN are refused."""
