"""Viewer: a world in a browser, as it is now."""

from __future__ import annotations

import html
import logging
import os
import sys
import webbrowser
from collections.abc import Iterable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from nuno.bodies.body import Body, Color
from nuno.camera.camera import Camera
from nuno.errors import InvalidInputError, UnknownNameError
from nuno.shapes.coordinates import compose, invert
from nuno.validation import checked, finite_array, number
from nuno.viewer.film import Film
from nuno.viewer.following import weakly
from nuno.viewer.marks import DrawnCamera, camera_pose
from nuno.viewer.message import pack
from nuno.viewer.notebook import NotebookChannel, has_widgets, in_notebook
from nuno.viewer.orders import Orders
from nuno.viewer.page_server import LOOPBACK
from nuno.viewer.scene import Scene, checked_places
from nuno.viewer.style import Style, Styles
from nuno.viewer.vertex_values import Quantity
from nuno.viewer.viewpoint import View
from nuno.viewer.visual_meshes import VisualMeshes
from nuno.world.drawing import Mode
from nuno.world.recording import Recording
from nuno.world.simulation import Simulation

if TYPE_CHECKING:
    from nuno.robot.links import Links
    from nuno.world.world import World

logger = logging.getLogger(__name__)


class Viewer(Orders):
    """A world in a browser: its bodies, robots, grips, and what else is asked for.

    It looks at the world ``frame_rate`` times a second from a thread of its own, and sends what moved. Robots that
    entered the world are drawn by their visual meshes.

    Args:
        world: The world, single or a batch.
        mode: How bodies are drawn: "surface", "wireframe", or "tetrahedra" (soft bodies; others as surfaces).
        grips: Mark the points that grips hold.
        contacts: Draw the contacts of dynamic bodies as points, with their forces as arrows. Working them out takes
            long; while the world runs, that is done as often as 5 % of the time allows.
        grip_forces: Draw the forces that grips bear as arrows.
        edges: Draw the borders of cloths and the sharp edges of solids.
        control: Whether the page can pause, step and reset the world, attach and detach bodies; None is for pages of
            this machine only.
        force_scale: Length of those arrows [m/N].
        worlds: Which world of a batch, or which ones side by side; None is all, up to nine.
        spacing: [m] between worlds side by side, along x and y; None is a little more than they need.
        robots: Links whose bodies came into the world as copies, as in an imagined one.
        frame_rate: Looks per second of real time [1/s], at most: fewer where they would take over 2 % of it.
        host: Which of this machine's addresses the page is served at; by default, nothing outside it gets it.
        port: The page's port; None is the first that is free from 7000 to 7099, or any other.

    Raises:
        InvalidInputError: no such mode or world, or a value out of range.
        ViewerError: the port is taken.

    Limitations:
        Somebody who reaches ``host`` sees everything; there are no passwords.
    """

    @checked
    def __init__(
        self, world: World, *, mode: Mode = "surface", grips: bool = True, contacts: bool = False,
        grip_forces: bool = False, edges: bool = True, control: bool | None = None, force_scale: float = 0.02,
        worlds: int | Iterable[int] | None = None, spacing: float | tuple[float, float] | None = None,
        robots: Iterable[Links] = (), frame_rate: float = 30.0, host: str = "127.0.0.1", port: int | None = None,
    ) -> None:  # fmt: skip
        if not isinstance(world, Simulation):
            raise InvalidInputError(f"a viewer needs a World, got {type(world).__name__}")
        interval = 1.0 / number("frame_rate", frame_rate, above=0.0)
        scale = number("force_scale", force_scale, above=0.0)
        styles = Styles(
            Style(mode), grips=bool(grips), contacts=bool(contacts), grip_forces=bool(grip_forces), edges=bool(edges),
            force_scale=scale,
        )  # fmt: skip
        with world.lock:
            places = checked_places(world, worlds, spacing)
        may_control = host in LOOPBACK if control is None else bool(control)
        super().__init__(world, styles, VisualMeshes(robots), places, interval, host, port, may_control)

    def __enter__(self) -> Viewer:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"<Viewer at {self.url}{'' if self.is_open else ', closed'}>"

    def _repr_html_(self) -> str:
        return self.still()._repr_html_() if self.is_open else html.escape(repr(self))

    def _repr_mimebundle_(self, include: Any = None, exclude: Any = None) -> dict[str, Any]:
        """Show the live page in a notebook, through the kernel's own channel; without anywidget, a still scene."""
        if not self.is_open or not has_widgets():
            return {}
        heard = weakly(self, "_hear") if self._can_control else None
        channel = NotebookChannel(weakly(self, "_everything", pack({"commands": []})), heard)
        with self._turn:
            self._channels.append(channel)
        found = channel.widget._repr_mimebundle_()
        bundle: dict[str, Any] = found[0] if isinstance(found, tuple) else found or {}
        return bundle

    @checked
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
        if open and _has_screen() and not in_notebook():
            webbrowser.open(self.url, new=2)
        return self

    # What is drawn, and how

    @checked
    def draw(
        self, body: Body | str, mode: Mode = "surface", *, explode: float = 1.3,
        slice_at: tuple[ArrayLike, ArrayLike] | None = None, color: Color | None = None, opacity: float = 1.0,
        visible: bool = True, color_by: Quantity | None = None, color_range: tuple[float, float] | None = None,
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
            color_by: A quantity that colours its vertices, from dark to bright: "strain" of a cloth or soft body,
                "layer", the layers of a cloth below each of its vertices, or "contact", the contact forces [N]. None is
                its colour.
            color_range: The values of the first and the last colour; None is 0 to 0.05, 4 layers or 0.5 N.

        Raises:
            InvalidInputError: no such mode, tetrahedra of a body that has none, or a quantity that it does not have.
            ViewerError: the viewer is closed.
        """
        self._check_open()
        self._restyle(body, Style(mode, explode, slice_at, color, opacity, visible, color_by, color_range))

    @checked
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

    @checked
    def remove_camera(self, name: str) -> None:
        """Draw a camera no longer.

        Raises:
            UnknownNameError: there is none of that name.
        """
        if self._styles.cameras.pop(name, None) is None:
            raise UnknownNameError("camera", name, list(self._styles.cameras))

    @checked
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
        self._broadcast([self._view.command()])

    # What is seen

    @checked
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

    @checked
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
        self._refresh()
        return film

    def live(self) -> None:
        """Show the world again.

        Raises:
            ViewerError: the viewer is closed.
        """
        self._check_open()
        with self._turn:
            self._shown = None
        self._refresh()

    def still(self) -> Film:
        """Return what is seen now as a film of one frame, to be saved as .html."""
        film = self.record()
        film.stop()
        return film


def _has_screen() -> bool:
    return sys.platform in ("darwin", "win32") or bool({"DISPLAY", "WAYLAND_DISPLAY"} & set(os.environ))
