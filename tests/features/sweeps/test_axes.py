"""`--vary FIELD=...`: lists, ranges, and what is none."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from cmg_mj.core.errors import InputError
from cmg_mj.features.sweeps.study import VariedField, parse_axis


@pytest.mark.parametrize(
    ("variation", "values"),
    [
        ("0,0.5,1.0", (0, 0.5, 1.0)),
        ("-1.5:1.5:7", (-1.5, -1.0, -0.5, 0.0, 0.5, 1.0, 1.5)),
        ("0:0.3:4", (0.0, 0.1, 0.2, 0.3)),
        ("log:1:100:3", (1.0, 10.0, 100.0)),
        ("1:-1:3", (1.0, 0.0, -1.0)),
        ("[0,0],[5,0]", ([0, 0], [5, 0])),
        ("RK4,implicit", ("RK4", "implicit")),
        ("true,false", (True, False)),
        ([1.0, 2.0], (1.0, 2.0)),
    ],
)
def test_what_is_varied(variation: Any, values: tuple) -> None:
    assert parse_axis("a.b", variation, "--vary").values == values


def test_a_range_to_be_sampled() -> None:
    axis = parse_axis("a.b", "log:100:800", "--vary")
    assert axis.is_range
    assert axis.at(np.array([0.0, 1.0])) == [100.0, 800.0]
    assert axis.at(np.array([0.5])) == pytest.approx([np.sqrt(80_000.0)])
    assert parse_axis("a.b", axis.as_field(), "file") == axis


def test_of_a_list_each_value_has_an_equal_part_of_the_shares() -> None:
    axis = parse_axis("a.b", "RK4,implicit,Euler", "--vary")
    assert axis.at(np.array([0.0, 0.33, 0.34, 0.66, 0.67, 1.0])) == ["RK4", "RK4", *["implicit"] * 2, *["Euler"] * 2]


@pytest.mark.parametrize(
    ("variation", "complaint"),
    [
        ("", "no values"),
        ("1,,2", "is no list"),
        ("1:2:x", "is no range"),
        ("1:2:3:4", "is no range"),
        ("1:1:3", "an empty range"),
        ("2:1", "an empty range"),
        ("nan:1", "an empty range"),
        ("log:0:1:3", "needs ends above 0"),
        ("0:1:1", "1 values; a range has at least 2"),
        ("0:1:1000000", "at most 10000"),
        ("1,1", "1 is there twice"),
    ],
)
def test_what_is_no_list_and_no_range(variation: str, complaint: str) -> None:
    with pytest.raises(InputError, match=f"--vary a.b.*{complaint}"):
        parse_axis("a.b", variation, f"--vary a.b={variation}")


def test_no_field() -> None:
    with pytest.raises(InputError, match="write FIELD=VALUES"):
        parse_axis("", "1,2", "--vary 1,2")


def test_an_axis_of_values_says_them() -> None:
    assert VariedField("a", (1.0, 2.0)).as_field() == [1.0, 2.0]
