"""Why trials were refused or stopped: counted, bounded, and said in the report."""

from __future__ import annotations

from cmg_mj.studies.sweeps import failure_reasons as module
from cmg_mj.studies.sweeps.api import all_trials
from cmg_mj.studies.sweeps.cells import Trials
from cmg_mj.studies.sweeps.failure_reasons import LONGEST, OTHERS, Reasons
from cmg_mj.studies.sweeps.report import report, summary, tables_of
from tests.studies.sweeps.made_up import made_up
from tests.studies.sweeps.test_trials import FAILS, study


def test_reasons_that_differ_in_their_numbers_are_one_kind() -> None:
    result = Reasons("b.c")
    result.add([("stopped", "gone at t = 0.5 s"), ("refused", "too far"), ("stopped", "gone at t = 1e-3 s")])
    result.add(
        [("stopped", "gone at t = 0.5 s"), ("stopped", "y1 is gone"), ("stopped", "y2 is gone"), ("stopped", None)]
    )
    assert (result.trials, result.kinds) == (7, 5)
    assert result.most(2) == ["3 stopped, such as: gone at t = 0.5 s", "1 refused: too far"]
    assert "1 stopped: no reason is given" in result.most(9)


def test_a_refusal_begins_with_what_is_wrong() -> None:
    """Not with twelve values of its point; and no reason takes more than a few lines."""
    result = Reasons("b.c")
    result.add([("refused", "push_recovery with --set x=1 with a=1, b.c=2: b.c = 2: must be\n  less: than 1")])
    result.add([("stopped", "long " * LONGEST)])
    first, second = result.most(2)
    assert first == "1 refused: b.c = 2: must be less: than 1"
    assert len(second) < LONGEST + 20


def test_memory_is_bounded() -> None:
    result = Reasons("b.c")
    for i in range(1000):
        result.add([("stopped", f"a{i} failed")])
    assert result.kinds == module.KINDS + 1
    assert result.trials == 1000
    assert result.most(1) == [f"{1000 - module.KINDS} stopped: {OTHERS}"]


def test_they_are_in_the_report_and_on_the_terminal() -> None:
    of = study({"plant.initial_tilt_deg": "0,5", "sensors.encoder.rate_hz": "200,333.7"}, (FAILS, "linear"))
    table = all_trials(of)
    trials = Trials(of, [table])
    counts = {how: table["outcome"].to_pylist().count(how) for how in ("refused", "stopped")}
    assert counts["refused"] == 8
    assert 0 < counts["stopped"] < 8
    result = tables_of(trials)
    whole = report(result, [])
    assert f"{sum(counts.values())} of 16 trials were refused or stopped" in whole
    assert "- 8 refused: sensors.encoder.rate_hz = 333.7 Hz: does not fit" in whole
    assert f"- {counts['stopped']} stopped: " in whole
    assert "too far" in whole
    (line,) = (line for line in summary(result).splitlines() if "trials were refused or stopped" in line)
    assert "8 refused: sensors.encoder.rate_hz = 333.7 Hz: does not fit" in line
    assert "1 other reason" in line
    by_chunks = Trials(of, [table.slice(0, 5), table.slice(5)])
    assert by_chunks.reasons.most(5) == trials.reasons.most(5)


def test_nothing_is_said_where_all_ran() -> None:
    result = tables_of(made_up({"plant.equilibrium_bias_deg": "0,1"}, ("linear",), 2, lambda *_: 1.0))
    assert "refused" not in report(result, []) + summary(result)
