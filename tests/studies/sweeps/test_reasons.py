"""Why trials were refused or stopped: counted, bounded, and said in the report."""

from __future__ import annotations

from cmg_mj.studies.sweeps import failure_reasons as module
from cmg_mj.studies.sweeps.api import all_trials
from cmg_mj.studies.sweeps.cells import Trials
from cmg_mj.studies.sweeps.failure_reasons import LONGEST, OTHERS, Reasons
from cmg_mj.studies.sweeps.report import report, summary, tables_of
from tests.studies.sweeps.synthetic_trials import make_trials
from tests.studies.sweeps.test_trials import FAILS, study


def test_reasons_that_differ_in_their_numbers_are_one_kind() -> None:
    reasons = Reasons("b.c")
    reasons.add([("stopped", "gone at t = 0.5 s"), ("refused", "too far"), ("stopped", "gone at t = 1e-3 s")])
    reasons.add(
        [("stopped", "gone at t = 0.5 s"), ("stopped", "y1 is gone"), ("stopped", "y2 is gone"), ("stopped", None)]
    )
    assert (reasons.trials, reasons.kinds) == (7, 5)
    assert reasons.most(2) == ["3 stopped, such as: gone at t = 0.5 s", "1 refused: too far"]
    assert "1 stopped: no reason is given" in reasons.most(9)


def test_a_refusal_begins_with_what_is_wrong() -> None:
    """Not with twelve values of its point; and no reason takes more than a few lines."""
    reasons = Reasons("b.c")
    reasons.add([("refused", "push_recovery with --set x=1 with a=1, b.c=2: b.c = 2: must be\n  less: than 1")])
    reasons.add([("stopped", "long " * LONGEST)])
    first, second = reasons.most(2)
    assert first == "1 refused: b.c = 2: must be less: than 1"
    assert len(second) < LONGEST + 20


def test_memory_is_bounded() -> None:
    reasons = Reasons("b.c")
    for i in range(1000):
        reasons.add([("stopped", f"a{i} failed")])
    assert reasons.kinds == module.KINDS + 1
    assert reasons.trials == 1000
    assert reasons.most(1) == [f"{1000 - module.KINDS} stopped: {OTHERS}"]


def test_they_are_in_the_report_and_on_the_terminal() -> None:
    sweep = study({"plant.initial_tilt_deg": "0,5", "sensors.encoder.rate_hz": "200,333.7"}, (FAILS, "linear"))
    table = all_trials(sweep)
    trials = Trials(sweep, [table])
    counts = {outcome: table["outcome"].to_pylist().count(outcome) for outcome in ("refused", "stopped")}
    assert counts["refused"] == 8
    assert 0 < counts["stopped"] < 8
    tables = tables_of(trials)
    text = report(tables, [])
    assert f"{sum(counts.values())} of 16 trials were refused or stopped" in text
    assert "- 8 refused: sensors.encoder.rate_hz = 333.7 Hz: does not fit" in text
    assert f"- {counts['stopped']} stopped: " in text
    assert "too far" in text
    (line,) = (line for line in summary(tables).splitlines() if "trials were refused or stopped" in line)
    assert "8 refused: sensors.encoder.rate_hz = 333.7 Hz: does not fit" in line
    assert "1 other reason" in line
    by_chunks = Trials(sweep, [table.slice(0, 5), table.slice(5)])
    assert by_chunks.reasons.most(5) == trials.reasons.most(5)


def test_nothing_is_said_where_all_ran() -> None:
    tables = tables_of(make_trials({"plant.equilibrium_bias_deg": "0,1"}, ("linear",), 2, lambda *_: 1.0))
    assert "refused" not in report(tables, []) + summary(tables)
