"""HTML of objects as notebooks show them: a title and a small table, without scripts, all text escaped."""

from __future__ import annotations

import base64
import html
import io
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ROWS = 20
"""More rows than this are counted, and not shown."""

FIGURE_DPI = 60
"""Of a figure that goes with a table [1/inch]: some tens of kB."""


def html_table(
    title: str, rows: Iterable[Sequence[Any]], *, columns: Sequence[str] = (), notes: Iterable[str] = (),
    figure: Figure | None = None,
) -> str:  # fmt: skip
    """Return HTML with a title, a table, notes below it, and a small picture of a figure.

    Args:
        title: The title.
        rows: The cells of each row; what is no string is shown as ``str`` does.
        columns: The names of the columns; none where the first cell of each row names it.
        notes: A line each.
        figure: Drawn below, in colours for a white page.
    """
    every = [[str(cell) for cell in row] for row in rows]
    shown = every[:ROWS]
    lines = ["<div>", f"<b>{html.escape(title)}</b>"]
    if shown or columns:
        lines.append("<table>")
        if columns:
            lines.append("<tr>" + "".join(f"<th>{html.escape(name)}</th>" for name in columns) + "</tr>")
        lines += ["<tr>" + "".join(f"<td>{html.escape(cell)}</td>" for cell in row) + "</tr>" for row in shown]
        lines.append("</table>")
    if len(every) > len(shown):
        lines.append(f"<div>and {len(every) - len(shown)} more</div>")
    lines += [f"<div>{html.escape(note)}</div>" for note in notes]
    if figure is not None:
        stream = io.BytesIO()
        figure.savefig(stream, format="png", dpi=FIGURE_DPI)
        data = base64.b64encode(stream.getvalue()).decode()
        lines.append(f'<img src="data:image/png;base64,{data}" alt="{html.escape(title, quote=True)}">')
    return "\n".join([*lines, "</div>"])
