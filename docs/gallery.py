"""Directives for the gallery: ``{example-cards}`` and ``{example} NAME``, from examples/ and docs/images/examples.

A picture that is not there is left out, so that an example can be written before its picture.
"""

from __future__ import annotations

import ast
from pathlib import Path
from typing import Any, ClassVar

from docutils import nodes
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
    path = f"images/examples/{name}.png"
    return path if (DOCS / path).exists() else None


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


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the directives."""
    app.add_directive("example-cards", ExampleCards)
    app.add_directive("example", Example)
    return {"parallel_read_safe": True}
