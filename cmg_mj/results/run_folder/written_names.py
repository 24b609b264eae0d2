"""The names of the files that cmg_mj writes into run folders; a list of files with others is somebody else's."""

from __future__ import annotations

import re
from collections.abc import Iterable

PART = r"[^/\\:\0\n]+"
"""Part of a name that a user has a say in: an observer, an axis, or a log."""
NAMES = (
    r"summary\.json",
    r"worlds\.parquet",
    r"recording\.rrd",
    rf"scenario(-{PART})?\.toml",
    rf"trajectory(-{PART})?\.parquet",
    rf"plot(-{PART})?\.png",
    # replay, tune and tune-log
    r"replay\.toml",
    r"tuned\.json",
    rf"signals(-{PART})?\.parquet",
    # sweep
    r"(trials|cells|order|indices)\.parquet",
    r"(curves|map_velocity_error|map_push_error|map_falls)\.png",
    # sweep and reproduce
    r"report\.md",
    r"figures\.json",
    r"(andrieu2009|aranovskiy2020|beyond|dao2023|sokolov2019)-[a-z0-9-]+\.png",
)
"""Patterns of the names, but for those of an export and of a plugin."""
EXPORT = ("{}.h", "{}.c", "{}_example.c", "{}_test_vector.h")
"""The files of an export, which the user names; all four are always written together."""
PLUGIN = ("libcmg_mj_{}.so", "{}.xml", "{}_example.c", "{}_example.py", "Makefile", "plugin.c", "rig.c")
"""Files of an engine plugin, which the user names; all but the library, the first, are always written together."""
PLUGIN_CODE = r"(noise|sensors|gyros|controller|state|setup)\.[ch]|(ziggurat|rig)\.h|{}(_\w+)?(\.h|\.c|_controller\.c)"
"""Pattern of the other files that stand with them: what all plugins have in common, and an axis' controller."""


def foreign_names(names: Iterable[str]) -> list[str]:
    """Return those of the names in a list of written files that cmg_mj cannot have written.

    Args:
        names: All names in the list.

    Returns:
        The names, in the list's order.
    """
    names = list(names)
    code = {
        file
        for name in names
        if re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*\.c", name)
        for files in [[form.format(name[:-2]) for form in EXPORT]]
        if set(files) <= set(names)
        for file in files
    }
    code |= {file for name in names for file in _plugin_files(name, names)}
    return [name for name in names if name not in code and not _is_listed(name)]


def _plugin_files(example: str, names: list[str]) -> list[str]:
    """List those of the names that are of the plugin with this example. Without a compiler it has no library."""
    match = re.fullmatch(r"([A-Za-z][A-Za-z0-9_]*)_example\.py", example)
    if match is None:
        return []
    files = [form.format(match[1]) for form in PLUGIN]
    if not set(files[1:]) <= set(names):
        return []
    return files + [name for name in names if re.fullmatch(PLUGIN_CODE.format(match[1]), name, re.ASCII)]


def _is_listed(name: str) -> bool:
    return any(re.fullmatch(pattern, name) for pattern in NAMES)
