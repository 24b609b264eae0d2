"""Counts style: python .ci/style.py [ROOT] [--worst 20] [--json] (three seconds).

Pages, docstrings, help texts and messages of a checkout, by default of this one. One row a page or group:

- words: as `wc -w` counts them; in code, the words of the texts.
- sentences: in paragraphs, list items and table cells, of three words or more; headings and code are none.
- long: sentences of more than 25 words.
- openers: sentences that begin with Of, What, That of or Those; docstrings also with As, How, Whether or Which.
- colons: sentences with two or more colons and semicolons.
- banned: words for which the bench has another (`BANNED`).
- wide: lines of prose over 100 columns, without tables, code, link targets, headings and pictures.
- widest: columns of the longest such line.
"""

from __future__ import annotations

import argparse
import ast
import inspect
import json
import re
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import NamedTuple

from markdown_it import MarkdownIt
from tabulate import tabulate

MOST_WORDS = 25
MOST_COLUMNS = 100
OPENERS = re.compile(r"\W*(Of|What|That of|Those)\b")
DOCSTRING_OPENERS = re.compile(r"\W*(Of|What|That of|Those|As|How|Whether|Which)\b")
BANNED = {
    r"\b(rides?|riding|rode)\b": "open loop",
    r"\bcompanions?\b": "open loop",
    r"\bcubes?\b": "module",
    r"\b(a|the|each|every|per|one|next|last) beats?\b": "sample time",
    r"\bleft out\b": "discard, omit",
    r"\b(bears?|bore|borne)\b(?! in mind)": "tolerate, recover from",
    r"\btold\b": "given",
    r"\bgives? way\b": "is free to move",
    r"\bstands at e\b": "tolerates",
}
"""Patterns, and the words to use instead."""
EVIDENCE = {"results", "reproduced", "beyond", "mutations", "assumptions", "sensor_errors"}
"""Stems of the pages that hold evidence and may be long, beside those that end in `_evidence`."""
CODE_FOLDERS = ("cmg_mj", "examples", "docs/studies")

_SENTENCE_END = re.compile(r"(?<=[.!?])[\"')\]*]*\s+(?=[\"'(\[*`]*[A-Z0-9`])")
_ABBREVIATION = re.compile(r"\b(e\.g|i\.e|vs|cf|Fig|Figs|Eq|Sec|No|approx|resp)\.$")
_DEFAULT = re.compile(r"\s*\[default: .*\]$")
_CODE = re.compile(r"`[^`]*`")
_SECTION = re.compile(r"^(Args|Attributes|Returns|Yields|Raises|Note|Notes|Example|Examples):$")
_ENTRY = re.compile(r"^(\*{0,2}[\w.]+)( \([^)]*\))?: ")


class Text(NamedTuple):
    """A piece of prose: a paragraph, a table cell, a part of a docstring, a help text or a message."""

    place: str
    text: str
    opens_docstring: bool = False


class Sentence(NamedTuple):
    """A sentence and where it is."""

    place: str
    text: str
    opens_docstring: bool

    @property
    def plain(self) -> str:
        """The sentence with one letter for each piece of code."""
        return _CODE.sub("X", self.text)

    @property
    def words(self) -> int:
        """How many words it has; a piece of code is one."""
        return len(re.findall(r"\S*\w\S*", self.plain))

    def faults(self) -> list[str]:
        """Return the rules that it breaks."""
        plain = self.plain
        openers = DOCSTRING_OPENERS if self.opens_docstring else OPENERS
        return [
            *["long"] * (self.words > MOST_WORDS),
            *["openers"] * bool(openers.match(plain)),
            *["colons"] * (len(re.findall(r"[:;](?=\s|$)", plain)) > 1),
            *["banned"] * sum(len(re.findall(pattern, plain, re.IGNORECASE)) for pattern in BANNED),
        ]


@dataclass
class Counts:
    """A row of the table."""

    what: str
    words: int = 0
    sentences: int = 0
    long: int = 0
    openers: int = 0
    colons: int = 0
    banned: int = 0
    wide: int = 0
    widest: int = 0

    def add(self, sentences: list[Sentence]) -> None:
        """Count sentences."""
        self.sentences += len(sentences)
        for sentence in sentences:
            for fault in sentence.faults():
                setattr(self, fault, getattr(self, fault) + 1)


# --- sentences -----------------------------------------------------------------------------------------------


def sentences(texts: list[Text]) -> list[Sentence]:
    """Split texts into sentences of three words or more."""
    found = []
    for place, text, opens_docstring in texts:
        parts: list[str] = []
        for part in _SENTENCE_END.split(" ".join(text.split())):
            if parts and _ABBREVIATION.search(parts[-1]):
                parts[-1] += f" {part}"
            else:
                parts.append(part)
        found += [Sentence(place, part, opens_docstring and not i) for i, part in enumerate(parts)]
    return [sentence for sentence in found if len(re.findall(r"[A-Za-z]{2,}|X", sentence.plain)) > 2]


# --- pages ---------------------------------------------------------------------------------------------------


def pages(root: Path) -> list[Path]:
    """Return the pages of a checkout."""
    top = (root / f"{name}.md" for name in ("README", "CONTRIBUTING", "CHANGELOG", "SECURITY"))
    return [*(page for page in top if page.exists()), *sorted((root / "docs").glob("*.md"))]


def is_evidence(page: Path) -> bool:
    """Return whether a page holds evidence."""
    return page.stem in EVIDENCE or page.stem.endswith("_evidence")


def page_texts(page: Path) -> list[Text]:
    """Return paragraphs, list items and table cells of a page."""
    texts, heading, line = [], False, 1
    for token in MarkdownIt().enable("table").parse(page.read_text(encoding="utf-8")):
        heading = token.type == "heading_open" or (heading and token.type != "heading_close")
        line = token.map[0] + 1 if token.map else line
        if token.type == "inline" and not heading:
            parts = [
                f"`{child.content}`" if child.type == "code_inline" else " " if "break" in child.type else child.content
                for child in token.children or []
            ]
            texts.append(Text(f"{page.name}:{line}", "".join(parts)))
    return texts


def wide_lines(page: Path) -> dict[int, int]:
    """Return columns of the lines over 100, by line number.

    Tables, code, link targets, headings and pictures do not count: they cannot be wrapped.
    """
    text = page.read_text(encoding="utf-8")
    skipped: set[int] = set()
    for token in MarkdownIt().enable("table").parse(text):
        if token.type in ("table_open", "fence", "code_block", "html_block") and token.map:
            skipped.update(range(*token.map))
    unbroken = r"\]\([^)]*\)|^\[[^]]+\]: .*|^#.*|^!\[.*"
    shown = [re.sub(unbroken, "]", line) for line in text.splitlines()]
    return {i + 1: len(s) for i, s in enumerate(shown) if i not in skipped and len(s) > MOST_COLUMNS}


def count_page(page: Path) -> Counts:
    """Return a page's row."""
    wide = wide_lines(page)
    counts = Counts(page.name, words=len(page.read_text(encoding="utf-8").split()), wide=len(wide))
    counts.widest = max(wide.values(), default=0)
    counts.add(sentences(page_texts(page)))
    return counts


# --- code ----------------------------------------------------------------------------------------------------


def code_texts(root: Path, folder: str) -> dict[str, list[Text]]:
    """Return docstrings of the Python files of a folder, help texts and messages, as a list each."""
    found: dict[str, list[Text]] = {"docstrings": [], "help": [], "messages": []}
    for path in sorted((root / folder).rglob("*.py")):
        place = path.relative_to(root).as_posix()
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if (
                isinstance(node, ast.Expr)
                and isinstance(node.value, ast.Constant)
                and isinstance(node.value.value, str)
            ):
                found["docstrings"] += _docstring(f"{place}:{node.lineno}", node.value.value)
            elif isinstance(node, ast.keyword) and node.arg in ("help", "short_help", "epilog"):
                texts = [_DEFAULT.sub("", text) for text in _literals(node.value)]
                found["help"] += [Text(f"{place}:{node.value.lineno}", text) for text in texts]
            elif isinstance(node, ast.Raise) and isinstance(node.exc, ast.Call):
                texts = [text for argument in node.exc.args for text in _literals(argument)]
                found["messages"] += [Text(f"{place}:{node.lineno}", text) for text in texts]
    return found


def _literals(node: ast.expr) -> Iterator[str]:
    """Strings of an expression, with X for what is formatted in."""
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        yield node.value
    elif isinstance(node, ast.JoinedStr):
        yield "".join(str(part.value) if isinstance(part, ast.Constant) else "X" for part in node.values)
    elif isinstance(node, ast.BinOp):
        yield from _literals(node.left)


def _docstring(place: str, docstring: str) -> Iterator[Text]:
    """Paragraphs, list items and entries of a docstring, without indented code."""
    texts, in_section = [""], False
    for line in inspect.cleandoc(docstring).splitlines():
        text, is_indented = line.strip(), line.startswith("    ")
        is_heading = bool(_SECTION.match(text))
        in_section = is_heading or (in_section and (is_indented or not text))
        if is_heading or not text or (is_indented and not in_section):
            texts.append("")
        elif text.startswith("- ") or (in_section and _ENTRY.match(text)):
            texts.append(_ENTRY.sub("", text.removeprefix("- ")))
        else:
            texts[-1] += f" {text}"
    for i, text in enumerate(texts):
        if text:
            yield Text(place, text, opens_docstring=not i)


def count_code(root: Path) -> list[tuple[Counts, list[Sentence]]]:
    """Return a row, and its sentences, for the docstrings of each folder, for help texts and for messages."""
    rows = []
    for folder in CODE_FOLDERS:
        for kind, texts in code_texts(root, folder).items():
            if kind == "docstrings" or folder == "cmg_mj":
                counts, found = Counts(f"{kind} of {folder}"), sentences(texts)
                counts.words = sum(len(text.text.split()) for text in texts)
                counts.add(found)
                rows.append((counts, found))
    return rows


# --- the command ---------------------------------------------------------------------------------------------


def total(what: str, rows: list[Counts]) -> Counts:
    """Return the sum of rows, and the longest line of all."""
    fields = [name for name in Counts.__dataclass_fields__ if name not in ("what", "widest")]
    sums = {name: sum(getattr(row, name) for row in rows) for name in fields}
    return Counts(what, **sums, widest=max((row.widest for row in rows), default=0))


def main() -> None:
    """Print the counts of a checkout."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("root", nargs="?", type=Path, default=Path(__file__).parent.parent, help="A checkout.")
    parser.add_argument("--worst", type=int, default=0, metavar="N", help="Also print the N worst sentences.")
    parser.add_argument("--only", default="", metavar="PART", help="Only files whose place contains PART.")
    parser.add_argument("--json", action="store_true", help="Print JSON.")
    options = parser.parse_args()

    on_pages = [(count_page(page), sentences(page_texts(page))) for page in pages(options.root)]
    in_code = count_code(options.root)
    page_rows, code_rows = [row for row, _ in on_pages], [row for row, _ in in_code]
    rows = [*page_rows, total("all pages", page_rows), *code_rows, total("pages and code", [*page_rows, *code_rows])]
    guides = [count for count in page_rows if not is_evidence(Path(count.what)) and count.what != "CHANGELOG.md"]
    longest = max(guides, key=lambda count: count.words)

    found = [sentence for _, part in [*on_pages, *in_code] for sentence in part if options.only in sentence.place]
    faulty = [sentence for sentence in found if sentence.faults()]
    worst = sorted(faulty, key=lambda one: (-len(one.faults()), -one.words))[: options.worst]
    if options.json:
        print(json.dumps({"rows": [asdict(row) for row in rows], "longest_page": longest.what}, indent=2))
        return
    print(tabulate([asdict(row) for row in rows], headers="keys", tablefmt="pipe"))
    print(f"\nLongest page outside evidence: {longest.what}, {longest.words} words.")
    for one in worst:
        print(f"\n{one.place}: {', '.join(one.faults())}, {one.words} words\n  {one.text}")


if __name__ == "__main__":
    main()
