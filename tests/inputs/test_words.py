"""The words of a complaint, and the same checks in Python."""

from __future__ import annotations

import math
from typing import Any, Literal

import numpy as np
import pytest

from cmg_mj import InputError, parse_scenario, prepare
from cmg_mj.errors import TomlValue, nearest, shown
from cmg_mj.inputs.messages import expected


def test_the_nearest_name() -> None:
    assert nearest("Tua", ["tau", "k1"]) == "did you mean 'tau'? allowed: k1, tau"
    assert nearest("xyz", ["tau", "k1"], "there are") == "there are: k1, tau"
    assert nearest("xyz", []) == "allowed: none"


@pytest.mark.parametrize(
    ("annotation", "words"),
    [
        (float, "a number"),
        (int | None, "a whole number"),
        (bool, "true or false"),
        (tuple[float, float], "a list of 2 numbers"),
        (tuple[tuple[int, int], tuple[int, int], tuple[int, int]], "a list of 3 lists of 2 whole numbers"),
        (list[str] | Literal["all"], "a list of names in quotes or 'all'"),
        (Literal["a", "b"], "one of 'a', 'b'"),
    ],
)
def test_what_a_type_takes(annotation: Any, words: str) -> None:
    assert expected(annotation) == words


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (True, "true"),
        ("a", "'a'"),
        ([1, [2.5, False]], "[1, [2.5, false]]"),
        ({"a": 1}, "{...}"),
        (math.nan, "nan"),
        ("x" * 200, "'" + "x" * 79 + "..."),
    ],
)
def test_a_value_as_the_user_wrote_it(value: TomlValue, text: str) -> None:
    assert shown(value) == text


@pytest.mark.parametrize("value", [np.float64(3.0), np.float32(3.0), np.int64(3), 3])
def test_a_scenario_in_python_takes_numpys_numbers(value: Any) -> None:
    assert parse_scenario({"duration_s": value}).duration_s == 3.0
    with pytest.raises(
        InputError, match=r"^duration_s = -3(\.0)?: must be a number greater than 0 and at most 1e\+06$"
    ):
        parse_scenario({"duration_s": -value})


def test_a_scenario_in_python_is_checked_alike() -> None:
    with pytest.raises(InputError, match=r"^controller\.rate_hz = 300 Hz: not a whole number"):
        prepare(parse_scenario({"plant": {"timestep_s": 0.001}, "controller": {"rate_hz": 300.0}}))
    with pytest.raises(InputError, match=r"^here: seed = '1': must be a whole number"):
        parse_scenario({"seed": "1"}, "here")
