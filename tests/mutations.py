"""Which test catches which wrong parameter? Writes docs/mutations.md.

Each parameter of the law, the observers and the reduced model is multiplied by 0.8 and by 1.2 in a copy of the sources,
and the tests are run until the first failure.

    python tests/mutations.py              # about twenty minutes on two cores
    python tests/mutations.py adaptive     # only the parameters with this in their names, printed and not written
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
FACTORS = (0.8, 1.2)
NUMBER = r"(-?[0-9][0-9.e+-]*)"
# Equations first: they name the culprit; the closed loop last.
TESTS = [
    "tests/test_controller.py",
    "tests/observers",
    "tests/test_scenario.py",
    "tests/test_paper_mass_matrix.py",
    "tests/test_reduced_against_plant.py",
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
    *(element(f"law: K_e[{i}]", "cmg_mj/law.py", "TABLE_2_GAINS = (", i) for i in range(4)),
    Mutation("law: rate limit", "cmg_mj/law.py", r"rate_limit: float = " + NUMBER),
    Mutation("scenario: rate limit", "cmg_mj/schema.py", r"rate_limit_rad_s: Positive = " + NUMBER),
    Mutation("linear: tau", OBSERVERS + "linear.py", r"tau: Positive = " + NUMBER),
    *(element(f"ltv: Q[{i}]", OBSERVERS + "ltv.py", "Q: tuple[Positive, Positive, Positive] = (", i) for i in range(3)),
    *(
        element(f"ltv: H0[{i}]", OBSERVERS + "ltv.py", "H0: tuple[Positive, Positive, Positive] = (", i)
        for i in range(3)
    ),
    Mutation("homogeneous: k1", OBSERVERS + "homogeneous.py", r"k1: Positive = " + NUMBER),
    Mutation("homogeneous: k2", OBSERVERS + "homogeneous.py", r"k2: Positive = " + NUMBER),
    Mutation("homogeneous: alpha", OBSERVERS + "homogeneous.py", r"alpha: Annotated\[.*?\] = " + NUMBER),
    *(
        Mutation(f"luenberger: L[{row}][{column}]", OBSERVERS + "luenberger.py", pattern)
        for row, column, pattern in (
            (0, 0, r"tuple\[float, float\]\] = \(\s*\(" + NUMBER),
            (1, 0, r"tuple\[float, float\]\] = \(\s*\([^)]*\),\s*\(" + NUMBER),
            (2, 1, r"tuple\[float, float\]\] = \(\s*\([^)]*\),\s*\([^)]*\),\s*\([^,]*,\s*" + NUMBER),
        )
    ),
    Mutation("linear_high_gain: epsilon", OBSERVERS + "linear_high_gain.py", r"epsilon: Positive = " + NUMBER),
    Mutation("linear_high_gain: a1", OBSERVERS + "linear_high_gain.py", r"a1: Positive = " + NUMBER),
    Mutation("linear_high_gain: a2", OBSERVERS + "linear_high_gain.py", r"a2: Positive = " + NUMBER),
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
    Mutation("super_twisting: L", OBSERVERS + "super_twisting.py", r"    L: Positive = " + NUMBER),
    Mutation("super_twisting: l0", OBSERVERS + "super_twisting.py", r"l0: Positive = " + NUMBER),
    Mutation("super_twisting: l1", OBSERVERS + "super_twisting.py", r"l1: Positive = " + NUMBER),
]
REDUCED = ("J1", "J2", "J_d", "omega_d", "gravity_torque")


def mutate(copy: Path, parameter: str, factor: float) -> None:
    """Multiply one parameter in a copy of the sources.

    Raises:
        LookupError: The pattern of a parameter does not occur exactly once.
    """
    name = parameter.removeprefix("reduced: ")
    if name in REDUCED:
        path = copy / "cmg_mj/reduced.py"
        text = path.read_text()
        line = f"    {name}: float\n"
        # After construction, so that every reader sees the wrong value.
        guard = "\n    def __post_init__(self) -> None:\n"
        guard += f'        object.__setattr__(self, "{name}", {factor} * self.{name})\n'
        last = "    gravity_torque: float\n"
        if text.count(line) != 1:
            raise LookupError(parameter)
        path.write_text(text.replace(last, last + guard, 1))
        return
    mutation = next(m for m in MUTATIONS if m.parameter == parameter)
    path = copy / mutation.file
    text = path.read_text()
    found = list(re.finditer(mutation.pattern, text))
    if len(found) != 1:
        raise LookupError(f"{parameter}: found {len(found)} times")
    start, end = found[0].span(found[0].lastindex or 0)
    path.write_text(text[:start] + repr(float(text[start:end]) * factor) + text[end:])


def caught_by(parameter: str, factor: float) -> str:
    """The first test that fails with a parameter multiplied, or a dash."""
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder)
        for part in ("cmg_mj", "models", "scenarios", "tests", "docs"):
            shutil.copytree(ROOT / part, copy / part, ignore=shutil.ignore_patterns("__pycache__"))
        shutil.copy(ROOT / "pyproject.toml", copy)
        mutate(copy, parameter, factor)
        command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:xdist", "-o", "addopts=", *TESTS]
        environment = os.environ | {"PYTHONPATH": str(copy)}
        output = subprocess.run(command, cwd=copy, env=environment, capture_output=True, text=True).stdout
    failed = re.findall(r"^(?:FAILED|ERROR) (.+?)(?: - .*)?$", output, flags=re.MULTILINE)
    return f"`{failed[0].removeprefix('tests/')}`" if failed else "-"


def main() -> None:
    """Run all mutations and write the table."""
    if (failed := caught_by(MUTATIONS[0].parameter, 1.0)) != "-":
        sys.exit(f"{failed} fails without any mutation: mend that first")
    parameters = [m.parameter for m in MUTATIONS] + [f"reduced: {name}" for name in REDUCED]
    wanted = sys.argv[1] if len(sys.argv) > 1 else ""
    parameters = [name for name in parameters if wanted in name]
    with ThreadPoolExecutor(2) as pool:
        found = {(p, f): pool.submit(caught_by, p, f) for p in parameters for f in FACTORS}
        rows = [f"| `{p}` | " + " | ".join(found[p, f].result() for f in FACTORS) + " |" for p in parameters]
    lines = [
        "# Which test catches which wrong parameter",
        "",
        "Each parameter multiplied in a copy of the sources, and the first test that then fails; a dash would be a",
        "survivor. No test compares a default with a literal: each is caught by its effect.",
        "Written by `python tests/mutations.py`.",
        "",
        "| parameter | times 0.8 | times 1.2 |",
        "|---|---|---|",
        *rows,
        "",
    ]
    if not wanted:
        (ROOT / "docs" / "mutations.md").write_text("\n".join(lines))
    print("\n".join(lines))


if __name__ == "__main__":
    main()
