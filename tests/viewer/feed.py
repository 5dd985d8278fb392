"""What a page receives from a viewer, for tests without a browser."""

import asyncio
import json
import struct
import threading
import time

import numpy as np
from tornado.websocket import websocket_connect

TYPES = {"f4": np.float32, "u1": np.uint8, "u2": np.uint16, "u4": np.uint32}


def unpack(message):
    """Return a message's commands, with their arrays."""
    (length,) = struct.unpack_from("<I", message)
    blobs = message[4 + length :]

    def found(entry):
        if isinstance(entry.get("array"), dict):
            own = entry["array"]
            return np.frombuffer(blobs, TYPES[own["type"]], own["count"], own["at"])
        return entry

    return json.loads(message[4 : 4 + length], object_hook=found)["commands"]


class Feed:
    """A page's connection, read on a thread of its own.

    Attributes:
        commands: All that came, in order.
        things: What a page would now draw, by number: points, pose and colours.
        latest: The last command of each kind.
    """

    def __init__(self, viewer):
        self.url = viewer.url
        self.commands, self.things, self.is_closed = [], {}, False
        self.latest = {}
        self._socket = self._loop = None
        self._thread = threading.Thread(target=lambda: asyncio.run(self._read()), daemon=True)
        self._thread.start()
        self.wait_for(lambda: self.commands)

    def wait_for(self, condition):
        """Wait until something is true, however long that takes; what ends a test that hangs is pytest's timeout."""
        while not condition():
            assert self._thread.is_alive() or condition(), "the connection ended before it came true"
            time.sleep(0.01)

    def say(self, do, **order):
        """Send what a page would send."""
        self._loop.call_soon_threadsafe(self._socket.write_message, json.dumps({"do": do, **order}))

    def paths(self):
        """Return the paths of all that would be drawn."""
        return sorted("/".join(thing["path"]) for thing in list(self.things.values()))

    def named(self, *path):
        """Return the thing of a path."""
        (found,) = (thing for thing in list(self.things.values()) if thing["path"] == list(path))
        return found

    async def _read(self):
        socket = await websocket_connect(self.url.replace("http", "ws") + "feed", max_message_size=1 << 27)
        self._socket, self._loop = socket, asyncio.get_running_loop()
        while True:
            message = await socket.read_message()
            if message is None:
                self.is_closed = True
                return
            for command in unpack(message):
                self._obey(command)
                self.latest[command["do"]] = command
                self.commands.append(command)

    def _obey(self, command):
        do = command["do"]
        if do == "clear":
            self.things.clear()
        elif do == "enter":
            self.things[command["id"]] = command
        elif do == "leave":
            for number in command["ids"]:
                self.things.pop(number, None)
        elif do == "place":
            for number, pose in zip(command["ids"], command["poses"].reshape(-1, 7), strict=True):
                self.things[number]["pose"] = pose
        elif do == "shift":
            self.things[command["id"]]["points"] = command["points"]
        elif do == "tint":
            self.things[command["id"]]["colors"] = command["colors"]
