"""Observers by name and by dotted path, and what a wrong name or parameter is told."""

from __future__ import annotations

import pytest

from cmg_mj.core.errors import InputError
from cmg_mj.core.reduced_model import ReducedModel
from cmg_mj.observers import Estimate, Measurement
from cmg_mj.runs.experiment import prepare
from cmg_mj.scenario.loading import parse_scenario
from tests.observers.reference import observer
from tests.recorded import recorded


class Mine:
    """A user's observer: a plain class, no base class, its own parameter."""

    def __init__(self, dt: float, model: ReducedModel, gain: float = 3.0) -> None:
        if gain > 100.0:
            raise RuntimeError("gain is far too large")
        self.dt, self.model, self.gain = dt, model, gain

    def init(self, y: Measurement) -> tuple[float]:
        return (y.y1,)

    def step(self, state: tuple[float], y: Measurement, u: float) -> tuple[tuple[float], Estimate]:
        return (y.y1,), Estimate(y.y1, self.gain * (y.y1 - state[0]) / self.dt, y.y2)


class Open:
    """A user's observer whose methods are none."""

    init = step = None  # not callable


USER_OBSERVER = f"{__name__}:Mine"


def test_a_users_class_in_a_scenario() -> None:
    """A difference three times too large in the loop: the parameter arrives, and the run is this observer's."""
    scenario = {"duration_s": 0.1, "observer": {"kind": USER_OBSERVER, "gain": 1.5}}
    trajectory = recorded(prepare(parse_scenario(scenario)).run())
    y1, rate = trajectory["y1_rad"], trajectory[f"estimate/{USER_OBSERVER}/x2_rad_s"]
    assert rate[0] == 0.0
    assert rate[1:] == pytest.approx(1.5 * 200.0 * (y1[1:] - y1[:-1]), rel=1e-9)


@pytest.mark.parametrize(
    ("kind", "parameters", "message"),
    [
        ("linear", {"tua": 0.1}, r"observer\.tua: no such field of linear; did you mean 'tau'\?"),
        (USER_OBSERVER, {"gian": 1.0}, r"observer\.gian: no such field of .*Mine; did you mean 'gain'\?"),
        (USER_OBSERVER, {"gain": 200.0}, r"observer .*Mine: RuntimeError: gain is far too large"),
        (f"{__name__}:Open", {}, r"must be a class with the methods init\(y\) and step\(state, y, u\)"),
    ],
)
def test_what_is_wrong_with_a_class_is_named_in_one_line(kind: str, parameters: dict, message: str) -> None:
    """tests/inputs/ has wrong names and wrong parameters of the bench's own."""
    with pytest.raises(InputError, match=message) as info:
        observer(kind, **parameters)
    assert "\n" not in str(info.value)
