"""Classes that cannot be exported are refused in one line, with the place; a comparison finds wrong results."""

from __future__ import annotations

import inspect
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, cast

import pytest

from cmg_mj.core.controller import Controller
from cmg_mj.core.errors import InputError
from cmg_mj.features.export import export, pipeline
from cmg_mj.laws import Law
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


@pytest.mark.parametrize("feedback", ["fog", "truth"])
def test_a_board_has_the_observer_alone(feedback: str, tmp_path: Path) -> None:
    with pytest.raises(
        InputError, match=rf"^controller\.feedback = '{feedback}': .* the observer's rate alone; set .*=observer$"
    ):
        export(controller("linear", f"controller.feedback={feedback}"), tmp_path)


class Dithering(Controller):
    """A controller with an option that the exporter has never heard of."""

    def __init__(self, *parts: Any, dither_rad_s: float = 0.0, **options: Any) -> None:
        self.dither_rad_s = dither_rad_s
        super().__init__(*parts, **options)


def dithering(**options: Any) -> Controller:
    plain = controller("linear")
    return Dithering(plain.observer, plain.law, plain.sensors, plain.plant, **options)


def test_an_option_that_c_does_not_have_is_refused_by_name(tmp_path: Path) -> None:
    with pytest.raises(
        InputError, match=r"^controller\.dither_rad_s = 0\.5: cannot .* set controller\.dither_rad_s=0\.0$"
    ):
        export(dithering(dither_rad_s=0.5), tmp_path / "export")
    assert not (tmp_path / "export").exists()
    export(dithering(seed=3, axis=1, open_loop_observers={"kalman": plain_kalman()}), tmp_path / "export")


class Silent(Controller):
    """A controller that keeps options under other names, or not at all."""

    def __init__(self, *parts: Any, dither_rad_s: float = 0.0, **options: Any) -> None:
        self._dither = dither_rad_s
        super().__init__(*parts, **options)


def test_an_option_that_is_no_attribute_is_refused(tmp_path: Path) -> None:
    plain = controller("linear")
    silent = Silent(plain.observer, plain.law, plain.sensors, plain.plant)
    with pytest.raises(
        InputError, match=r"^controller\.dither_rad_s: cannot be exported: Silent has no attribute 'dither_rad_s'$"
    ):
        export(silent, tmp_path / "export")


class Demanding(Controller):
    """A controller with options that have no default, or none that is a number."""

    def __init__(self, *parts: Any, dithers: bool = False, kind: str, **options: Any) -> None:
        self.dithers, self.kind = dithers, kind
        super().__init__(*parts, **options)


@pytest.mark.parametrize(
    ("dithers", "complaint"),
    [
        (True, "controller.dithers = true: cannot be exported: C has no such option; set controller.dithers=false"),
        (False, "controller.kind = 'sine': cannot be exported: C has no such option"),
    ],
)
def test_a_value_is_said_as_toml_and_a_default_where_there_is_one(dithers: bool, complaint: str) -> None:
    plain = controller("linear")
    demanding = Demanding(plain.observer, plain.law, plain.sensors, plain.plant, dithers=dithers, kind="sine")
    with pytest.raises(InputError) as info:
        pipeline.generate_code(demanding, "double")
    assert str(info.value) == complaint


def plain_kalman() -> Any:
    return controller("kalman").observer


@dataclass(frozen=True)
class WithADeadBand:
    """The fields of a law that has one more than C knows."""

    dt: float
    gains: tuple[float, float, float, float] = (35.0, 4.0, -1.0, 0.3)
    rate_limit: float = 4.7
    dead_band: float = 0.0
    notches_hz: list[float] = field(default_factory=list)


def test_a_field_of_the_law_that_c_does_not_have_is_refused_by_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pipeline, "StateFeedback", WithADeadBand)
    exported = controller("linear")
    exported.law = cast("Law", WithADeadBand(exported.law.dt, dead_band=0.05))
    with pytest.raises(InputError, match=r"^controller\.dead_band = 0\.05: cannot be exported"):
        export(exported, tmp_path / "export")
    exported.law = cast("Law", WithADeadBand(exported.law.dt, notches_hz=[7.0]))
    with pytest.raises(InputError, match=r"^controller\.notches_hz = \[7\.0\]: .*; set controller\.notches_hz=\[\]$"):
        export(exported, tmp_path / "export")
    exported.law = cast("Law", WithADeadBand(exported.law.dt))
    pipeline.refuse_unexported(exported)
