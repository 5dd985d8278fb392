"""The cloth's pattern in the image after: flat cloths held up in known poses, drawn by closed form."""

import numpy as np
import pytest
import warp as wp

from nuno import Camera
from nuno.camera import raster
from nuno.camera.image_region import view
from nuno.camera.rectangle import ClothRectangle
from nuno.estimate.pattern import compare_pattern, find_pattern

TOP = 0.7  # [m] height of the cloth before
LONG, SHORT = 0.5, 0.35  # [m]
CELLS = (10, 7)
HELD = (0.6, 0.4)  # the held point, fractions of the sides
LIGHTS = tuple(np.array(light) for light in ((0.4, 0.3, 0.3, 0.5), (0.7, -0.2, 0.0, 0.1)))
"""Ambient, and the direction that light comes from times its strength."""
TURN = np.array([[-1.0, 0.0], [0.0, -1.0]])  # half a turn in the cloth's own plane


def make_camera():
    """A camera 0.9 m before the cloth and 0.6 m above it, looking 30 degrees down."""
    down, pose = np.deg2rad(30.0), np.eye(4)
    pose[:3, :3] = [[0, -np.sin(down), np.cos(down)], [-1, 0, 0], [0, -np.cos(down), -np.sin(down)]]
    pose[:3, 3] = (-0.9, 0.0, TOP + 0.6)
    return Camera(640, 480, 500.0, 500.0, 319.5, 239.5, pose)


def lying():
    """The cloth before: C00, CI, the opposite corner, CJ."""
    corners = np.array([(0.3, 0.25, TOP), (0.3, -0.25, TOP), (-0.05, -0.25, TOP), (-0.05, 0.25, TOP)])
    return ClothRectangle(corners, LONG, SHORT, corners.mean(axis=0), -np.pi / 2, 0.0)


def tilted(turn):
    """The cloth after, as corner, sides: its plane leans towards the camera, the held point at a fixed place."""
    lean = np.deg2rad(55.0)
    sides = np.array([(0.0, -LONG, 0.0), (-SHORT * np.cos(lean), 0.0, -SHORT * np.sin(lean))])
    # turned about the held point, u and v run the other way
    sides = np.array([turn[0, 0] * sides[0], turn[1, 1] * sides[1]])
    hand = np.array((0.1, 0.02, TOP + 0.35))
    return hand - np.array(HELD) @ sides, sides, hand


def colours(u, v, contrast):
    """A print without symmetry, (..., 3) in [0, 1]."""
    waves = np.stack([np.sin(9 * u + 4 * v), np.cos(8 * v - 3 * u), np.sin(11 * u * v + 2 * u)], axis=-1)
    return np.array((0.55, 0.5, 0.45)) + contrast * 0.3 * waves


def draw(corner, sides, contrast, light=None):
    """The image (h, w, 3) uint8 of a flat cloth on black, and its mask, each pixel from its ray."""
    camera = make_camera()
    u, v = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
    rays, origin = camera.rays(np.stack([u, v], axis=-1)), camera.camera_to_world[:3, 3]
    normal = np.cross(*sides)
    normal /= np.linalg.norm(normal)
    points = origin + ((corner - origin) @ normal / (rays @ normal))[..., None] * rays - corner
    along, across = (points @ side / (side @ side) for side in sides)
    mask = (along >= 0) & (along <= 1) & (across >= 0) & (across <= 1)
    seen = -np.sign(rays[240, 320] @ normal) * normal
    shade = 1.0 if light is None else light[0] + light[1:] @ seen
    image = np.where(mask[..., None], shade * colours(along, across, contrast), 0.0)
    return np.clip(image * 255, 0, 255).astype(np.uint8), mask


def sheet(corner, sides):
    """Vertices, faces and fractions of a grid on a flat cloth."""
    u, v = np.meshgrid(np.arange(CELLS[0] + 1) / CELLS[0], np.arange(CELLS[1] + 1) / CELLS[1])
    uv = np.stack([u.ravel(), v.ravel()], axis=-1)
    at = np.arange(uv.shape[0]).reshape(CELLS[1] + 1, CELLS[0] + 1)
    a, b, c, d = at[:-1, :-1].ravel(), at[:-1, 1:].ravel(), at[1:, 1:].ravel(), at[1:, :-1].ravel()
    return corner + uv @ sides, np.concatenate([np.stack([a, b, c], -1), np.stack([a, c, d], -1)]), uv


def scores(futures, contrast=1.0, light=LIGHTS[0], turn=None):
    """Pattern scores of futures (each a turn) where the real cloth is turned by ``turn``."""
    rectangle = lying()
    flat = rectangle.corners[[1, 3]] - rectangle.corners[0]
    before, _ = draw(rectangle.corners[0], flat, contrast)
    corner, sides, hand = tilted(np.eye(2) if turn is None else turn)
    after, mask = draw(corner, sides, contrast, light)
    pattern = find_pattern(before, after, mask, rectangle, make_camera(), hand)
    made = [sheet(*tilted(future)[:2]) for future in futures]
    positions = wp.array(np.array([m[0] for m in made], dtype=np.float32), dtype=wp.vec3, device="cpu")
    faces = wp.array(made[0][1].astype(np.int32), dtype=wp.vec3i, device="cpu")
    keys = raster.key_images(len(made), pattern.region, "cpu", ids=True)
    raster.draw(keys, positions, faces, view(pattern.camera, pattern.region), None)
    return compare_pattern(keys, positions, faces, made[0][2], pattern)


@pytest.mark.parametrize("light", LIGHTS)
def test_the_pattern_tells_futures_apart(light):
    """Right way round or turned by half, in any light: the pattern of the right one explains most of what is seen.

    The right one leaves what blur and a quarter of the resolution cost, less than a tenth of the variance (-1.15); a
    wrong one explains nothing that light does not, so it stays within a tenth of 0 or is worse.
    """
    right, wrong = scores([np.eye(2), TURN], light=light)
    assert right < 0.5 * np.log(0.1) and wrong > -0.1
    again = scores([np.eye(2), TURN], light=light, turn=TURN)
    assert again[1] < 0.5 * np.log(0.1) and again[0] > -0.1


def test_a_plain_cloth_says_nothing():
    """Without a pattern both models are one: 0 for every future, but for float32 sums: 1e-6 beside a floor of 0.003."""
    np.testing.assert_allclose(scores([np.eye(2), TURN], contrast=0.0), 0.0, atol=0.5e-6 / 0.003)


def test_a_future_beside_the_cloth_says_nothing():
    """Where a future shows no cloth both models leave the whole variance: exactly 0."""
    rectangle = lying()
    before, _ = draw(rectangle.corners[0], rectangle.corners[[1, 3]] - rectangle.corners[0], 1.0)
    corner, sides, hand = tilted(np.eye(2))
    after, mask = draw(corner, sides, 1.0, LIGHTS[0])
    pattern = find_pattern(before, after, mask, rectangle, make_camera(), hand)
    vertices, triangles, uv = sheet(corner + np.array((0.0, 5.0, 0.0)), sides)
    positions = wp.array(vertices[None].astype(np.float32), dtype=wp.vec3, device="cpu")
    faces = wp.array(triangles.astype(np.int32), dtype=wp.vec3i, device="cpu")
    keys = raster.key_images(1, pattern.region, "cpu", ids=True)
    raster.draw(keys, positions, faces, view(pattern.camera, pattern.region), None)
    assert compare_pattern(keys, positions, faces, uv, pattern)[0] == 0.0


def test_a_world_alone_gives_what_it_gives_in_a_batch():
    """Bit for bit, at any place."""
    three = scores([TURN, np.eye(2), TURN])
    assert three[0] == three[2] == scores([TURN])[0] and three[1] == scores([np.eye(2)])[0]


@pytest.mark.parametrize("dark", ["mask", "cloth"])
def test_nothing_to_compare(dark):
    """No whole pixel of cloth, or a black cloth: there is no pattern."""
    rectangle = lying()
    before, mask = draw(rectangle.corners[0], rectangle.corners[[1, 3]] - rectangle.corners[0], 1.0)
    if dark == "mask":
        mask = np.zeros_like(mask)
    else:
        before = np.zeros_like(before)
    assert find_pattern(before, before, mask, rectangle, make_camera(), np.array((0.1, 0.0, TOP + 0.3))) is None
