"""Docstrings of the public names say what is returned and what is raised."""

from __future__ import annotations

import ast
import inspect
import textwrap
from collections.abc import Callable, Iterator
from typing import Any

import pytest

import cmg_mj

FUNCTIONS = (ast.FunctionDef, ast.AsyncFunctionDef)


def callables(name: str) -> Iterator[tuple[str, Callable]]:
    """A public function, or the public methods that a public class defines itself."""
    public: Any = getattr(cmg_mj, name)
    if inspect.isfunction(public):
        yield name, public
    elif inspect.isclass(public):
        for method, function in vars(public).items():
            if inspect.isfunction(function := inspect.unwrap(function)) and not method.startswith("_"):
                yield f"{name}.{method}", function


def body_of(function: Callable) -> ast.FunctionDef:
    (node,) = ast.parse(textwrap.dedent(inspect.getsource(function))).body
    assert isinstance(node, ast.FunctionDef)
    return node


def own_nodes(node: ast.AST) -> Iterator[ast.AST]:
    """All nodes but those of functions inside."""
    for child in ast.iter_child_nodes(node):
        if not isinstance(child, FUNCTIONS):
            yield child
            yield from own_nodes(child)


def missing(function: Callable) -> list[str]:
    """Sections that a docstring lacks. A docstring of one line says itself what is returned."""
    node, text = body_of(function), inspect.getdoc(function) or ""
    nodes = list(own_nodes(node))
    lacks = [] if text else ["a docstring"]
    raises = [child for child in nodes if isinstance(child, ast.Raise) and child.exc is not None]
    if raises and "Raises:" not in text:
        lacks.append("Raises:")
    returns = any(isinstance(child, ast.Return) and child.value is not None for child in nodes)
    if returns and "Args:" in text and not {"Returns:", "Yields:"} & set(text.split()):
        lacks.append("Returns:")
    return lacks


@pytest.mark.parametrize("name", cmg_mj.__all__)
def test_a_public_name_says_what_it_returns_and_raises(name: str) -> None:
    assert {place: lacks for place, function in callables(name) if (lacks := missing(function))} == {}


def test_a_section_that_is_missing_is_seen() -> None:
    def function(number: int) -> int:
        """Add one.

        Args:
            number: The number.
        """
        if number < 0:
            raise ValueError
        return number + 1

    assert missing(function) == ["Raises:", "Returns:"]
