"""Beads on a robot's hands, by which it sees where they are."""

from __future__ import annotations

import cv2
import numpy as np

from nuno.bodies.body import Body
from nuno.bodies.make_bodies import sphere
from nuno.camera.camera import Camera
from nuno.errors import EstimationError
from nuno.robot.hands import carrier
from nuno.robot.links import Links
from nuno.shapes.color import linear, rgb
from nuno.shapes.coordinates import Coordinates

BEAD = 0.014
"""[m] Radius."""
BEAD_AT = (-0.07, 0.0, -0.1)
"""[m] A bead's middle in the frame of the hand: where Talos sees it beside the gripper."""
BEAD_COLOR = "#e010c0"
SEARCH_RADIUS = 40.0
"""[px] How far from where it is expected a bead is looked for."""
ALIKE = 0.97
"""Cosine that the light from a bead's pixels and its paint have at least, as colours."""
DARKEST = 0.02
"""Of the full light: what is darker has no colour."""
WHOLE = 0.85
"""Share of a bead's disc that must be seen for the middle of what is seen to be its own."""


def put_beads(links: Links) -> tuple[Body, ...]:
    """Put a bead on each hand of a robot that is in a world, which touches nothing, and return them."""
    beads = []
    for hand in links.robot.description.hands:
        body, offset = carrier(links, hand)
        place = Coordinates(*body.pose()).transform(Coordinates(*offset)).to_world([BEAD_AT])[0]
        bead = sphere(BEAD, name=f"{hand} bead", color=BEAD_COLOR, position=place, group=0, collides_with=0)
        beads.append(links.world.add(bead))
        body.assoc(bead)
    return tuple(beads)


def find_bead(image: np.ndarray, camera: Camera, expected: np.ndarray) -> np.ndarray:
    """Return the pixel (2,) of a bead's middle.

    Args:
        image: (h, w, 3) uint8 RGB.
        camera: The camera that took it.
        expected: (3,) [m], about where the bead is.

    Raises:
        EstimationError: it is not seen there, or not wholly.
    """
    near, size = camera.project(expected), camera.fx * BEAD / float(camera.depth_of(expected))
    light, paint = linear(image.astype(float) / 255.0), linear(rgb(BEAD_COLOR))
    strength = np.linalg.norm(light, axis=-1)
    alike = light @ paint / np.maximum(strength * np.linalg.norm(paint), 1e-9)
    v, u = np.mgrid[0 : camera.height, 0 : camera.width]
    like = (alike > ALIKE) & (strength > DARKEST) & (np.hypot(u - near[0], v - near[1]) < SEARCH_RADIUS + size)
    _, _, stats, middles = cv2.connectedComponentsWithStats(like.astype(np.uint8))
    areas = stats[1:, cv2.CC_STAT_AREA]
    share = float(areas.max(initial=0)) / (np.pi * size**2)
    if not WHOLE < share < 1.0 / WHOLE:
        raise EstimationError(
            f"the bead on the hand is not seen where it should be: {share:.0%} of its disc near pixel "
            f"({near[0]:.0f}, {near[1]:.0f})"
        )
    return np.asarray(middles[1 + int(areas.argmax())])
