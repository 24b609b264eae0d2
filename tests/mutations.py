"""Which test catches which wrong parameter, and which wrong report? Prints both tables.

Each parameter of the law, the observers and the reduced model is multiplied by 0.8 and by 1.2 in a copy of the sources,
and the tests are run until the first failure: those of the daily tier, and if none of them fails the slow ones. Each
line that tests/papers/mutants.py changes in the papers' reports must be caught by the test named there.

    python tests/mutations.py              # half an hour on two cores
    python tests/mutations.py adaptive     # only the parameters with this in their names
    python tests/mutations.py papers       # only the reports
    python tests/mutations.py papers gap   # of these only the ones with this in what is wrong
    python tests/mutations.py --check      # only whether each pattern is in the sources once; runs no test
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from tests.papers import mutants  # noqa: E402
from tests.papers.mutants import MUTANTS, Mutant  # noqa: E402

FACTORS = (0.8, 1.2)
NUMBER = r"(-?[0-9][0-9.e+-]*)"
# Equations first: they name the culprit; the closed loop last.
TESTS = [
    "tests/core/test_controller.py",
    "tests/observers",
    "tests/scenario/test_loading.py",
    "tests/plant/test_paper_mass_matrix.py",
    "tests/plant/test_reduced_against_plant.py",
    "tests/acceptance",
]


@dataclass(frozen=True)
class Mutation:
    """A number in the sources: the last group of `pattern` in `file`."""

    parameter: str
    file: str
    pattern: str


def element(parameter: str, file: str, opening: str, index: int) -> Mutation:
    """Element `index` of a flat tuple of numbers that begins after `opening`."""
    return Mutation(parameter, file, re.escape(opening) + rf"(?:[^,]*,\s*){{{index}}}[\s(]*" + NUMBER)


OBSERVERS = "cmg_mj/observers/"
MUTATIONS = [
    *(element(f"law: K_e[{i}]", "cmg_mj/laws/state_feedback.py", "TABLE_2_GAINS = (", i) for i in range(4)),
    Mutation("law: rate limit", "cmg_mj/laws/state_feedback.py", r"rate_limit: float = " + NUMBER),
    Mutation("scenario: rate limit", "cmg_mj/scenario/schema.py", r"rate_limit_rad_s: Annotated\[.*?\] = " + NUMBER),
    Mutation("linear: tau", OBSERVERS + "linear.py", r"tau: Positive = " + NUMBER),
    *(element(f"ltv: Q[{i}]", OBSERVERS + "ltv.py", "Q: tuple[Positive, Positive, Positive] = (", i) for i in range(3)),
    *(
        element(f"ltv: H0[{i}]", OBSERVERS + "ltv.py", "H0: tuple[Positive, Positive, Positive] = (", i)
        for i in range(3)
    ),
    Mutation("homogeneous: k1", OBSERVERS + "homogeneous.py", r"k1: Positive = " + NUMBER),
    Mutation("homogeneous: k2", OBSERVERS + "homogeneous.py", r"k2: Positive = " + NUMBER),
    Mutation("homogeneous: alpha", OBSERVERS + "homogeneous.py", r"alpha: Exponent = " + NUMBER),
    *(
        Mutation(f"luenberger: L[{row}][{column}]", OBSERVERS + "luenberger.py", pattern)
        for row, column, pattern in (
            (0, 0, r"tuple\[float, float\]\] = \(\s*\(" + NUMBER),
            (1, 0, r"tuple\[float, float\]\] = \(\s*\([^)]*\),\s*\(" + NUMBER),
            (2, 1, r"tuple\[float, float\]\] = \(\s*\([^)]*\),\s*\([^)]*\),\s*\([^,]*,\s*" + NUMBER),
        )
    ),
    Mutation("linear_high_gain: epsilon", OBSERVERS + "linear.py", r"epsilon: Positive = " + NUMBER),
    Mutation("linear_high_gain: a1", OBSERVERS + "linear.py", r"a1: Positive = " + NUMBER),
    Mutation("linear_high_gain: a2", OBSERVERS + "linear.py", r"a2: Positive = " + NUMBER),
    Mutation(
        "homogeneous: friction_width", OBSERVERS + "homogeneous.py", r"friction_width_rad_s: Positive = " + NUMBER
    ),
    *(element(f"adaptive: L[{i}]", OBSERVERS + "adaptive.py", "L: tuple[float, float] = (", i) for i in range(2)),
    *(
        element(f"adaptive: Gamma[{i}]", OBSERVERS + "adaptive.py", "Gamma: tuple[Positive, Positive, Positive] = (", i)
        for i in range(3)
    ),
    Mutation("adaptive: Sigma", OBSERVERS + "adaptive.py", r"Sigma: Positive = " + NUMBER),
    *(
        Mutation(f"high_gain: {name}", OBSERVERS + "high_gain.py", rf"\n    {name}: Positive = " + NUMBER)
        for name in ("l1", "l2", "b", "phi1", "phi2", "phi3")
    ),
    Mutation("high_gain: d_inf", OBSERVERS + "high_gain.py", r"d_inf: Annotated\[.*?\] = " + NUMBER),
    *(
        Mutation(f"kalman: {name}", OBSERVERS + "kalman.py", rf"\n    {name}: (?:Positive|int) = " + NUMBER)
        for name in ("torque_walk", "torque_white", "gimbal_white", "rate_start", "torque_start")
    ),
    *(
        Mutation(
            f"gyro_free: {name}", OBSERVERS + "gyro_free.py", rf"\n    {name}: (?:Positive|NonNegative) = " + NUMBER
        )
        for name in ("rate_start", "bias_start", "bias_walk", "jerk")
    ),
    *(
        Mutation(
            f"free_pivot: {name}", OBSERVERS + "free_pivot.py", rf"\n    {name}: \w[^=\n]*(?:=1.0[^=\n]*)? = " + NUMBER
        )
        for name in (
            *("pivot_hz", "slow_hz", "odds_s", "odds_alike", "pivot_start", "pivot_floor", "pivot_s", "learn_s"),
            *("innovation_weight", "slow_innovation_weight", "noise_s"),
            *("rise_factor", "covariance_boost", "inflation", "gate"),  # the others are those of gyro_free
        )
    ),
    Mutation("super_twisting: L", OBSERVERS + "linear.py", r"    L: Positive = " + NUMBER),
    Mutation("super_twisting: l0", OBSERVERS + "linear.py", r"l0: Positive = " + NUMBER),
    Mutation("super_twisting: l1", OBSERVERS + "linear.py", r"l1: Positive = " + NUMBER),
]
REDUCED = ("J1", "J2", "J_d", "omega_d", "gravity_torque")


def mutated(parameter: str, factor: float, root: Path = ROOT) -> tuple[str, str]:
    """Return the file of a parameter, and its text with the parameter multiplied.

    Raises:
        LookupError: The pattern of a parameter does not occur exactly once.
    """
    name = parameter.removeprefix("reduced: ")
    if name in REDUCED:
        file = "cmg_mj/core/reduced_model.py"
        text = (root / file).read_text(encoding="utf-8")
        last = "    gravity_torque: float\n"
        # After construction, so that every reader sees the wrong value.
        guard = "\n    def __post_init__(self) -> None:\n"
        guard += f'        object.__setattr__(self, "{name}", {factor} * self.{name})\n'
        if text.count(f"    {name}: float\n") != 1 or text.count(last) != 1:
            raise LookupError(parameter)
        return file, text.replace(last, last + guard)
    mutation = next(m for m in MUTATIONS if m.parameter == parameter)
    text = (root / mutation.file).read_text(encoding="utf-8")
    matches = list(re.finditer(mutation.pattern, text))
    if len(matches) != 1:
        raise LookupError(f"{parameter}: found {len(matches)} times")
    start, end = matches[0].span(matches[0].lastindex or 0)
    return mutation.file, text[:start] + repr(float(text[start:end]) * factor) + text[end:]


def parameters() -> list[str]:
    """Names of all parameters."""
    return [m.parameter for m in MUTATIONS] + [f"reduced: {name}" for name in REDUCED]


def caught_by(parameter: str, factor: float) -> str:
    """Return the first test that fails with a parameter multiplied, or a dash; slow ones are named as such."""

    def change(copy: Path) -> None:
        file, text = mutated(parameter, factor, copy)
        (copy / file).write_text(text, encoding="utf-8")

    daily = first_failure(change, TESTS, "daily")
    if daily != "-":
        return daily
    slow = first_failure(change, TESTS, "slow")
    return slow if slow == "-" else f"slow: {slow}"


def first_failure(change: Callable[[Path], None], tests: Sequence[str], tiers: str) -> str:
    """Return the first of some tests, of the tiers of an `-m`, that fails in a changed copy, or a dash."""
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder)
        for part in ("cmg_mj", "models", "scenarios", "tests", "docs"):
            shutil.copytree(ROOT / part, copy / part, ignore=shutil.ignore_patterns("__pycache__", "*.png"))
        shutil.copy(ROOT / "pyproject.toml", copy)
        change(copy)
        command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:xdist", "-o", "addopts=", "-m", tiers, *tests]
        environment = os.environ | {"PYTHONPATH": str(copy)}
        output = subprocess.run(command, cwd=copy, env=environment, capture_output=True, text=True).stdout
    failed = re.findall(r"^(?:FAILED|ERROR) (.+?)(?: - .*)?$", output, flags=re.MULTILINE)
    if not failed and not re.search(r"^\d+ passed", output, flags=re.MULTILINE):
        raise LookupError(f"{tests}: no test was run:\n{output[-2000:]}")
    return f"`{failed[0].removeprefix('tests/')}`" if failed else "-"


def report_caught_by(mutant: Mutant) -> str:
    """The test that fails with a line of a report changed, or a dash."""

    def change(copy: Path) -> None:
        path = copy / mutants.PAPERS / mutant.file
        path.write_text(mutant.apply(path.read_text(encoding="utf-8")), encoding="utf-8")

    return first_failure(change, [mutants.TESTS + mutant.test], "papers")


def parameter_table(pool: ThreadPoolExecutor, part: str) -> tuple[str, list[str]]:
    """The table of parameters, and those that no test caught and that matter."""
    chosen = [name for name in parameters() if part in name]
    futures = {(p, f): pool.submit(caught_by, p, f) for p in chosen for f in FACTORS}
    rows = [f"| `{p}` | " + " | ".join(futures[p, f].result() for f in FACTORS) + " |" for p in chosen]
    dashes = [(p, f) for (p, f), future in futures.items() if future.result() == "-"]
    survived = [f"{p} times {f}" for p, f in dashes]
    return "\n".join(["| parameter | times 0.8 | times 1.2 |", "|---|---|---|", *rows]), survived


def report_table(pool: ThreadPoolExecutor, part: str) -> tuple[str, list[str]]:
    """The table of wrong reports, and those that no test caught."""
    tried = [mutant for mutant in MUTANTS if part in mutant.wrong]
    futures = [pool.submit(report_caught_by, mutant) for mutant in tried]
    rows = [f"| {m.wrong} | `{m.file}` | {future.result()} |" for m, future in zip(tried, futures, strict=True)]
    survived = [m.wrong for m, future in zip(tried, futures, strict=True) if future.result() == "-"]
    return "\n".join(["| what is wrong | where, in cmg_mj/papers | caught by |", "|---|---|---|", *rows]), survived


def main() -> None:
    """Run all mutations and print the tables."""
    if sys.argv[1:] == ["--check"]:
        for name in parameters():
            mutated(name, FACTORS[0])
        return
    selection = sys.argv[1] if len(sys.argv) > 1 else ""
    parts: list[str] = []
    survivors: list[str] = []
    with ThreadPoolExecutor(2) as pool:
        if selection != "papers":
            if (failed := caught_by(MUTATIONS[0].parameter, 1.0)) != "-":
                sys.exit(f"{failed} fails without any mutation: mend that first")
            table, survived = parameter_table(pool, selection)
            parts.append(table)
            survivors += survived
        if selection in ("", "papers"):
            part = sys.argv[2] if len(sys.argv) > 2 else ""
            whole = sorted({mutants.TESTS + mutant.test for mutant in MUTANTS if part in mutant.wrong})
            if (failed := first_failure(lambda copy: None, whole, "papers")) != "-":
                sys.exit(f"{failed} fails without any mutation: mend that first")
            table, survived = report_table(pool, part)
            parts.append(table)
            survivors += survived
    print("\n\n".join(parts))
    if survivors:
        sys.exit(f"survived: {', '.join(survivors)}")


if __name__ == "__main__":
    main()
