"""Beginning to follow a cloth through images."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from nuno.bodies.body import Body
from nuno.errors import BodyStateError, InvalidInputError
from nuno.materials import Cloth
from nuno.tracking.follower import Follower
from nuno.tracking.observation import checked_cameras
from nuno.validation import checked, count, flag, number
from nuno.world.world import World


@checked
def follow(
    world: World, body: Body | str, camera: Any, *, materials: Sequence[Cloth] = (), reach: float = 0.1,
    iterations: int = 2, pixels: int = 1500, thorough: bool = True,
) -> Follower:  # fmt: skip
    """Begin to follow a cloth through images: its physics, and forces from what is seen.

    The world's own physics moves the cloth from image to image, with all grips and contacts. Each image is compared
    with what the camera would see of that: every observed point belongs, by a Gaussian, to the visible vertices near
    it, or to none. The vertices' expected residuals become forces, and the time since the image before is gone through
    again with them (Schulman, Lee, Ho and Abbeel, "Tracking deformable objects with point clouds", ICRA 2013). What is
    hidden moves by physics and by what it hangs together with.

    Args:
        world: The world, a single one. Its bodies hide the cloth in images as they do in it.
        body: An attached cloth, or its name, about where it is in the first image.
        camera: The camera, or a sequence of several that see the cloth at once.
        materials: Guesses at the cloth's material. Each is a future of its own in a batch that all images judge; the
            world becomes the likeliest. Empty is the material that the cloth has.
        reach: Distance [m] at which a point is as likely an outlier as one of the nearest vertex's.
        iterations: Expectations and maximisations for each image.
        pixels: How many pixels of each image show the cloth at most; more are more precise, and take longer.
        thorough: As of ``World.imagine``.

    Raises:
        BodyStateError: the body is static, the world is a batch, or it runs in the background.
        InvalidInputError: the body is no cloth, or a value that cannot be used.
    """
    cameras = checked_cameras(camera)
    number("reach", reach, above=0.0)
    count("iterations", iterations)
    count("pixels", pixels)
    flag("thorough", thorough)
    if world.world_count != 1:
        raise BodyStateError(f"one world is followed, and this is a batch of {world.world_count}; see materials")
    own = world.find(body) if isinstance(body, str) else body
    if own not in world.bodies:
        raise BodyStateError(f"{own.name!r} is not in this world")
    if not own.shape.is_cloth:
        raise InvalidInputError(f"only cloth is followed; {own.name!r} is a {own.shape.kind}")
    if not isinstance(own.material, Cloth):
        raise BodyStateError(f"{own.name!r} is static; attach it before it is followed")
    if world.is_running:
        raise BodyStateError("the world runs in the background; stop it, as a follower lets time pass itself")
    guesses = tuple(materials)
    for guess in guesses:
        guess.resolved(1, 1)
    return Follower(world, own, cameras, guesses, max(1, len(guesses)), reach, iterations, pixels, thorough)
