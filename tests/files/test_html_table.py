"""Tables of notebooks are small HTML in which no text of a user is markup."""

from matplotlib.figure import Figure

from html_page import HOSTILE, Page
from nuno.files.html_table import ROWS, html_table


def test_text_is_escaped():
    """In titles, names of columns, cells, notes and the picture's description."""
    figure = Figure((1, 1))
    page = Page(html_table(HOSTILE, [(HOSTILE, 1)], columns=(HOSTILE, "b"), notes=[HOSTILE], figure=figure))
    assert page.open == []
    assert {tag for tag, _ in page.tags} == {"div", "b", "table", "tr", "th", "td", "img"}
    assert sum(HOSTILE in piece for piece in page.text) == 4
    (image,) = (attributes for tag, attributes in page.tags if tag == "img")
    assert image["alt"] == HOSTILE and image["src"].startswith("data:image/png;base64,") and len(image) == 2


def test_long_tables_are_cut():
    """What is left out is counted."""
    page = Page(html_table("many", [(k, k * k) for k in range(ROWS + 5)]))
    assert sum(tag == "tr" for tag, _ in page.tags) == ROWS
    assert "and 5 more" in page.text


def test_nothing_but_a_title():
    """Without rows there is no table."""
    assert [tag for tag, _ in Page(html_table("empty", [])).tags] == ["div", "b"]
