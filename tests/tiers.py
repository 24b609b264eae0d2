"""Three tiers of tests: daily (unmarked), slow, papers. Every test is in one of them.

Slow tests and those of the papers run when `-m` names their tier, or when the command line names the test itself
(`file.py::test`). So neither `-m "not papers"` nor a folder brings slow ones back unseen.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from fnmatch import fnmatchcase
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

import pytest
from _pytest.mark.structures import ParameterSet

if TYPE_CHECKING:
    from xdist.remote import Producer
    from xdist.scheduler import Scheduling

TIERS = ("daily", "slow", "papers")
PAPERS = Path(__file__).parent / "papers"
HINT = "daily tier; the others: -m slow, -m papers; everything: -m 'daily or slow or papers'"


def named_tiers(expression: str) -> set[str]:
    """Tiers whose names stand in an expression of `-m`."""
    return {name for name in re.findall(r"\w+", expression) if name in TIERS}


def tier(item: pytest.Item) -> str:
    """Return the tier of a test.

    Raises:
        pytest.UsageError: It would be in two.
    """
    is_papers = PAPERS in item.path.parents
    is_slow = item.get_closest_marker("slow") is not None or not is_daily_case(item)
    if is_papers and is_slow:
        raise pytest.UsageError(f"{item.nodeid}: is of the papers, and cannot be slow as well")
    return "papers" if is_papers else "slow" if is_slow else "daily"


def case_name(item: pytest.Item) -> str:
    """Return the name of a case, as it stands in brackets after the test's."""
    return item.callspec.id if isinstance(item, pytest.Function) and hasattr(item, "callspec") else ""


def is_daily_case(item: pytest.Item) -> bool:
    """Return whether a test is a case that `daily_cases` names, or has no such mark."""
    mark = item.get_closest_marker("daily_cases")
    return mark is None or any(fnmatchcase(case_name(item), pattern) for pattern in mark.args)


def check_daily_cases(items: list[pytest.Item]) -> None:
    """Check that the cases that `daily_cases` names exist.

    Raises:
        pytest.UsageError: One does not.
    """
    unmatched: dict[str, set[str]] = {}
    for item in items:
        if mark := item.get_closest_marker("daily_cases"):
            patterns = unmatched.setdefault(item.nodeid.partition("[")[0], set(mark.args))
            patterns -= {pattern for pattern in patterns if fnmatchcase(case_name(item), pattern)}
    if missing := sorted(f"{test}[{pattern}]" for test, patterns in unmatched.items() for pattern in patterns):
        raise pytest.UsageError(f"daily_cases names cases that there are not: {', '.join(missing)}")


def named_tests(config: pytest.Config) -> list[tuple[Path, str]]:
    """Tests that the command line names: file, and what follows `::`."""
    parts = (argument.partition("::") for argument in config.args)
    return [(config.invocation_params.dir / file, name) for file, colons, name in parts if colons]


def is_named(item: pytest.Item, tests: list[tuple[Path, str]]) -> bool:
    """Return whether a test is one of those named, or a case of one."""
    own_name = item.nodeid.partition("::")[2]
    return any(
        path.resolve() == item.path and own_name.partition("[")[0] == name.partition("[")[0] for path, name in tests
    )


def pytest_configure(config: pytest.Config) -> None:
    config.addinivalue_line(
        "markers", "daily_cases(*patterns): all cases of this test are slow but those of these names"
    )


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Leave the papers' folder alone where none of its tests can run: it takes a second to import."""
    is_needed = "papers" in named_tiers(config.option.markexpr) or any(
        PAPERS in (path := config.invocation_params.dir / argument.partition("::")[0]).parents or path == PAPERS
        for argument in config.args
    )
    return True if collection_path == PAPERS and not is_needed else None


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Mark each test with its tier, before pytest reads `-m`; drop those whose tier nobody named."""
    tier_names = {"daily", *named_tiers(config.option.markexpr)}
    tests = named_tests(config)
    if not tests:
        check_daily_cases(items)
    deselected = []
    for item in items:
        its_tier = tier(item)
        item.add_marker(its_tier)
        if its_tier not in tier_names and not is_named(item, tests):
            deselected.append(item)
    if deselected:
        config.hook.pytest_deselected(items=deselected)
        items[:] = [item for item in items if item not in set(deselected)]


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Producer) -> Scheduling | None:
    """Share slow tests out one by one, and not by files (`--dist loadfile`): a file of theirs can take minutes."""
    if not named_tiers(config.option.markexpr) & {"slow", "papers"} or config.getoption("dist") != "loadfile":
        return None
    from xdist.scheduler import WorkStealingScheduling

    return WorkStealingScheduling(config, log)


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    """Say that there are other tiers."""
    if not named_tiers(config.option.markexpr) & {"slow", "papers"}:
        terminalreporter.write_line(HINT)


T = TypeVar("T")


def slow_but(cases: Iterable[T], *daily: T) -> list[T | ParameterSet]:
    """Return cases for `parametrize`, of which all are slow but these."""
    return [case if case in daily else pytest.param(case, marks=pytest.mark.slow) for case in cases]
