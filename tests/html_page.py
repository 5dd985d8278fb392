"""HTML that notebooks show, taken apart."""

from html.parser import HTMLParser

HOSTILE = '<script>alert("1")</script>'


class Page(HTMLParser):
    """HTML taken apart: its tags, the text in them, and which are still open.

    Attributes:
        tags: All that were opened, with their attributes.
        text: All text, one piece after the other.
    """

    def __init__(self, text):
        super().__init__()
        self.tags, self.text, self.open = [], [], []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag, attributes):
        """Note it."""
        self.tags.append((tag, dict(attributes)))
        if tag != "img":
            self.open.append(tag)

    def handle_endtag(self, tag):
        """It closes the last one that was opened."""
        assert self.open.pop() == tag

    def handle_data(self, data):
        """Note it."""
        self.text.append(data)
