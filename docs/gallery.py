"""Directives of the gallery: ``{example-cards}``, ``{example} NAME`` and ``{notebook} NAME``.

A picture that is not there is left out, so that an example can be written before its picture.
"""

from __future__ import annotations

import ast
import json
from pathlib import Path
from typing import Any, ClassVar

from docutils import nodes
from make_pictures import PICTURES
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

DOCS = Path(__file__).parent
EXAMPLES = DOCS.parent / "examples"


def summary(name: str) -> str:
    """Return the first paragraph of an example's docstring, on one line."""
    text = ast.get_docstring(ast.parse((EXAMPLES / f"{name}.py").read_text(encoding="utf-8"))) or ""
    return " ".join(text.split("\n\n")[0].split())


def picture(name: str) -> str | None:
    """Return the path of an example's picture as a page at the top of docs/ writes it, or None."""
    path = f"images/{next(iter(PICTURES[name][0][1]))}" if name in PICTURES else ""
    return path if path and (DOCS / path).exists() else None


class ExampleCards(SphinxDirective):
    """Cards with pictures that lead to the examples named in the content, one a line."""

    has_content = True

    def run(self) -> list[nodes.Node]:
        """Return a grid of cards."""
        lines = ["::::{grid} 2 2 3 4", ":gutter: 2", ""]
        for name in self.content:
            image = picture(name)
            lines += [f":::{{grid-item-card}} {name.replace('_', ' ')}", f":link: {name}", ":link-type: ref"]
            lines += [f":img-bottom: {image}"] if image else []
            lines += ["", summary(name) if not image else "", ":::"]
        return self.parse_text_to_nodes("\n".join([*lines, "::::"]))


class Example(SphinxDirective):
    """What an example does, its picture, and its source folded away."""

    required_arguments = 1
    option_spec: ClassVar[dict[str, Any]] = {}

    def run(self) -> list[nodes.Node]:
        """Return a paragraph, an image and a dropdown."""
        name = self.arguments[0]
        image = picture(name)
        lines = [summary(name), ""]
        lines += (
            [f"```{{image}} {image}", f":alt: what examples/{name}.py draws", ":width: 100%", "```", ""]
            if image
            else []
        )
        lines += [f"::::{{dropdown}} examples/{name}.py", f"```{{literalinclude}} ../examples/{name}.py", "```", "::::"]
        return self.parse_text_to_nodes("\n".join(lines))


class Notebook(SphinxDirective):
    """The first paragraph of a notebook, and its cells folded away."""

    required_arguments = 1
    option_spec: ClassVar[dict[str, Any]] = {}

    def run(self) -> list[nodes.Node]:
        """Return a paragraph and a dropdown."""
        path = EXAMPLES / "notebooks" / f"{self.arguments[0]}.ipynb"
        first, *cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
        lines = ["".join(first["source"]).partition("\n\n")[2], ""]
        lines.append(f"::::{{dropdown}} examples/notebooks/{path.name}")
        for cell in cells:
            text = "".join(cell["source"])
            lines += [text if cell["cell_type"] == "markdown" else f"```python\n{text}\n```", ""]
        return self.parse_text_to_nodes("\n".join([*lines, "::::"]))


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the directives."""
    app.add_directive("example-cards", ExampleCards)
    app.add_directive("example", Example)
    app.add_directive("notebook", Notebook)
    return {"parallel_read_safe": True}
