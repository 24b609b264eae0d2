"""The lowest versions that pyproject.toml allows, as a constraints file for pip: python .ci/lowest.py > lowest.txt."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

EXTRAS = ("papers", "cluster", "gymnasium", "notebook", "test")


def main() -> None:
    """Print name==version for what a user installs, and what the tests need beside it."""
    project = tomllib.loads((Path(__file__).parent.parent / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    wanted = [*project["dependencies"], *(line for extra in EXTRAS for line in project["optional-dependencies"][extra])]
    for requirement in wanted:
        bound = re.match(r"([A-Za-z0-9._-]+)(?:\[[^]]*\])?\s*>=\s*([0-9.]+)", requirement)
        if bound:
            print(f"{bound[1]}=={bound[2]}")
        elif not requirement.startswith(f"{project['name']}["):
            raise SystemExit(f"{requirement}: has no lower bound")


if __name__ == "__main__":
    main()
