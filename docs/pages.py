"""What the site shows of the files beside docs/: README as home, CONTRIBUTING, CHANGELOG, the examples; and links.

A hook of mkdocs. Links are written for a code host, relative to their file. A link to a file that the site has not is
left as plain text.
"""

from __future__ import annotations

import ast
import json
import posixpath
import re
from pathlib import Path
from typing import Any

import griffe
from mkdocs.structure.files import File, Files

ROOT = Path(__file__).parent.parent
PAGES = {
    "README.md": "index.md",
    "CONTRIBUTING.md": "contributing.md",
    "CHANGELOG.md": "changelog.md",
    "SECURITY.md": "security.md",
}
EXAMPLES = "examples.md"
LINK = re.compile(r"(!?)\[([^\]]*)\]\((?!\w+:|#)([^)#\s]+)(#[^)\s]*)?\)")


def on_files(files: Files, config: Any) -> Files:
    """Add the pages whose text is outside docs/."""
    for source, page in PAGES.items():
        text = (ROOT / source).read_text(encoding="utf-8")
        files.append(File.generated(config, page, content=_linked(text, "", page, files)))
    files.append(File.generated(config, EXAMPLES, content=_examples()))
    return files


def on_page_markdown(markdown: str, page: Any, files: Files, **_: Any) -> str:
    """Turn the links of a page of docs/ that lead out of it."""
    if page.file.generated_by:
        return markdown
    return _linked(markdown, posixpath.dirname(f"docs/{page.file.src_uri}"), page.file.src_uri, files)


def _examples() -> str:
    """All examples on one page, each under what it says it is."""
    parts = ["# Examples", "Each is a file of `examples/` and runs as it is: `python examples/own_loop.py`."]
    parts.append("The two notebooks at the end open in Jupyter, with the extra `notebook`.")
    for path in sorted((ROOT / "examples").glob("*.py")):
        code = path.read_text(encoding="utf-8")
        about = (ast.get_docstring(ast.parse(code)) or "").split("\n\n")[0]
        parts += [f"## {path.stem}", about, f"```python\n{code}```"]
    for path in sorted((ROOT / "examples").glob("*.ipynb")):
        parts += [f"## {path.stem}", *_notebook(path)]
    return "\n\n".join(parts) + "\n"


def _notebook(path: Path) -> list[str]:
    """The cells of a notebook; its title is the section's, and its sections stand below. Links become plain text."""
    parts = []
    for cell in json.loads(path.read_text(encoding="utf-8"))["cells"]:
        text = "".join(cell["source"])
        if cell["cell_type"] == "code":
            parts.append(f"```python\n{text}\n```")
        else:
            text = re.sub(r"^# .*\n*", "", text)
            parts.append(LINK.sub(r"\2", re.sub(r"^## (.*)", r"**\1**", text, flags=re.MULTILINE)))
    return parts


def _linked(markdown: str, folder: str, page: str, files: Files) -> str:
    """Links of a file in a folder of the repository, as the site's page needs them."""

    def turned(link: re.Match[str]) -> str:
        mark, text, target, anchor = link.groups()
        path = posixpath.normpath(posixpath.join(folder, target))
        if path in PAGES:
            place = PAGES[path]
        elif path == "examples" or path.startswith("examples/"):
            place, anchor = EXAMPLES, f"#{Path(path).stem}" if path.endswith((".py", ".ipynb")) else ""
        else:
            place = path.removeprefix("docs/")
            if not path.startswith("docs/") or place not in files.src_uris:
                return text
        return f"{mark}[{text}]({posixpath.relpath(place, posixpath.dirname(page) or '.')}{anchor or ''})"

    return LINK.sub(turned, markdown)


class PydanticDataclasses(griffe.Extension):
    """Shows the fields and defaults of pydantic's dataclasses as it does those of the standard library's."""

    def on_module_members(self, *, mod: griffe.Module, **_: Any) -> None:
        """Let `dataclass` mean one and the same."""
        imported = mod.members.get("dataclass")
        if isinstance(imported, griffe.Alias) and imported.target_path == "pydantic.dataclasses.dataclass":
            imported.target_path = "dataclasses.dataclass"
