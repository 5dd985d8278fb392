"""A headless Chromium that a test looks through, driven over its debugging protocol."""

import asyncio
import base64
import json
import shutil
import subprocess
import tempfile
import time
import urllib.request
from pathlib import Path

import cv2
import numpy as np
import pytest
from tornado.websocket import websocket_connect

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
CHROMIUM = next((found for name in NAMES if (found := shutil.which(name))), None)
needs_chromium = pytest.mark.skipif(
    CHROMIUM is None, reason=f"no Chromium is installed (looked for {', '.join(NAMES)})"
)
FLAGS = (
    "--headless=new", "--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
    "--ignore-gpu-blocklist", "--disable-quic", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync", "--disable-dev-shm-usage", "--hide-scrollbars",
    "--remote-debugging-port=0", "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1",
)  # fmt: skip


class Browser:
    """One page of a browser, in which no host but this machine can be reached.

    Attributes:
        requests: The addresses that the page asked for.
        complaints: What its console and its scripts said.
    """

    def __init__(self, width=800, height=600):
        self.size = (width, height)
        self.requests, self.complaints = [], []
        self._number = 0
        self._folder = tempfile.mkdtemp()
        command = [CHROMIUM, *FLAGS, f"--user-data-dir={self._folder}", "about:blank"]
        self._process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        self._loop = asyncio.new_event_loop()

    def __enter__(self):
        try:
            self._loop.run_until_complete(self._connect())
        except BaseException:
            self.__exit__(None, None, None)
            raise
        return self

    def __exit__(self, *error):
        self._process.terminate()
        try:
            self._process.wait(60)
        except subprocess.TimeoutExpired:  # a busy machine, or one page that hangs
            self._process.kill()
            self._process.wait()
        self._loop.close()
        shutil.rmtree(self._folder, ignore_errors=True)

    def open(self, url):
        """Go to a page of Nuno's, and wait until it has drawn what it got."""
        self.call("Page.navigate", url=url)
        self.wait_for("window.nuno && window.nuno.ready()")

    def evaluate(self, script):
        """Return what a script gives."""
        answer = self.call("Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in answer, answer["exceptionDetails"]
        return answer["result"].get("value")

    def wait_for(self, script):
        """Wait until a script gives something true, however long that takes."""
        while not self.evaluate(script):
            assert self._process.poll() is None, f"Chromium ended before {script} came true; {self.complaints}"
            time.sleep(0.05)

    def picture(self):
        """Return what is seen, (height, width, 3) uint8, red, green and blue."""
        self.wait_for("window.nuno.ready()")
        # one more picture for certain: the compositor may lag behind
        self.evaluate("new Promise(r => requestAnimationFrame(() => requestAnimationFrame(() => r(true))))")
        png = base64.b64decode(self.call("Page.captureScreenshot", format="png")["data"])
        return cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_COLOR)[..., ::-1]

    def call(self, method, **parameters):
        """Call the debugging protocol and return its answer."""
        return self._loop.run_until_complete(self._call(method, parameters))

    async def _call(self, method, parameters):
        self._number += 1
        await self._socket.write_message(json.dumps({"id": self._number, "method": method, "params": parameters}))
        while True:
            message = json.loads(await self._socket.read_message())
            if message.get("method") == "Network.requestWillBeSent":
                self.requests.append(message["params"]["request"]["url"])
            elif message.get("method") in ("Runtime.exceptionThrown", "Log.entryAdded"):
                self.complaints.append(message["params"])
            elif message.get("id") == self._number:
                assert "error" not in message, message["error"]
                return message["result"]

    async def _connect(self):
        port_file = Path(self._folder) / "DevToolsActivePort"
        while not port_file.exists() or len(port_file.read_text().split()) < 2:
            assert self._process.poll() is None, "Chromium did not start"
            await asyncio.sleep(0.05)
        port = port_file.read_text().split()[0]
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/json/list") as answer:
            target = next(page for page in json.load(answer) if page["type"] == "page")
        self._socket = await websocket_connect(target["webSocketDebuggerUrl"], max_message_size=1 << 27)
        for domain in ("Page", "Runtime", "Network", "Log"):
            await self._call(f"{domain}.enable", {})
        size = {"width": self.size[0], "height": self.size[1], "deviceScaleFactor": 1, "mobile": False}
        await self._call("Emulation.setDeviceMetricsOverride", size)


def save_picture(picture, path):
    """Write a picture, for people."""
    cv2.imwrite(str(path), picture[..., ::-1])
