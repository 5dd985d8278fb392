"""Following a world: looking at it from a thread of its own, and sending what changed to the pages."""

from __future__ import annotations

import logging
import math
import threading
import time
import weakref
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from nuno.errors import ViewerError
from nuno.viewer.changes import changes, clock
from nuno.viewer.film import Film
from nuno.viewer.message import pack
from nuno.viewer.page_server import Server
from nuno.viewer.scene import Scene
from nuno.viewer.viewpoint import View
from nuno.world.simulation import CHUNK

if TYPE_CHECKING:
    from collections.abc import Sequence

    from nuno.viewer.body_objects import Place
    from nuno.viewer.channel import Channel
    from nuno.viewer.style import Styles
    from nuno.viewer.visual_meshes import VisualMeshes
    from nuno.world.world import World

logger = logging.getLogger(__name__)

SHARE = 0.02
"""Of a core's time that looking and sending may take; where they take longer, they are done more rarely."""
POLL = 0.5
"""[s] Between two looks while no page is there, so that the next finds the world about as it is."""
CHANNEL_RATE = 5e5
"""[bytes/s] That pages in notebooks get at most: Jupyter drops messages over 1e6 by default."""


class Following:
    """A world that is followed, and the pages that are kept up to date.

    Args:
        world: The world.
        styles: How bodies are drawn, and what is marked.
        visual_meshes: What is drawn in place of bodies.
        places: Which worlds are looked at, and where they are drawn.
        interval: [s] between two looks, at least.
        host: Which of this machine's addresses the page is served at.
        port: The page's port, or None.
        control: Whether pages may control the world.
    """

    def __init__(
        self, world: World, styles: Styles, visual_meshes: VisualMeshes, places: Sequence[Place], interval: float,
        host: str, port: int | None, control: bool,
    ) -> None:  # fmt: skip
        self.world = world
        self._interval = interval
        self._styles, self._visual_meshes, self._places = styles, visual_meshes, places
        self._scene = Scene(world, styles, visual_meshes, places)
        self._view: View | None = None
        self._shown: Film | None = None  # that the page plays in place of the world
        self._turn = threading.RLock()  # whoever looks and sends holds it
        self._wanted = False  # a look by the thread that makes frames, under the world's lock
        self._looked = threading.Event()
        self._piece = 2  # frames of a run between two chances to look
        self._last_chance = time.perf_counter()
        self._stop = threading.Event()
        self._sent_time = self._polled_until = self._channels_due = 0.0
        self._channels: list[Channel] = []  # pages that no server is needed for, in notebooks
        self._look(wait=True)
        heard = weakly(self, "_hear") if control else None
        self._server = Server(host, port, weakly(self, "_everything", pack({"commands": []})), heard)
        world._watchers.append(self)
        self._thread = threading.Thread(
            target=_follow, args=(weakref.ref(self), self._stop, self._interval), name="nuno-viewer", daemon=True
        )
        self._thread.start()
        logger.info("the viewer of %r is at %s", world, self.url)

    @property
    def url(self) -> str:
        """The page's address."""
        return self._server.url

    @property
    def is_open(self) -> bool:
        """Return True if the page is served."""
        return not self._stop.is_set() and self._server.is_open

    @property
    def page_count(self) -> int:
        """Return how many pages look on now."""
        return self._server.client_count + len(self._channels)

    def close(self) -> None:
        """End the page and the looking; the world goes on. Nothing where it was closed before."""
        self._stop.set()
        self.world._watchers = [other for other in self.world._watchers if other is not self]
        self._looked.set()
        if threading.current_thread() is not self._thread:
            self._thread.join()
        for channel in self._channels:
            channel.close()
        self._channels = []
        self._server.close()

    def update(self) -> None:
        """Send the world as it is now, without waiting for the next look.

        Raises:
            ViewerError: the viewer is closed.
        """
        self._check_open()
        with self._turn:
            self._send(self._look(wait=True))

    @property
    def frames(self) -> int:
        """Return the frames of a run that may go by between two calls of ``seen``; while it is filmed, films say."""
        films = [watcher.frames for watcher in self.world._watchers if isinstance(watcher, Film)]
        return math.gcd(*films) or self._piece

    def seen(self) -> None:
        """Look, if the viewer's thread waits for it; the world calls this under its lock after each piece of a run."""
        now = time.perf_counter()
        spent, self._last_chance = now - self._last_chance, now
        # pieces of a run as long as a picture lasts: shorter ones would only cost
        self._piece = max(1, min(CHUNK, round(self._piece * min(2.0, max(0.5, self._interval / max(spent, 1e-6))))))
        if self._wanted:
            self._wanted = False
            try:
                self._take(sparing=True)
            except Exception:  # the world must go on
                logger.exception("the viewer could not look at the world")
            self._looked.set()

    def _check_open(self) -> None:
        if not self.is_open:
            raise ViewerError(f"the viewer at {self.url} is closed")

    def _take(self, sparing: bool = False) -> None:
        """Take the world's present state in; the caller holds its lock."""
        self._scene.look(sparing)

    def _news(self, everything: bool = False) -> list[dict[str, Any]]:
        """Return commands besides those of the scene: all that a new page needs, or what changed."""
        return []

    def _hear(self, message: str) -> None:
        """Take in what a page says, on the server's thread."""

    def _everything(self) -> bytes:
        with self._turn:
            if self._shown is not None:
                return self._shown.message()
            view = self._view or View.around(*self._scene.bounds())
            entered = [obj.entrance() for obj in self._scene.objects]
            rest = [clock(self._scene.time), *self._news(everything=True)]
            return pack({"commands": [{"do": "clear"}, view.command(), *entered, *rest]})

    def _refresh(self) -> None:
        """Send everything to all pages."""
        self._server.refresh()
        if self._channels:
            message = self._everything()
            for channel in self._channels:
                channel.offer(message)

    def _broadcast(self, commands: list[dict[str, Any]]) -> None:
        message = pack({"commands": commands})
        self._server.send(message)
        if self._channels:
            self._channels = [channel for channel in self._channels if channel.is_open]
            for channel in self._channels:
                channel.offer(message)
            self._channels_due = time.perf_counter() + len(message) / CHANNEL_RATE

    def _look(self, wait: bool) -> list[dict[str, Any]]:
        """Look at the world and return what changed; without waiting, only if that does not hold the world up.

        The caller holds ``_turn``. While a look is wanted of the thread that makes frames, nothing is settled.
        """
        lock = self.world.lock
        if wait:
            with lock:
                self._wanted = False
                self._take()
        elif lock.acquire(timeout=0.0):
            try:
                self._wanted = False
                self._take(sparing=True)
            finally:
                lock.release()
        else:
            if not self._wanted:
                self._looked.clear()
                self._wanted = True
            if not self._looked.wait(self._interval):
                return []  # a long piece of a run, which looks when it is done
        return changes(*self._scene.settle())

    def _send(self, commands: list[dict[str, Any]]) -> None:
        if self._shown is None:
            commands = commands + self._news()
            if commands or self._scene.time != self._sent_time:
                self._sent_time = self._scene.time
                self._broadcast([*commands, clock(self._scene.time)])

    def _follow_once(self) -> None:
        now = time.perf_counter()
        if (not self.page_count and now < self._polled_until) or (self._channels and now < self._channels_due):
            return
        self._polled_until = now + POLL
        with self._turn:
            if not self._stop.is_set():
                self._send(self._look(wait=False))


def _follow(reference: weakref.ref[Following], stop: threading.Event, interval: float) -> None:
    """Look again and again until the viewer is closed or dropped."""
    due, cost = time.perf_counter(), 0.0
    while not stop.is_set():
        due = max(due + max(interval, cost / SHARE), time.perf_counter())
        stop.wait(due - time.perf_counter())
        begin = time.thread_time()  # the frames are held up for as long, more or less: Python does one thing at a time
        viewer = reference()
        if viewer is None:
            return
        try:
            viewer._follow_once()
        except ViewerError:
            return
        except Exception:  # one body that cannot be drawn must not end the viewer
            logger.exception("the viewer could not draw the world")
        viewer = None
        cost += 0.2 * (time.thread_time() - begin - cost)


def weakly(viewer: Following, method: str, otherwise: Any = None) -> Callable[..., Any]:
    """Return a method of the viewer that does not keep it alive, and gives ``otherwise`` when it is gone."""
    reference = weakref.ref(viewer)

    def call(*arguments: Any) -> Any:
        alive = reference()
        return otherwise if alive is None else getattr(alive, method)(*arguments)

    return call
