"""Counts the house: `python .ci/size.py [ROOT]` prints files, tokens of code and words of docs beside their budgets.

A token of code is one of Python's, without docstrings, comments and layout: lines need not be long to count less.
"""

from __future__ import annotations

import ast
import io
import subprocess
import sys
import tokenize
from collections import Counter
from pathlib import Path

LAYOUT = {tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT, tokenize.ENDMARKER}
GENERATED = ("scenario", "commands", "reproduced", "beyond")
"""Beginnings of the names of pages that programs write."""
BUDGET = {
    "tokens of cmg_mj without papers": 200_000,
    "tokens of papers": 57_000,
    "tokens of tests": 255_000,
    "files of cmg_mj": 260,
    "words of docs": 40_000,
}


def tokens(text: str) -> int:
    """Count the tokens of a module."""
    docstrings = {
        (node.lineno, node.col_offset)
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)
    }
    found = tokenize.generate_tokens(io.StringIO(text).readline)
    return sum(1 for token in found if token.type not in LAYOUT and token.start not in docstrings)


def main() -> None:
    """Print the packages, then the measures beside their budgets."""
    root = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
    names = subprocess.check_output(["git", "ls-files"], cwd=root, text=True).splitlines()
    packages, measures = Counter[str](), Counter[str]()
    for name in names:
        top, *inner = name.split("/")
        if name.endswith(".py"):
            count = tokens((root / name).read_text(encoding="utf-8"))
            deep = 2 if inner[:1] == ["features"] else 1
            packages["/".join([top, *inner[:-1][:deep]] if top in ("cmg_mj", "tests") else [top])] += count
            if top == "cmg_mj":
                measures["files of cmg_mj"] += 1
                measures["tokens of papers" if inner[0] == "papers" else "tokens of cmg_mj without papers"] += count
            elif top == "tests":
                measures["tokens of tests"] += count
        elif name.endswith(".md") and top == "docs" and not inner[-1].startswith(GENERATED):
            measures["words of docs"] += len((root / name).read_text(encoding="utf-8").split())
    for package, count in sorted(packages.items()):
        print(f"{package:36}{count:8,}")
    for measure, budget in BUDGET.items():
        print(f"{measure:36}{measures[measure]:8,}   of {budget:,}")


if __name__ == "__main__":
    main()
