"""What talks to servers in tests of the wire, and waits for what happens in other threads."""

import json
import time

from websockets.sync.client import connect

PATIENCE = 10.0
"""[s] No wait of these tests takes a tenth of that; one that hangs fails after it."""


class RawClient:
    """A websocket that says what it is told to, whether it is of the protocol or not."""

    def __init__(self, url, **options):
        """Connect."""
        self.socket = connect(url, compression=None, **({"close_timeout": 0.5} | options))

    def say(self, message):
        """Send a text as it is, or anything else as JSON."""
        self.socket.send(message if isinstance(message, (str, bytes)) else json.dumps(message))

    def hear(self, **wanted):
        """Return the next message with these fields."""
        while True:
            message = json.loads(self.socket.recv(timeout=PATIENCE))
            if all(message.get(field) == value for field, value in wanted.items()):
                return message


def until(condition):
    """Wait for what another thread does."""
    end = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < end, "it did not happen"
        time.sleep(0.002)
