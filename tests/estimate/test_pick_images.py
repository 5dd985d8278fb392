"""Cloths that do not lie flat and whole on the table's middle: each is measured rightly, or told by name."""

import numpy as np
import pytest

import nuno
from nuno.camera.table import Table
from nuno.estimate.pick_images import PickImages, find_cloth_before
from nuno.estimate.pick_settings import check_settings

TABLE = Table(0.72, (0.42, 0.6), (0.1, 0.0))
SIZE = np.array((0.6, 0.42))  # [m]
BLUE, RED = (0.2, 0.35, 0.8), (0.8, 0.25, 0.2)
NEAR_A_PIXEL = 0.004  # [m] what a pixel is at 1 m and f = 300 px; an edge is measured to a fraction of one


def camera_at(eye, target):
    """A camera of 400 x 300 px that looks from one place to another without roll."""
    z = (np.asarray(target) - eye) / np.linalg.norm(np.asarray(target) - eye)
    x = np.cross(z, (0.0, 0.0, 1.0))
    x /= np.linalg.norm(x)
    pose = np.eye(4)
    pose[:3, :3] = np.stack([x, np.cross(z, x), z], axis=1)
    pose[:3, 3] = eye
    return nuno.Camera(400, 300, 300.0, 300.0, 199.5, 149.5, pose)


CAMERA = camera_at((-0.9, 0.05, 1.34), (0.1, 0.0, 0.8))
CLOSE = camera_at((-0.55, 0.05, 1.2), (0.35, 0.2, 0.75))


def lying(centre, yaw, fold=None, size=SIZE, cells=(36, 26)):
    """Vertices (n, 3) and faces of a flat cloth; what is beyond a line (normal, offset) [m] of it is folded over."""
    u, v = (np.linspace(-0.5, 0.5, n + 1) * side for n, side in zip(cells, size, strict=True))
    flat = np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)
    over = np.zeros(len(flat))
    if fold is not None:
        normal = np.asarray(fold[0]) / np.linalg.norm(fold[0])
        over = np.maximum(flat @ normal - fold[1], 0.0)
        flat = flat - 2.0 * over[:, None] * normal
    c, s = np.cos(yaw), np.sin(yaw)
    height = TABLE.height + 0.0025 + 0.004 * (over > 0.0)
    first = np.arange((cells[0] + 1) * cells[1]).reshape(cells[1], -1)[:, :-1].ravel()
    quads = first[:, None] + np.array((0, 1, cells[0] + 2, cells[0] + 1))
    faces = np.concatenate([quads[:, :3], quads[:, [0, 2, 3]]])
    return np.column_stack([flat @ np.array([[c, s], [-s, c]]) + centre, height]), faces


def hanging_over(vertices):
    """What is beyond the table's borders hangs straight down from them."""
    vertices = vertices.copy()
    for axis, half in enumerate(TABLE.half_extents):
        for sign in (-1.0, 1.0):
            beyond = sign * (vertices[:, axis] - TABLE.centre[axis]) - half
            vertices[beyond > 0.0, 2] -= beyond[beyond > 0.0]
            vertices[beyond > 0.0, axis] = TABLE.centre[axis] + sign * (half + 0.003)
    return vertices


def picture(cloths, boxes=(), camera=CAMERA):
    """The image of cloths ((vertices, faces), colour) and boxes (size, position) on the table."""
    world = nuno.World(device="cpu")
    size = (2 * TABLE.half_extents[0], 2 * TABLE.half_extents[1], 0.04)
    world.add(nuno.box(size, name="table", position=(*TABLE.centre, TABLE.height - 0.02), color=(0.55, 0.5, 0.45)))
    world.add(nuno.plane(name="floor", color=(0.4, 0.38, 0.36)))
    for k, (shape, color) in enumerate(cloths):
        world.add(nuno.mesh(shape, name=f"cloth {k}", color=color))
    for k, (sides, position) in enumerate(boxes):
        world.add(nuno.box(sides, name=f"thing {k}", position=position, color=(0.85, 0.75, 0.2)))
    lamp = nuno.Lamp((0.3, 0.6, 3.0), 0.55, 0.4)
    return nuno.take_picture(world, camera, lamp=lamp, samples=2, noise=3.0, seed=1).color.numpy()


def found(image, camera=CAMERA, hint=None, shape="rectangle"):
    """The rectangle, or the outline, that is found in an image before."""
    settings = check_settings(
        table=TABLE, camera=camera, hand=(0.1, 0.0, 1.1), candidates=(6, 6), rest_height=0.0025, hand_radius=0.014,
        lift_seconds=1.5, discretisations=nuno.estimate.hypotheses.DISCRETISATIONS, sure=0.98, turns=(0.0,),
        learned=True, sideways=0.5, score="evidence", device="cpu", progress=False,
    )  # fmt: skip
    return find_cloth_before(PickImages(image, image, None, None, None), None, hint, settings, shape)[1]


def worst_corner(rectangle, centre, yaw, size=SIZE):
    """Of the true corners the one that is farthest from any found one [m]."""
    true = lying(centre, yaw, size=size, cells=(1, 1))[0][:, :2]
    return np.linalg.norm(true[:, None] - rectangle.corners[None, :, :2], axis=2).min(axis=1).max()


def test_a_whole_cloth_is_measured_without_a_word():
    """The ordinary case, and one with a thing that stands on the cloth's middle."""
    centre = (0.08, 0.0)
    for boxes in ((), [((0.05, 0.05, 0.08), (0.1, 0.0, 0.76))]):
        rectangle = found(picture([(lying(centre, 0.3), BLUE)], boxes))
        assert worst_corner(rectangle, centre, 0.3) < NEAR_A_PIXEL and rectangle.warnings == ()


@pytest.mark.parametrize(("centre", "right"), [((0.1, 0.42), True), ((0.45, 0.0), False)])
def test_a_cloth_over_the_tables_edge_is_told(centre, right):
    """Its corner over the side leaves three that are seen; beyond the far border none can be, and it is cut there."""
    yaw = 0.5 if right else np.pi / 2
    vertices, faces = lying(centre, yaw)
    rectangle = found(picture([((hanging_over(vertices), faces), BLUE)]))
    assert any("lies on the table's border" in warning for warning in rectangle.warnings)
    assert (worst_corner(rectangle, centre, yaw) < NEAR_A_PIXEL) == right


def test_a_cloth_over_the_near_edge_is_told():
    """Too little of its outline is left for a rectangle: an error or a warning says where it goes on."""
    vertices, faces = lying((-0.18, 0.0), 0.3)
    image = picture([((hanging_over(vertices), faces), BLUE)])
    with pytest.raises(nuno.EstimationError, match="lies on the table's border"):
        found(image)
    warnings = found(image, shape="auto").warnings
    assert "taken by its outline" in warnings[0] and "lies on the table's border" in warnings[-1]


def test_a_folded_corner_is_told_or_does_no_harm():
    """A small one leaves three corners that tell the fourth; half of the cloth folded over leaves no rectangle."""
    centre = (0.08, 0.0)
    small = found(picture([(lying(centre, 0.3, ((1, 1), 0.2)), BLUE)]))
    assert worst_corner(small, centre, 0.3) < NEAR_A_PIXEL
    assert any("not quite a rectangle" in warning for warning in small.warnings)
    image = picture([(lying(centre, 0.3, ((0.42, 0.6), 0.0)), BLUE)])
    with pytest.raises(nuno.EstimationError, match="may be folded"):
        found(image)
    (warning,) = found(image, shape="auto").warnings
    assert "taken by its outline" in warning and "may be folded" in warning


def test_a_cloth_out_of_the_image_is_told():
    """It goes on where nothing is seen."""
    with pytest.raises(nuno.EstimationError, match="beyond the image's border"):
        found(picture([(lying((-0.1, -0.05), 0.3), BLUE)], camera=CLOSE), camera=CLOSE)


def test_a_cloth_behind_a_thing_is_told():
    """A box before one corner hides most of two sides."""
    image = picture([(lying((0.12, 0.0), 0.3), BLUE)], [((0.1, 0.25, 0.2), (-0.2, 0.05, 0.82))])
    with pytest.raises(nuno.EstimationError, match="behind a thing"):
        found(image)
    (warning,) = found(image, shape="auto").warnings
    assert "taken by its outline" in warning and "behind a thing" in warning


@pytest.mark.parametrize("color", [BLUE, RED])
def test_of_two_cloths_the_named_one_is_meant(color):
    """By a pixel on it; without, the larger one is taken, and the other one told of."""
    places = (((0.1, 0.25), 0.3, (0.4, 0.3)), ((0.1, -0.25), -0.4, (0.35, 0.3)))
    image = picture([(lying(*place[:2], size=place[2]), c) for place, c in zip(places, (BLUE, color), strict=True)])
    for centre, yaw, size in places:
        pixel = CAMERA.project(np.array((*centre, TABLE.height)))
        rectangle = found(image, hint=pixel)
        assert worst_corner(rectangle, centre, yaw, size) < NEAR_A_PIXEL and rectangle.warnings == ()
    either = found(image)
    assert worst_corner(either, *places[0]) < NEAR_A_PIXEL
    assert any("another thing on the table" in warning and "hint=" in warning for warning in either.warnings)
