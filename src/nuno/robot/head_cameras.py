"""Head cameras: what the cameras on a robot's head see, its own arms included."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.bodies.body import Body
from nuno.camera.camera import Camera
from nuno.camera.picture import Chequer, Lamp, Picture, take_picture
from nuno.errors import InvalidInputError, UnknownNameError
from nuno.robot.hands import carrier
from nuno.robot.looks import looks_of
from nuno.robot.sensor_model import EARLY
from nuno.shapes.color import rgb
from nuno.shapes.coordinates import Coordinates, compose
from nuno.validation import checked, number

if TYPE_CHECKING:
    from nuno.robot.links import Links

STEREO = ("head_left", "head_right")
LOOKS = ("visual", "collision")


class HeadCameras:
    """Cameras of a robot that is in a world.

    Each ``look`` gives a picture of every camera: colour, depth and which body is seen where. A camera is where the
    link is that carries it, and the robot is drawn as it looks, at its links' places in the world.

    Args:
        links: The robot's links in the world.
        names: Which cameras, of the robot's description.
        size: Times the description's pixels each way.
        looks: "visual": the robot's visual meshes in place of its collision shapes; "collision": those.
        lamp: The light; None is one above.
        background: Colour where nothing is.
        patterns: Chequers of bodies (or names).
        samples: Each pixel's colour is the mean of so many by so many.
        noise: Standard deviation of each pixel's channels [levels of 255].
        rate: Pictures a second [1/s]; None takes them whenever asked. In between the last ones stand.
        latency: How long after they were taken pictures are given [s].
        seed: Of the noise; every picture has another.

    Raises:
        UnknownNameError: the robot has no such camera.
        InvalidInputError: a value that cannot be used.
    """

    @checked
    def __init__(
        self, links: Links, names: Sequence[str] = STEREO, *, size: float = 1.0, looks: str = "visual",
        lamp: Lamp | None = None, background: Any = (0.62, 0.66, 0.7), patterns: Mapping[Any, Chequer] | None = None,
        samples: int = 1, noise: float = 0.0, rate: float | None = None, latency: float = 0.0, seed: int = 0,
    ) -> None:  # fmt: skip
        if looks not in LOOKS:
            raise InvalidInputError(f"looks must be one of {LOOKS}, got {looks!r}")
        rgb(background)
        cameras = links.robot.description.cameras
        for name in names:
            if name not in cameras:
                raise UnknownNameError("camera", name, list(cameras))
        self.links, self.names = links, tuple(names)
        self._scale = number("size", size, above=0.0)
        self._rate = None if rate is None else number("rate", rate, above=0.0)
        self._latency, self._seed, self._taken = number("latency", latency, low=0.0), int(seed), 0
        self._options: dict[str, Any] = {
            "lamp": lamp, "background": background, "patterns": patterns, "samples": samples, "noise": noise,
        }  # fmt: skip
        self._carriers = {name: carrier(links, cameras[name].frame) for name in self.names}
        self._instead = _visual_bodies(links) if looks == "visual" else {}
        self._last = -np.inf
        self._coming: deque[tuple[float, dict[str, Picture]]] = deque()
        self._delivered: tuple[float, dict[str, Picture]] | None = None

    @checked
    def camera(self, name: str) -> Camera:
        """Return a camera where its link is now.

        Raises:
            UnknownNameError: it is none of these.
        """
        if name not in self._carriers:
            raise UnknownNameError("camera", name, list(self._carriers))
        body, offset = self._carriers[name]
        own = self.links.robot.description.cameras[name]
        ahead = (np.array((own.aside, 0.0, own.ahead)), np.array((1.0, 0.0, 0.0, 0.0)))
        place, turn = compose(compose(body.pose(), offset), ahead)
        made = self.links.robot.camera(name)
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = _matrix(turn), place
        return replace(made, camera_to_world=pose).scaled(self._scale)

    def look(self) -> dict[str, Picture]:
        """Return the newest picture that has arrived of every camera, by name; all were taken at one time."""
        world = self.links.world
        with world.lock:
            now = world.time
            if self._delivered is not None and now < self._last - EARLY:
                self._coming.clear()  # a world that was restored
                self._delivered, self._taken = None, 0
            self._last = now
            newest = self._coming[-1] if self._coming else self._delivered
            due = newest is None or self._rate is None or now >= newest[0] + 1.0 / self._rate - EARLY
            if due:
                self._coming.append((now, self._take()))
        while self._coming and (self._delivered is None or self._coming[0][0] + self._latency <= now + EARLY):
            self._delivered = self._coming.popleft()
        assert self._delivered is not None
        return self._delivered[1]

    def look_from(self, camera: Camera) -> Picture:
        """Return a picture from a camera anywhere, with the same light, patterns and looks, taken now."""
        with self.links.world.lock:
            return self._picture(camera)

    def _take(self) -> dict[str, Picture]:
        return {name: self._picture(self.camera(name)) for name in self.names}

    def _picture(self, camera: Camera) -> Picture:
        for body, others in self._instead.items():
            for each, offset in others:
                each._position, each._quaternion = compose(body.pose(), offset)
        instead = {body: [each for each, _ in others] for body, others in self._instead.items()}
        self._taken += 1
        seed = self._seed * 1_000_003 + self._taken
        return take_picture(self.links.world, camera, instead=instead, seed=seed, **self._options)


def _visual_bodies(links: Links) -> dict[Body, list[tuple[Body, Any]]]:
    """Return the links' looks, by the bodies that stand for them in the world, and where in the bodies' frames."""
    drawn: dict[Body, list[tuple[Body, Any]]] = {body: [] for body in links.bodies}
    for look in looks_of(links):
        own = look.shape
        body = Body(own.shape, name=f"{links.robot.name}/{own.link}", color=own.color)
        drawn[links.bodies[look.body]].append((body, look.pose))
    return drawn


def _matrix(turn: np.ndarray) -> np.ndarray:
    return Coordinates(quaternion=turn).rotation
