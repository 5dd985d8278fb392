"""Viewer: a world in a browser, as it is now."""

from __future__ import annotations

import html
import logging
import math
import os
import sys
import threading
import time
import weakref
import webbrowser
from collections.abc import Iterable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from nuno.bodies.body import Body, Color
from nuno.camera.camera import Camera
from nuno.errors import InvalidInputError, UnknownNameError, ViewerError
from nuno.files.recording import Recording
from nuno.shapes.coordinates import compose, invert
from nuno.validation import finite_array, number
from nuno.viewer.changes import changes, clock
from nuno.viewer.film import Film
from nuno.viewer.marks import DrawnCamera, camera_pose
from nuno.viewer.message import pack
from nuno.viewer.page_server import Server
from nuno.viewer.scene import Scene, checked_places
from nuno.viewer.style import Style, Styles
from nuno.viewer.viewpoint import View
from nuno.viewer.visual_meshes import VisualMeshes
from nuno.world.drawing import Mode
from nuno.world.simulation import CHUNK

if TYPE_CHECKING:
    from nuno.robot.links import Links
    from nuno.world.world import World

logger = logging.getLogger(__name__)

SHARE = 0.02
"""Of a core's time that looking and sending may take; where they take longer, they are done more rarely."""
IDLE = 0.5
"""[s] Between two looks while no page is there, so that the next finds the world about as it is."""


class Viewer:
    """A world in a browser: its bodies, robots, grips, and what else is asked for.

    It looks at the world ``frame_rate`` times a second from a thread of its own, and sends what moved. Robots that
    entered the world are drawn by their visual meshes.

    Args:
        world: The world, single or a batch.
        mode: How bodies are drawn: "surface", "wireframe", or "tetrahedra" (soft bodies; others as surfaces).
        grips: Mark the points that grips hold.
        contacts: Draw the contacts of dynamic bodies as points, with their forces as arrows. Working them out takes
            long; while the world runs, that is done as often as 5 % of the time allows.
        force_scale: Length of those arrows [m/N].
        worlds: Which world of a batch, or which ones side by side; None is all, up to nine.
        spacing: [m] between worlds side by side, along x and y; None is a little more than they need.
        robots: Links whose bodies came into the world as copies, as in an imagined one.
        frame_rate: Looks per second of real time [1/s], at most: fewer where they would take over 2 % of it.
        host: Which of this machine's addresses the page is served at; by default, nothing outside it gets it.
        port: The page's port; None is the first that is free from 7000 on.

    Raises:
        InvalidInputError: no such mode or world, or a value out of range.
        ViewerError: the port is taken.

    Limitations:
        Somebody who reaches ``host`` sees everything; there are no passwords.
    """

    def __init__(
        self, world: World, *, mode: Mode = "surface", grips: bool = True, contacts: bool = False,
        force_scale: float = 0.02, worlds: int | Iterable[int] | None = None,
        spacing: float | tuple[float, float] | None = None, robots: Iterable[Links] = (), frame_rate: float = 30.0,
        host: str = "127.0.0.1", port: int | None = None,
    ) -> None:  # fmt: skip
        self.world = world
        self._interval = 1.0 / number("frame_rate", frame_rate, above=0.0)
        scale = number("force_scale", force_scale, above=0.0)
        self._styles = Styles(Style(mode), grips=bool(grips), contacts=bool(contacts), force_scale=scale)
        self._visual_meshes = VisualMeshes(robots)
        with world.lock:
            self._places = checked_places(world, worlds, spacing)
        self._scene = Scene(world, self._styles, self._visual_meshes, self._places)
        self._view: View | None = None
        self._shown: Film | None = None  # that the page plays in place of the world
        self._turn = threading.RLock()  # whoever looks and sends holds it
        self._wanted = False  # a look by the thread that makes frames, under the world's lock
        self._looked = threading.Event()
        self._piece = 2  # frames of a run between two chances to look
        self._last_chance = time.perf_counter()
        self._stop = threading.Event()
        self._sent_time = self._idle_until = 0.0
        self._look(wait=True)
        self._server = Server(host, port, _weakly(self, Viewer._everything))
        world._watchers.append(self)
        self._thread = threading.Thread(
            target=_follow, args=(weakref.ref(self), self._stop, self._interval), name="nuno-viewer", daemon=True
        )
        self._thread.start()
        logger.info("the viewer of %r is at %s", world, self.url)

    def __enter__(self) -> Viewer:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"<Viewer at {self.url}{'' if self.is_open else ', closed'}>"

    def _repr_html_(self) -> str:
        if not self.is_open:
            return html.escape(repr(self))
        return f'<iframe src="{self.url}" style="width: 100%; height: 500px; border: none"></iframe>'

    @property
    def url(self) -> str:
        """The page's address."""
        return self._server.url

    @property
    def is_open(self) -> bool:
        """Return whether the page is served."""
        return not self._stop.is_set() and self._server.is_open

    @property
    def page_count(self) -> int:
        """Return how many pages look on now."""
        return self._server.client_count

    def show(self, *, open: bool = True) -> Viewer:
        """Open the page in a browser, where there is one with a screen; the address is logged in any case.

        Args:
            open: Whether a browser is opened.

        Returns:
            This viewer, which notebooks show inline.

        Raises:
            ViewerError: the viewer is closed.
        """
        self._check_open()
        logger.info("the viewer of %r is at %s", self.world, self.url)
        if open and _has_screen() and not _in_notebook():
            webbrowser.open(self.url, new=2)
        return self

    def close(self) -> None:
        """End the page and the looking; the world goes on. Nothing where it was closed before."""
        self._stop.set()
        self.world._watchers = [other for other in self.world._watchers if other is not self]
        self._looked.set()
        if threading.current_thread() is not self._thread:
            self._thread.join()
        self._server.close()

    # What is drawn, and how

    def draw(
        self, body: Body | str, mode: Mode = "surface", *, explode: float = 1.3,
        slice_at: tuple[ArrayLike, ArrayLike] | None = None, color: Color | None = None, opacity: float = 1.0,
        visible: bool = True,
    ) -> None:  # fmt: skip
        """Draw a body otherwise from now on.

        Args:
            body: The body, or its name.
            mode: As of ``nuno.draw``.
            explode: Likewise.
            slice_at: Likewise.
            color: In place of its own; None is its own.
            opacity: From above 0 to 1.
            visible: Whether it is drawn at all.

        Raises:
            InvalidInputError: no such mode, or tetrahedra of a body that has none.
            ViewerError: the viewer is closed.
        """
        self._check_open()
        style = Style(mode, explode, slice_at, color, opacity, visible)
        with self.world.lock:
            own = self.world._own(body)
            style.check(own)
        self._styles.own[own.key] = style

    def add_camera(self, name: str, camera: Camera, *, on: Body | str | None = None, depth: float = 0.3) -> None:
        """Draw a camera's frustum from now on; another of the same name takes its place.

        Args:
            name: What it is called.
            camera: The camera, where it is now.
            on: The body that carries it, such as a robot's head; None leaves it where it is.
            depth: How far the frustum is drawn [m].

        Raises:
            InvalidInputError: no camera, or a batch in whose worlds the body is at different places.
            ViewerError: the viewer is closed.
        """
        self._check_open()
        if not isinstance(camera, Camera):
            raise InvalidInputError(f"a camera is a nuno.Camera, got {type(camera).__name__}")
        far = number("depth", depth, above=0.0)
        pose, carrier = camera_pose(camera), None
        if on is not None:
            with self.world.lock:
                carrier = self.world._own(on)
                place, turn = carrier.pose()
            if place.ndim == 2 or turn.ndim == 2:
                raise InvalidInputError(f"{carrier.name!r} is at another place in each world; give its camera no body")
            pose = compose(invert((place, turn)), pose)
        self._styles.cameras[name] = DrawnCamera(camera, carrier, pose, far)

    def remove_camera(self, name: str) -> None:
        """Draw a camera no longer.

        Raises:
            UnknownNameError: there is none of that name.
        """
        if self._styles.cameras.pop(name, None) is None:
            raise UnknownNameError("camera", name, list(self._styles.cameras))

    def look_from(self, eye: ArrayLike, target: ArrayLike, *, field: float = 45.0) -> None:
        """Look from ``eye`` at ``target``, (3,) [m] each, z up; the mouse turns about the target.

        Args:
            eye: Where from.
            target: The middle of the picture.
            field: From the bottom to the top of the picture [deg].

        Raises:
            InvalidInputError: both are the same, or a field not between 0 and 180.
            ViewerError: the viewer is closed.
        """
        a, b = finite_array("eye", eye, (3,)), finite_array("target", target, (3,))
        if np.array_equal(a, b):
            raise InvalidInputError(f"eye and target must be different points, got {a.tolist()} twice")
        opening = number("field", field, above=0.0, high=179.0)
        self._check_open()
        with self._turn:
            low, high = self._scene.bounds()
        reach = max(0.1, 0.5 * float(np.linalg.norm(high - low)), float(np.abs(b - (low + high) / 2.0).max()))
        self._view = View((a[0], a[1], a[2]), (b[0], b[1], b[2]), opening, reach)
        self._server.send(pack({"commands": [self._view.command()]}))

    # What is seen

    def update(self) -> None:
        """Send the world as it is now, without waiting for the next look.

        Raises:
            ViewerError: the viewer is closed.
        """
        self._check_open()
        with self._turn:
            self._send(self._look(wait=True))

    def record(self, path: str | os.PathLike[str] | None = None, *, rate: float = 30.0) -> Film:
        """Record the world from now on, as the viewer draws it; ``Film.save`` writes one .html file.

        Args:
            path: Where the film is saved at the end of a ``with`` block; None does not save it.
            rate: Frames per second of simulated time [1/s].

        Returns:
            The film, which goes on until its ``stop``, or the end of its ``with`` block.

        Raises:
            InvalidInputError: a rate that is not positive, or a path that does not end with .html.
        """
        wanted = number("rate", rate, above=0.0)
        styles = replace(self._styles, own=dict(self._styles.own), cameras=dict(self._styles.cameras))
        film = Film(Scene(self.world, styles, self._visual_meshes, self._places), wanted, path)
        film.view = self._view
        return film

    def play(self, what: Recording | Film, *, world: int | None = None) -> Film:
        """Show a recording, with a time slider, in place of the world; ``live`` shows the world again.

        Args:
            what: The recording, or a film.
            world: Which world of a recorded batch.

        Returns:
            The film that is shown.

        Raises:
            InvalidInputError: neither, or empty.
            ViewerError: the viewer is closed.
        """
        self._check_open()
        if not isinstance(what, Recording | Film):
            raise InvalidInputError(f"play needs a Recording or a Film, got {type(what).__name__}")
        film = Film.of(what, world=world) if isinstance(what, Recording) else what
        film.message()
        with self._turn:
            self._shown = film
        self._server.refresh()
        return film

    def live(self) -> None:
        """Show the world again.

        Raises:
            ViewerError: the viewer is closed.
        """
        self._check_open()
        with self._turn:
            self._shown = None
        self._server.refresh()

    def still(self) -> Film:
        """Return what is seen now as a film of one frame, to be saved as .html."""
        film = self.record()
        film.stop()
        return film

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
                self._scene.look(sparing=True)
            except Exception:  # the world must go on
                logger.exception("the viewer could not look at the world")
            self._looked.set()

    # Within

    def _check_open(self) -> None:
        if not self.is_open:
            raise ViewerError(f"the viewer at {self.url} is closed")

    def _everything(self) -> bytes:
        with self._turn:
            if self._shown is not None:
                return self._shown.message()
            view = self._view or View.around(*self._scene.bounds())
            entered = [obj.entrance() for obj in self._scene.objects]
            return pack({"commands": [{"do": "clear"}, view.command(), *entered, clock(self._scene.time)]})

    def _look(self, wait: bool) -> list[dict[str, Any]]:
        """Look at the world and return what changed; without waiting, only if that does not hold the world up.

        The caller holds ``_turn``. While a look is wanted of the thread that makes frames, nothing is settled.
        """
        lock = self.world.lock
        if wait:
            with lock:
                self._wanted = False
                self._scene.look()
        elif lock.acquire(timeout=0.0):
            try:
                self._wanted = False
                self._scene.look(sparing=True)
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
        if self._shown is None and (commands or self._scene.time != self._sent_time):
            self._server.send(pack({"commands": [*commands, clock(self._scene.time)]}))
            self._sent_time = self._scene.time

    def _follow_once(self) -> None:
        now = time.perf_counter()
        if not self.page_count and now < self._idle_until:
            return
        self._idle_until = now + IDLE
        with self._turn:
            if not self._stop.is_set():
                self._send(self._look(wait=False))


def _follow(reference: weakref.ref[Viewer], stop: threading.Event, interval: float) -> None:
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


def _weakly(viewer: Viewer, method: Any) -> Any:
    """Return a method of the viewer that does not keep it alive."""
    reference = weakref.ref(viewer)

    def call() -> bytes:
        alive = reference()
        return pack({"commands": []}) if alive is None else method(alive)

    return call


def _has_screen() -> bool:
    return sys.platform in ("darwin", "win32") or bool({"DISPLAY", "WAYLAND_DISPLAY"} & set(os.environ))


def _in_notebook() -> bool:
    ipython = sys.modules.get("IPython")
    shell = None if ipython is None else ipython.get_ipython()
    return shell is not None and "IPKernelApp" in getattr(shell, "config", {})
