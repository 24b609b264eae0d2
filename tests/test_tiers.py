"""Tiers, the limit of processor time, and the check that tests leave nothing in the repository."""

from __future__ import annotations

import re
import subprocess
import sys

import pytest

from tests import cpu_limit, footprint, tiers
from tests.command import ROOT, environment

TESTS = {
    "daily": ["test_a.py::test_quick", "test_a.py::test_case[1]"],
    "slow": ["test_a.py::test_case[2]", "test_a.py::test_long"],
    "papers": ["papers/test_b.py::test_claim"],
}
FILES = {
    "test_a": """
        import pytest
        def test_quick(): pass
        @pytest.mark.parametrize("case", [1, pytest.param(2, marks=pytest.mark.slow)])
        def test_case(case): pass
        @pytest.mark.slow
        def test_long(): pass
        """,
    "papers/test_b": "def test_claim(): pass",
}


@pytest.fixture
def toy(pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch) -> pytest.Pytester:
    """Tests of each tier."""
    monkeypatch.delenv("PYTEST_ADDOPTS", raising=False)
    monkeypatch.setattr(tiers, "PAPERS", pytester.path / "papers")
    monkeypatch.setattr(cpu_limit, "warm_up", lambda: None)
    monkeypatch.setenv(cpu_limit.ALONE, "1")
    monkeypatch.setattr(footprint, "ROOT", pytester.path)
    pytester.makeini("[pytest]\nmarkers =\n  daily\n  slow\n  papers\n")
    pytester.mkpydir("papers")
    pytester.makepyfile(**FILES)
    return pytester


def run_toy(toy: pytest.Pytester, *arguments: str) -> list[str]:
    """Tests that were run."""
    result = toy.runpytest_inprocess("-p", "tests.tiers", "-v", "-p", "no:cacheprovider", *arguments)
    return re.findall(r"^(\S+) PASSED", result.stdout.str(), flags=re.MULTILINE)


@pytest.mark.daily_cases(
    "-tiers_run0",
    "not papers-tiers_run1",
    "slow-tiers_run5",
    "slow or papers-tiers_run7",
    "daily or slow or papers-tiers_run10",
)
@pytest.mark.parametrize(
    ("expression", "tiers_run"),
    [
        ("", ["daily"]),
        ("not papers", ["daily"]),
        ("not slow", ["daily"]),
        ("not papers and not slow", ["daily"]),
        ("daily", ["daily"]),
        ("slow", ["slow"]),
        ("papers", ["papers"]),
        ("slow or papers", ["slow", "papers"]),
        ("daily or slow", ["daily", "slow"]),
        ("slow and not papers", ["slow"]),
        ("daily or slow or papers", ["daily", "slow", "papers"]),
    ],
)
def test_which_tests_an_expression_runs(toy: pytest.Pytester, expression: str, tiers_run: list[str]) -> None:
    assert sorted(run_toy(toy, "-m", expression)) == sorted(name for tier in tiers_run for name in TESTS[tier])


@pytest.mark.parametrize("name", [*TESTS["slow"], *TESTS["papers"]])
def test_a_test_that_is_named_runs_whatever_its_tier(toy: pytest.Pytester, name: str) -> None:
    assert run_toy(toy, name) == [name]
    assert run_toy(toy, str(toy.path / name)) == [name]


def test_a_file_that_is_named_runs_its_daily_tests(toy: pytest.Pytester) -> None:
    assert sorted(run_toy(toy, "test_a.py")) == sorted(TESTS["daily"])
    assert run_toy(toy, "papers") == []
    assert run_toy(toy, "-m", "papers", "papers") == TESTS["papers"]


def test_a_test_of_the_papers_is_not_marked_slow(toy: pytest.Pytester) -> None:
    toy.makepyfile(**{"papers/test_b": "import pytest\npytestmark = pytest.mark.slow\ndef test_claim(): pass"})
    result = toy.runpytest_inprocess("-p", "tests.tiers", "-m", "papers")
    assert result.ret == pytest.ExitCode.USAGE_ERROR


def test_cases_are_slow_but_those_named_daily(toy: pytest.Pytester) -> None:
    marks = "@pytest.mark.daily_cases('{}')\n@pytest.mark.parametrize('case', 'pqr')"
    code = f"import pytest\n{marks}\ndef test_it(case): pass"
    toy.makepyfile(test_a=code.format("[pr]"))
    assert run_toy(toy) == ["test_a.py::test_it[p]", "test_a.py::test_it[r]"]
    assert run_toy(toy, "-m", "slow") == ["test_a.py::test_it[q]"]
    assert run_toy(toy, "test_a.py::test_it[q]") == ["test_a.py::test_it[q]"]
    toy.makepyfile(test_a=code.format("s"))
    result = toy.runpytest_inprocess("-p", "tests.tiers")
    result.stderr.fnmatch_lines(["*daily_cases names cases that there are not: test_a.py::test_it[[]s]"])


@pytest.mark.slow
def test_every_test_is_in_one_tier() -> None:
    def collect(expression: str) -> list[str]:
        process = subprocess.run(
            [sys.executable, "-m", "pytest", "-n", "0", "--collect-only", "-p", "no:cacheprovider", "-m", expression],
            cwd=ROOT,
            env=environment(PYTEST_ADDOPTS=""),
            capture_output=True,
            text=True,
            check=True,
        )
        return [line for line in process.stdout.splitlines() if "::" in line]

    tests_of = {tier: collect(tier) for tier in tiers.TIERS}
    assert all(tests_of.values())
    assert sorted(name for names in tests_of.values() for name in names) == sorted(collect("daily or slow or papers"))
    assert tests_of["daily"] == collect("not papers") == collect("")


BURN = "import time\ndef burn():\n    end = time.process_time() + 0.12\n    while time.process_time() < end: pass\n"


@pytest.mark.parametrize(
    ("code", "is_failure"),
    [
        ("def test_it(): pass", False),
        ("def test_it(): time.sleep(0.12)", False),
        ("def test_it(): burn()", True),
        ("@pytest.mark.slow\ndef test_it(): burn()", False),
        ("@pytest.fixture(scope='module')\ndef made(): burn()\ndef test_it(made): pass", True),
        ("@pytest.fixture\ndef made():\n    yield\n    burn()\ndef test_it(made): pass", True),
        (
            "import subprocess, sys\n"
            "def test_it(): subprocess.run([sys.executable, '-c', 'sum(range(8_000_000))'], check=True)",
            True,
        ),
    ],
    ids=["quick", "waiting", "computing", "slow", "set-up", "teardown", "a child"],
)
def test_processor_time_is_limited(
    toy: pytest.Pytester, monkeypatch: pytest.MonkeyPatch, code: str, is_failure: bool
) -> None:
    monkeypatch.setattr(cpu_limit, "calibration_loop", lambda: cpu_limit.REFERENCE_S)
    toy.makepyfile(test_c=f"import pytest\n{BURN}{code}\n")
    result = toy.runpytest_inprocess(
        "-p", "tests.tiers", "-p", "tests.cpu_limit", "--cpu-limit=0.05", "test_c.py::test_it"
    )
    result.assert_outcomes(passed=1, errors=int(is_failure))
    assert ("of processor time with its set-up and its children" in result.stdout.str()) == is_failure


def test_a_slow_machine_has_a_higher_limit(toy: pytest.Pytester, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cpu_limit, "calibration_loop", lambda: 4.0 * cpu_limit.REFERENCE_S)
    toy.makepyfile(test_c=f"{BURN}def test_it(): burn()\n")
    toy.runpytest_inprocess(
        "-p", "tests.tiers", "-p", "tests.cpu_limit", "--cpu-limit=0.05", "test_c.py"
    ).assert_outcomes(passed=1)


@pytest.mark.slow
@pytest.mark.parametrize("always", [True, False])
def test_a_test_that_is_over_the_limit_has_a_second_try(
    toy: pytest.Pytester, monkeypatch: pytest.MonkeyPatch, always: bool
) -> None:
    """In a process of its own, where nothing else has raised its time."""
    monkeypatch.delenv(cpu_limit.ALONE)
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    toy.makeconftest("pytest_plugins = ['tests.tiers', 'tests.cpu_limit']")
    code = "for _ in range(20): burn()" if always else "Path('first').exists() or [burn() for _ in range(20)]"
    toy.makepyfile(test_c=f"from pathlib import Path\n{BURN}def test_it():\n    {code}\n    Path('first').touch()\n")
    result = toy.runpytest_inprocess("--cpu-limit=0.8", "test_c.py::test_it")
    result.assert_outcomes(passed=1, errors=int(always))
    assert ("it is over the limit again:" in result.stdout.str()) == always


@pytest.mark.slow
def test_a_second_try_that_fails_otherwise_says_so(toy: pytest.Pytester, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(cpu_limit.ALONE)
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    toy.makeconftest("pytest_plugins = ['tests.tiers', 'tests.cpu_limit']")
    code = "assert not Path('first').exists(), 'another reason'"
    toy.makepyfile(
        test_c=f"from pathlib import Path\n{BURN}def test_it():\n    {code}\n    burn()\n    Path('first').touch()\n"
    )
    result = toy.runpytest_inprocess("--cpu-limit=0.01", "test_c.py::test_it")
    result.assert_outcomes(passed=1, errors=1)
    result.stdout.fnmatch_lines(["*it fails otherwise, with exit status 1:*", "*another reason*"])


def test_a_second_try_that_hangs_is_given_up(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cpu_limit, "HANGS_AFTER_S", 0.01)
    assert cpu_limit.failure_alone(request.node, 1.0) == "in a process of its own it has not ended after 0.01 s"


@pytest.mark.parametrize(
    ("code", "litter"),
    [
        ("Path('left.txt').write_text('')", "left.txt"),
        ("Path('docs/new').mkdir()", "docs/new"),
        ("Path('docs/there.txt').write_text('again')", ""),
        ("(tmp_path / 'own.txt').write_text('')", ""),
        ("Path('left.txt').write_text(''); Path('left.txt').unlink()", ""),
    ],
)
def test_nothing_is_left_in_the_repository(toy: pytest.Pytester, code: str, litter: str) -> None:
    toy.mkdir("docs").joinpath("there.txt").write_text("")
    toy.makepyfile(test_c=f"from pathlib import Path\ndef test_it(tmp_path):\n    {code}\ndef test_next(): pass\n")
    result = toy.runpytest_inprocess("-p", "tests.footprint", "test_c.py", f"--basetemp={toy.path.parent / 'own'}")
    result.assert_outcomes(passed=2, errors=int(bool(litter)))
    assert not litter or f"test_c.py::test_it: {litter} came into the repository" in result.stdout.str()
