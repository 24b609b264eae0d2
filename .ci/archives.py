"""Check what is in a built wheel and sdist: `python .ci/archives.py dist/*`."""

from __future__ import annotations

import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
SHIPPED = ("models", "scenarios", "examples")
"""Folders that the wheel has inside the package, and the sdist at its top."""
UNWANTED = ("__pycache__", ".rrd", ".so", ".parquet", ".git/", "site/")


def tracked(*folders: str) -> list[str]:
    """Return the files that git knows in some folders."""
    lines = subprocess.run(["git", "ls-files", *folders], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    return lines.splitlines()


def names_in(path: Path) -> set[str]:
    """Return the names in a wheel, or in an sdist without its top folder."""
    if path.suffix == ".whl":
        return set(zipfile.ZipFile(path).namelist())
    with tarfile.open(path) as archive:
        return {member.name.split("/", 1)[1] for member in archive.getmembers() if member.isfile()}


def missing_in(path: Path, names: set[str]) -> list[str]:
    """Return the files that the archive lacks."""
    wheel = path.suffix == ".whl"
    package = tracked("cmg_mj")
    data = [f"cmg_mj/{name}" if wheel else name for name in tracked(*SHIPPED)]
    others = (
        [] if wheel else tracked("docs", "tests", "README.md", "CHANGELOG.md", "SECURITY.md", "CITATION.cff", "LICENSE")
    )
    return sorted({*package, *data, *others} - names)


def main(paths: list[str]) -> int:
    """Print a line for each archive; return 1 if one lacks a file or has one too many."""
    wrong = 0
    for path in map(Path, paths):
        names = names_in(path)
        missing = missing_in(path, names)
        unwanted = sorted(
            name for name in names if any(part in name for part in UNWANTED) and name not in set(tracked())
        )
        size = path.stat().st_size / 1e6
        print(f"{path.name}: {len(names)} files, {size:.1f} MB; {len(missing)} missing, {len(unwanted)} unwanted")
        for name in [*missing, *unwanted]:
            print(f"  {name}", file=sys.stderr)
        wrong += len(missing) + len(unwanted)
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
