"""The page: meshcat's viewer with Nuno's script around it, live or as one file with a recording in it."""

from __future__ import annotations

import base64
import gzip
import html
from functools import cache
from importlib.util import find_spec
from pathlib import Path as FilePath

from nuno.errors import MissingPackageError

HERE = FilePath(__file__).parent
SCRIPTS = ("stage.js", "things.js", "film.js", "controls.js", "page.js")  # each uses those before it


def live_page() -> str:
    """Return the page that a server gives out."""
    return _page("Nuno", '<script src="/meshcat.js"></script>', "")


def film_page(film: bytes, title: str) -> str:
    """Return a page that needs nothing else, with a film in it.

    Args:
        film: As ``Film.message`` returns it.
        title: The page's title.
    """
    packed = base64.b64encode(gzip.compress(film, 9)).decode()
    data = f'<script type="application/octet-stream" id="film">{packed}</script>'
    return _page(title, _library(), data)


def channel_page() -> str:
    """Return a page that needs nothing else, and gets its messages from the window that it is in."""
    return _page("Nuno", _library(), '<script type="application/octet-stream" id="channel"></script>')


@cache
def mesh_viewer() -> str:
    """Return meshcat's script for browsers, with three.js in it."""
    return (_meshcat() / "dist/main.min.js").read_text(encoding="utf-8")


def _library() -> str:
    folder = _meshcat()
    notices = "\n".join((folder / name).read_text() for name in ("dist/main.min.js.LICENSE.txt", "LICENSE"))
    return f"<!--\n{notices.replace('--', '- -')}\n-->\n<script>\n{mesh_viewer()}\n</script>"


def _page(title: str, library: str, data: str) -> str:
    frame = (HERE / "page.html").read_text(encoding="utf-8")
    parts = "\n".join((HERE / name).read_text(encoding="utf-8") for name in SCRIPTS)
    script = f'<script>\n"use strict";\n(function () {{\n{parts}}})();\n</script>'
    for name, text in (("title", html.escape(title)), ("library", library), ("data", data), ("script", script)):
        frame = frame.replace(f"<!--{name}-->", text, 1)
    return frame


def _meshcat() -> FilePath:
    # its Python part, which would be loaded with it, brings IPython and a server for all the network
    found = find_spec("meshcat")
    if found is None or found.origin is None:
        raise MissingPackageError("meshcat", "viewer", "the viewer's page")
    return FilePath(found.origin).parent / "viewer"
