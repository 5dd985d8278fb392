"""SimulatedCameras: the cameras of a robot in a world, each made when it is first looked through."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from nuno.camera.camera import Camera
from nuno.robot.head_cameras import HeadCameras

if TYPE_CHECKING:
    from nuno.camera.picture import Picture
    from nuno.robot.links import Links


class SimulatedCameras:
    """The cameras of a description.

    Args:
        links: The robot's links in the world.
        given: Cameras that see otherwise than the description says; None where all see so.
    """

    def __init__(self, links: Links, given: HeadCameras | None = None) -> None:
        self._links = links
        self._eyes: dict[str, HeadCameras] = {} if given is None else dict.fromkeys(given.names, given)

    def look(self, cameras: Sequence[str]) -> dict[str, Picture]:
        """Return what cameras of the description see at one time, by name."""
        with self._links.world.lock:
            looks = {eyes: eyes.look() for eyes in dict.fromkeys(self._of(name) for name in cameras)}
            return {name: looks[self._of(name)][name] for name in cameras}

    def pixels(self, camera: Camera, name: str) -> Camera:
        """Return a camera with the pixels that its images have."""
        with self._links.world.lock:
            return replace(self._of(name).camera(name), camera_to_world=camera.camera_to_world)

    def _of(self, name: str) -> HeadCameras:
        if name not in self._eyes:
            self._eyes[name] = HeadCameras(self._links, (name,))
        return self._eyes[name]
