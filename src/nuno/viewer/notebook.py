"""The viewer in a notebook: its page gets its messages from the kernel, wherever that runs."""

from __future__ import annotations

import json
import logging
import sys
from collections.abc import Callable
from functools import cache
from importlib.util import find_spec
from pathlib import Path as FilePath
from typing import Any

from nuno.viewer.message import pack
from nuno.viewer.page import channel_page

logger = logging.getLogger(__name__)


def in_notebook() -> bool:
    """Return True if the program runs in the kernel of a notebook."""
    ipython = sys.modules.get("IPython")
    shell = None if ipython is None else ipython.get_ipython()
    return shell is not None and "IPKernelApp" in getattr(shell, "config", {})


def has_widgets() -> bool:
    """Return True if anywidget is installed, which the live page needs (``nuno-sim[notebook]``)."""
    return find_spec("anywidget") is not None


class NotebookChannel:
    """A page in a notebook, shown by a widget.

    Args:
        everything: Returns the message that brings a new page up to date.
        heard: Called with each message of the page; None lets it say nothing.

    Attributes:
        widget: The widget, for IPython to display.
    """

    def __init__(self, everything: Callable[[], bytes], heard: Callable[[str], None] | None) -> None:
        self._everything, self._heard = everything, heard
        self.widget: Any = _widget_class()(page=channel_page(), first=everything())
        self.widget.on_msg(self._take)

    @property
    def is_open(self) -> bool:
        """Return True if the widget is still there."""
        return self.widget.comm is not None

    def offer(self, message: bytes) -> None:
        """Send a message after those before."""
        self.widget.send({"do": "obey"}, buffers=[message])

    def close(self) -> None:
        """Say in the page that the viewer is closed; what it shows stays."""
        if self.is_open:
            self.offer(pack({"commands": [{"do": "notice", "text": "The viewer is closed."}]}))

    def _take(self, _: Any, order: Any, __: Any) -> None:
        if isinstance(order, dict) and order.get("do") == "hello":
            self.offer(self._everything())
        elif self._heard is not None:
            self._heard(json.dumps(order))


@cache
def _widget_class() -> Any:
    import anywidget
    import traitlets

    class PageWidget(anywidget.AnyWidget):  # type: ignore[misc]
        """The page in a frame.

        Attributes:
            page: The page itself.
            first: The message that it begins with.
        """

        _esm = (FilePath(__file__).parent / "notebook.js").read_text(encoding="utf-8")
        page = traitlets.Unicode().tag(sync=True)
        first = traitlets.Bytes().tag(sync=True)

    return PageWidget
