"""Prints what stands beside a plugin's C: a Makefile, and an example in C and in Python."""

from __future__ import annotations

import json
from collections.abc import Collection, Sequence
from importlib.resources import files

from cmg_mj.codegen.engine_plugin.build import FLAGS, find_mujoco


def library_name(name: str) -> str:
    """Name the library of a plugin."""
    return f"libcmg_mj_{name}.so"


def extra_files(name: str, code: Collection[str], sources: Sequence[str], axis: str) -> dict[str, str]:
    """Print the Makefile and the examples.

    Args:
        name: The plugin's name behind `cmg_mj.`.
        code: The files of the C.
        sources: Those of them that are compiled.
        axis: The first axis' name, or nothing.

    Returns:
        Name -> text.
    """
    mujoco, tilt = find_mujoco(), "/".join(filter(None, ("balance", axis, "tilt")))
    words = {
        "NAME": name,
        "LIBRARY": library_name(name),
        "TILT_IN_C": c_text(tilt),
        "TILT_IN_PYTHON": json.dumps(tilt, ensure_ascii=False),
        "MUJOCO": str(mujoco.library.parent),
        "LIBMUJOCO": mujoco.library.name,
        "SOURCES": " ".join(sources),
        "INCLUDED": " ".join(file for file in code if file not in sources),
        "FLAGS": " ".join(FLAGS),
    }
    templates = {f"{name}_example.c": "example.c", f"{name}_example.py": "example.py.txt", "Makefile": "Makefile"}
    return {file: _filled(template, words) for file, template in templates.items()}


def c_text(text: str) -> str:
    """Print a text as C reads it; in octal whatever is no plain letter, and ?, which begins trigraphs."""
    letters = (chr(byte) if 32 <= byte < 127 and byte not in b'"\\?' else f"\\{byte:03o}" for byte in text.encode())
    return f'"{"".join(letters)}"'


def _filled(template: str, words: dict[str, str]) -> str:
    text = (files("cmg_mj.codegen.engine_plugin") / "templates" / template).read_text(encoding="utf-8")
    for word, value in words.items():
        text = text.replace(f"@{word}@", value)
    return text
