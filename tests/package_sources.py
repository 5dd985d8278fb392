"""The package's sources, each parsed once for all tests that look through them."""

import ast
from functools import cache
from pathlib import Path

import nuno

PACKAGE = Path(nuno.__file__).parent


@cache
def nodes_of(path):
    """Return all nodes of a module's syntax tree, itself first."""
    return tuple(ast.walk(ast.parse(path.read_text(encoding="utf-8"))))


@cache
def identifiers(path):
    """Return every identifier of a file, its own name among them."""
    fields = (getattr(node, field, None) for node in nodes_of(path) for field in ("id", "attr", "arg", "name"))
    return frozenset((path.stem, *(value for value in fields if isinstance(value, str))))


@cache
def docstrings(path):
    """Return the first lines of a file's docstrings."""
    kinds = ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef
    texts = (ast.get_docstring(node) for node in nodes_of(path) if isinstance(node, kinds))
    return tuple((text or "").partition("\n")[0] for text in texts)
