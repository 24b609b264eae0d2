"""Classes that cannot be exported are refused in one line, with the place; a comparison finds wrong results."""

from __future__ import annotations

import inspect
from pathlib import Path
from typing import Any

import pytest

from cmg_mj.core.controller import Controller
from cmg_mj.core.errors import InputError
from cmg_mj.features.export import export, generate_code
from tests.features.export import own
from tests.features.export.compiled import controller

VALUE, NUMBER = "a branch on a value", "a plain number is asked for"
TWICE, DIFFERENCE = "not twice the same", "traced, it is not what Python runs: on random signals x2_rad_s is off by"


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("Branches", VALUE),
        ("TakesTheLarger", VALUE),
        ("TakesMath", NUMBER),
        ("Rounds", NUMBER),
        ("Indexes", NUMBER),
        ("FillsAnArray", NUMBER),
        ("TakesModulo", "numpy.remainder"),
        ("TakesANorm", "numpy.norm"),
        ("IsComplex", "complex where a real number belongs"),
        ("Raises", "step(state, y, u) raised KeyError: 'floats only'"),
        ("Exits", "init(y) raised SystemExit: 3"),
    ],
)
def test_what_has_no_place_in_a_formula_is_named_with_its_place(name: str, words: str, tmp_path: Path) -> None:
    lines, first = inspect.getsourcelines(getattr(own, name))
    (line,) = [i for i, text in enumerate(lines, first) if text.rstrip().endswith("# here")]
    complaint = refusal(name, tmp_path)
    assert words in complaint
    assert f"own.py, line {line}: {lines[line - first].strip()})" in complaint


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("LooksAtTypes", DIFFERENCE),
        ("Counts", DIFFERENCE),
        ("DrawsLots", TWICE),
        ("Remembers", "remembers something outside of its state"),
        ("Grows", "made otherwise than the one of init"),
        ("HoldsADeque", "its state holds a deque"),
        ("HoldsItself", "deeper than 50 parts within parts, or holds itself"),
        ("HoldsTooMuch", "its state holds 1600 numbers; at most 1000 can be exported"),
        ("Blows", "cannot be compared on random signals: observer Blows returned"),
        (
            "BeginsAtInfinity",
            "its state holds inf (least) at sample 0, where the C stops: hold numbers that are finite",
        ),
        ("Uncopied", "cannot be copied: RuntimeError: there is only one of me"),
    ],
)
def test_what_would_not_be_the_same_in_c_is_refused(name: str, words: str, tmp_path: Path) -> None:
    assert words in refusal(name, tmp_path)


def refusal(name: str, folder: Path) -> str:
    """The complaint; and nothing is left."""
    with pytest.raises(InputError) as info:
        export(controller(f"tests.features.export.own:{name}"), folder / "export")
    complaint = str(info.value)
    assert "\n" not in complaint
    assert complaint.startswith(f"tests.features.export.own:{name} cannot be exported: ")
    assert not (folder / "export").exists()
    return complaint


class Derived(Controller):
    """What it does otherwise, C would not have."""


def test_a_controller_of_another_class_is_refused() -> None:
    plain = controller("linear")
    with pytest.raises(InputError, match=r"^Derived: "):
        generate_code(Derived(plain.observer, plain.law, plain.sensors, plain.plant), "double")


@pytest.mark.parametrize(("field", "value"), [("feedback", "fog"), ("feedback", "truth"), ("notch_hz", "20.0")])
def test_a_setting_that_c_does_not_have_is_refused_by_name(field: str, value: str) -> None:
    with pytest.raises(InputError, match=rf"^controller\.{field}\b.* set controller\.{field}="):
        generate_code(controller("linear", f"controller.{field}={value}"), "double")


class Hum:
    """A stage without C."""

    def __call__(self, u: Any) -> Any:
        return u


def test_a_stage_that_c_does_not_have_is_refused_by_name() -> None:
    plain = controller("linear")
    humming = Controller(plain.observer, plain.law, plain.sensors, plain.plant, commands=[Hum])
    with pytest.raises(InputError, match=r"^Hum: "):
        generate_code(humming, "double")
