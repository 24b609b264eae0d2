"""Classes that cannot be exported are refused in one line, with the place; a comparison finds wrong results."""

from __future__ import annotations

import inspect
from pathlib import Path

import pytest

from cmg_mj.codegen.export import export
from cmg_mj.errors import InputError
from tests.codegen.export import own
from tests.codegen.export.compiled import controller

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
        ("Uncopied", "cannot be copied: RuntimeError: there is only one of me"),
    ],
)
def test_what_would_not_be_the_same_in_c_is_refused(name: str, words: str, tmp_path: Path) -> None:
    assert words in refusal(name, tmp_path)


def refusal(name: str, folder: Path) -> str:
    """The complaint; and nothing is left."""
    with pytest.raises(InputError) as info:
        export(controller(f"tests.codegen.export.own:{name}"), folder / "export")
    complaint = str(info.value)
    assert "\n" not in complaint
    assert complaint.startswith(f"tests.codegen.export.own:{name} cannot be exported: ")
    assert not (folder / "export").exists()
    return complaint


@pytest.mark.parametrize("feedback", ["fog", "truth"])
def test_a_board_has_the_observer_alone(feedback: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"controller\.feedback"):
        export(controller("linear", f"controller.feedback={feedback}"), tmp_path)
