"""Pictures and films of scenes, from where all that moves is seen."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.camera.camera import Camera
from nuno.shapes.shape import Plane
from nuno.world.recording import Recording

if TYPE_CHECKING:
    from nuno.world.world import World

FIELD = 0.7
"""[rad] From the upper edge of a picture to its lower one."""
FRAMES = 30
"""Of a film, each second."""


def picture_of(world: World) -> Any:
    """Return a picture (``nuno.Picture``) of a world."""
    from nuno.camera.picture import take_picture

    return take_picture(world, camera_for(world), samples=2)


def camera_for(world: World) -> Camera:
    """Return a camera that sees all bodies that move; in a world where none does, all but planes."""
    bodies = [body for body in world.bodies if not isinstance(body.shape, Plane)]
    shown = [body for body in bodies if body.is_dynamic] or bodies
    points = [np.concatenate([body.vertices.reshape(-1, 3) for body in shown])] if shown else [np.eye(3)]
    low, high = points[0].min(axis=0), points[0].max(axis=0)
    middle, radius = 0.5 * (low + high), max(0.5 * float(np.linalg.norm(high - low)), 0.02)
    away = np.array([0.75, -1.0, 0.6])
    eye = middle + away / np.linalg.norm(away) * radius / np.sin(0.5 * FIELD)
    return Camera.look_at(eye, middle, FIELD)


def film_scene(world: World, seconds: float) -> Any:
    """Let a world run, and return the film of it (``nuno.Film``).

    Raises:
        MissingPackageError: the viewer's packages are not installed.
    """
    from nuno.viewer.film import Film

    recording = Recording(world)
    recording.add()
    for _ in range(max(round(seconds * FRAMES), 1)):
        world.run(1.0 / FRAMES, progress=False)
        recording.add()
    return Film.of(recording)
