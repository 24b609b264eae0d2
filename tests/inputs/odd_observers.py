"""Observers that go wrong in ways nobody expects: pytest looks at what a test's own module has."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from typing import Any

from cmg_mj import Estimate, Measurement
from tests.inputs.test_users_observer import Mine


class Bang(BaseException):
    """No Exception."""


class Speechless(BaseException):
    def __str__(self) -> str:
        raise Bang


class BangsWhenMade(Mine):
    def __init__(self, dt: float, model: object) -> None:
        raise Bang("no licence")


class BangsBeforeItIsMade(Mine):
    def __new__(cls, *_: object, **__: object) -> Any:
        raise Bang("no room")


class IsCancelledAtFirst(Mine):
    def init(self, y: Measurement) -> Any:
        raise asyncio.CancelledError


class EndsAsAGenerator(Mine):
    def init(self, y: Measurement) -> Any:
        raise GeneratorExit


class StopsIterating(Mine):
    def step(self, state: Any, y: Measurement, u: Any) -> Any:
        raise StopIteration


class BreaksAPipe(Mine):
    def init(self, y: Measurement) -> Any:
        raise BrokenPipeError


class HasNoMemory(Mine):
    def init(self, y: Measurement) -> Any:
        raise MemoryError


class CallsItself(Mine):
    def init(self, y: Measurement) -> Any:
        return self.init(y)


class IsSpeechless(Mine):
    def init(self, y: Measurement) -> Any:
        raise Speechless


class SaysTooMuch(Mine):
    def init(self, y: Measurement) -> Any:
        raise ValueError("x" * 10_000_000)


class SaysTooManyWords(Mine):
    def init(self, y: Measurement) -> Any:
        raise ValueError("all of it " * 1_000_000)


class HasABrokenSignature(Mine):
    __signature__ = 3


class HasABrokenComparison(type):
    def __eq__(cls, other: object) -> bool:
        raise SystemExit(0)

    def __hash__(cls) -> int:
        return 1


class IsNotCompared(Mine, metaclass=HasABrokenComparison):
    pass


class ExitsAtAnyName(Mine):
    def __getattr__(self, name: str) -> Any:
        raise SystemExit(0)


class ExitsAtAnyNameOfTheClass(type):
    def __getattribute__(cls, name: str) -> Any:
        raise SystemExit(0)


class ShowsNothing(metaclass=ExitsAtAnyNameOfTheClass):
    pass


class BangsAtItsSignals(Mine):
    @property
    def extra_signals(self) -> Any:
        raise Bang("not yet")


class NamesTooMany(Mine):
    extra_signals = tuple(f"a{i}" for i in range(100_000))


class NamesTooLong(Mine):
    extra_signals = ("a" * 1_000_000,)


class NamesBadly(Mine):
    extra_signals = ("A" * 1_000_000,)


class GivesTheEstimateMore(Mine):
    extra_signals = ("mode",)

    def estimate(self, k: int, y: Measurement, rate: Any) -> Any:
        return Estimate(y.y1, rate, y.y2, 0.0)  # type: ignore[call-arg]


class DoesNotNameItsSignal(Mine):
    def estimate(self, k: int, y: Measurement, rate: Any) -> Any:
        return (*Estimate(y.y1, rate, y.y2), 0.0)


class Exits:
    """An estimate or a number of one that cannot be looked at."""

    def __len__(self) -> int:
        return 3

    def __iter__(self) -> Iterator[float]:
        raise SystemExit(0)

    def __array__(self, *_: object, **__: object) -> Any:
        raise SystemExit(0)

    def __repr__(self) -> str:
        raise SystemExit(0)


class ReturnsWhatExits(Mine):
    def step(self, state: Any, y: Measurement, u: Any) -> Any:
        return Exits()


class EstimatesWhatExits(Mine):
    def estimate(self, k: int, y: Measurement, rate: Any) -> Any:
        return Exits()


class EstimatesANumberThatExits(Mine):
    def estimate(self, k: int, y: Measurement, rate: Any) -> Any:
        return y.y1, Exits(), y.y2


class EstimatesWhatCannotBeShown(Mine):
    class Hidden:
        def __repr__(self) -> str:
            raise SystemExit(0)

    def estimate(self, k: int, y: Measurement, rate: Any) -> Any:
        return self.Hidden()


class EstimatesItself(Mine):
    def estimate(self, k: int, y: Measurement, rate: Any) -> Any:
        endless: list[Any] = []
        endless.append(endless)
        return endless


class EstimatesTooMuch(Mine):
    def estimate(self, k: int, y: Measurement, rate: Any) -> Any:
        return [0.0] * 100_000


class IsCancelledLater(Mine):
    def estimate(self, k: int, y: Measurement, rate: Any) -> Any:
        if k > 5:
            raise asyncio.CancelledError("later")
        return Estimate(y.y1, rate, y.y2)


class CannotBeCopied(Mine):
    def __deepcopy__(self, memo: object) -> Any:
        raise Bang("one of its kind")


class NeedsANumber(Mine):
    needs = 5


class NeedsTooMuch(Mine):
    needs = ("x" * 1_000_000,)


class Needs:
    def __get__(self, *_: object) -> Any:
        raise Bang("not told")


class DoesNotSayItsNeeds(Mine):
    needs = Needs()
