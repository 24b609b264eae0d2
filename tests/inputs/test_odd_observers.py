"""Users' observers that raise what is no Exception, hide what they are, or say too much: one line, no success."""

from __future__ import annotations

from pathlib import Path

import pytest

from cmg_mj.errors import LONGEST_RAISED, listed, raised, shown
from tests.command import cmg_mj
from tests.inputs import odd_observers
from tests.inputs.complaints import assert_in_order, table


def kind(name: str) -> str:
    return f"tests.inputs.odd_observers:{name}"


RETURN = "step(state, y, u) must return (state, (x1, x2, x3"


@table(
    ("made", "BangsWhenMade", "BangsWhenMade: Bang: no licence"),
    ("not even made", "BangsBeforeItIsMade", "BangsBeforeItIsMade: Bang: no room"),
    ("cancelled", "IsCancelledAtFirst", "IsCancelledAtFirst': init(y) raised CancelledError"),
    ("a generator's end", "EndsAsAGenerator", "init(y) raised GeneratorExit"),
    ("an iteration's end", "StopsIterating", "step(state, y, u) raised StopIteration"),
    ("a broken pipe", "BreaksAPipe", "init(y) raised BrokenPipeError"),
    ("no memory", "HasNoMemory", "init(y) raised MemoryError"),
    ("no end", "CallsItself", "init(y) raised RecursionError: maximum recursion depth"),
    ("no message", "IsSpeechless", "init(y) raised Speechless: its message cannot be shown"),
    ("a message of 10 MB", "SaysTooMuch", "init(y) raised ValueError: xxxx", "..."),
    ("a message of 2 million words", "SaysTooManyWords", "init(y) raised ValueError: all of it all of it ", "..."),
    ("a signature", "HasABrokenSignature", "HasABrokenSignature: its parameters cannot be read: TypeError: "),
    ("a comparison", "IsNotCompared", "IsNotCompared: its parameters cannot be read: SystemExit: 0"),
    ("any name", "ExitsAtAnyName", "ExitsAtAnyName': extra_signals cannot be read: SystemExit: 0"),
    ("any name of the class", "ShowsNothing", "ShowsNothing': cannot be imported: SystemExit: 0"),
    ("signals", "BangsAtItsSignals", "extra_signals cannot be read: Bang: not yet"),
    ("100,000 signals", "NamesTooMany", f"{RETURN}, a0, a1, ", " more)), not (state, [0.011, "),
    ("a signal of 1 MB", "NamesTooLong", f"{RETURN}, aaaa", "...)), not (state, [0.011, "),
    ("a signal of 1 MB of the wrong kind", "NamesBadly", "each once, not ('AAAA", "..."),
    (
        "four parts",
        "GivesTheEstimateMore",
        "4 positional",
        "; extra signals follow",
        "(*Estimate(x1, x2, x3), ",
    ),
    ("no name", "DoesNotNameItsSignal", f"{RETURN})), not (state, [", "extra_signals names what comes after x3"),
    ("what exits", "ReturnsWhatExits", "odd_observers.py, line ", ": raised SystemExit: 0"),
    ("an estimate that exits", "EstimatesWhatExits", "odd_observers.py, line ", ": raised SystemExit: 0"),
    ("a number that exits", "EstimatesANumberThatExits", "odd_observers.py, line ", ": raised SystemExit: 0"),
    ("what cannot be shown", "EstimatesWhatCannotBeShown", f"{RETURN})), not (state, what cannot be shown)"),
    ("a list in itself", "EstimatesItself", f"{RETURN})), not (state, what cannot be shown)"),
    ("100,000 numbers", "EstimatesTooMuch", f"{RETURN})), not (state, [0.0, 0.0, "),
)
def test_it_is_found_before_the_run(wrong_input: str, fragments: list[str]) -> None:
    complaint = cmg_mj("run", "push_recovery", "--observer", kind(wrong_input)).complaint
    assert_in_order(fragments, complaint)
    assert len(complaint) < 2000
    assert list(Path().iterdir()) == []


@pytest.mark.parametrize("cls", ["ExitsAtAnyName", "ShowsNothing", "HasABrokenSignature", "IsCancelledAtFirst"])
@pytest.mark.parametrize("command", ["export", "compare", "sweep", "check", "replay"])
def test_every_command_says_it(command: str, cls: str) -> None:
    """An exit of the user's is no success: `export` ended with 0 and wrote nothing."""
    Path("mine.toml").write_text(f"[observer]\nkind = '{kind(cls)}'", encoding="utf-8")
    rows = "\n".join(f"{0.01 * i:.2f},{i % 7}" for i in range(200))
    Path("log.csv").write_text(f"t_s,tilt_deg\n{rows}\n", encoding="utf-8")
    arguments = {
        "export": ["export", kind(cls)],
        "compare": ["compare", "push_recovery", "--observers", kind(cls)],
        "sweep": ["sweep", "push_recovery", "--observers", kind(cls), "--vary", "plant.equilibrium_bias_deg=0,1"],
        "check": ["check", "mine.toml"],
        "replay": ["replay", "log.csv", "--columns", "time=t_s,tilt=tilt_deg", "--observers", kind(cls)],
    }
    complaint = cmg_mj(*arguments[command]).complaint
    assert kind(cls) in complaint
    assert sorted(path.name for path in Path().iterdir()) == ["log.csv", "mine.toml"]


@table(
    ("a number", "NeedsANumber", "needs must be a tuple of names, not 5; allowed: acceleration, gimbals, model"),
    (
        "too much",
        "NeedsTooMuch",
        "needs = ('xxxx",
        "...: there is no 'xxxx",
        "...; allowed: acceleration, gimbals, model",
    ),
    ("what it does not say", "DoesNotSayItsNeeds", "needs cannot be read: Bang: not told"),
)
def test_the_needs_of_one_that_a_log_is_replayed_through(wrong_input: str, fragments: list[str]) -> None:
    rows = "\n".join(f"{0.01 * i:.2f},{i % 7}" for i in range(200))
    Path("log.csv").write_text(f"t_s,tilt_deg\n{rows}\n", encoding="utf-8")
    columns = ("--columns", "time=t_s,tilt=tilt_deg")
    complaint = cmg_mj("replay", "log.csv", *columns, "--observers", kind(wrong_input)).complaint
    assert_in_order(fragments, complaint)
    assert len(complaint) < 2000


def test_one_that_cannot_be_copied_is_not_exported() -> None:
    complaint = cmg_mj("export", kind("CannotBeCopied")).complaint
    assert "cannot be exported: it cannot be copied: Bang: one of its kind" in complaint


@pytest.mark.parametrize("driver", ["native", "callback"])
def test_cancelled_in_a_run_it_keeps_what_was_recorded(quick: str, driver: str) -> None:
    outcome = cmg_mj("run", quick, "--observer", kind("IsCancelledLater"), "--driver", driver, "--out", "it", "--json")
    assert outcome.status == 2
    assert "observer IsCancelledLater raised CancelledError: later at t = 0.03 s (odd_observers.py, " in outcome.err
    assert "); what was recorded" in outcome.err
    assert (Path("it") / "recording.rrd").exists()


def test_cancelled_beside_the_loop_it_harms_nobody(quick: str) -> None:
    later = kind("IsCancelledLater")
    assert cmg_mj("run", quick, "--set", f"open_loop_observers=['{later}']", "--json").status == 0


def test_what_a_message_shows_has_an_end() -> None:
    assert len(raised(ValueError("x" * 10_000_000))) < LONGEST_RAISED + 50
    assert raised(odd_observers.Speechless()) == "Speechless: its message cannot be shown"
    assert shown([[0.0] * 1000]).endswith("...")
    many = listed([f"name{i}" for i in range(100_000)])
    assert many.startswith("name0, name1, ")
    assert many.endswith(" more")
    assert len(many) < 1000
    assert listed(["a", "b"]) == "a, b"


def test_an_error_of_the_benchs_own_is_none_of_the_users(monkeypatch: pytest.MonkeyPatch) -> None:
    """It stays a traceback, which is what a report of it needs."""
    monkeypatch.setattr("cmg_mj.scenario.loading.load_scenario", divmod)  # refuses texts
    with pytest.raises(TypeError):
        cmg_mj("check", "push_recovery")
