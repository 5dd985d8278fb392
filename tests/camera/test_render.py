"""Images of a world: who is seen, who hides whom, in one world and in many."""

from types import SimpleNamespace

import numpy as np
import pytest

from nuno.camera import render
from nuno.camera.camera import Camera
from nuno.camera.image_region import Region
from nuno.camera.render import render_depth, render_ids, render_masks
from nuno.errors import InvalidInputError, UnknownNameError
from nuno.shapes import shape

# two metres above the origin, looking straight down; the image's x is the world's x
DOWN = Camera(
    160, 120, 200.0, 200.0, 79.5, 59.5,
    camera_to_world=[[1, 0, 0, 0], [0, -1, 0, 0], [0, 0, -1, 2], [0, 0, 0, 1]],
)  # fmt: skip


def _body(name, kind, at=(0.0, 0.0, 0.0)):
    vertices, faces = kind.mesh()
    return SimpleNamespace(name=name, shape=kind, vertices=vertices + np.asarray(at), faces=faces, is_dynamic=False)


def _world(*bodies, worlds=1):
    return SimpleNamespace(bodies=list(bodies), world_count=worlds, device="cpu")


def _room(worlds=1):
    floor = _body("floor", shape.Plane())
    table = _body("table", shape.Box((0.6, 0.4, 0.04)), (0, 0, 0.48))
    cloth = _body("cloth", shape.Sheet((0.3, 0.2), (6, 4)), (0.1, 0, 0.51))
    hand = _body("hand", shape.Sphere(0.05), (0.1, 0, 0.7))
    if worlds > 1:
        shift = np.linspace(0.0, 0.4, worlds)[:, None, None] * np.array([1.0, 0.0, 0.0])
        cloth.vertices = cloth.vertices[None] + shift
    return _world(floor, table, cloth, hand, worlds=worlds)


def test_ids_say_who_is_in_front():
    """The hand hides the cloth, the cloth the table, the table the floor."""
    ids = render_ids(_room(), DOWN).numpy()
    assert ids.dtype == np.int32 and ids.shape == (120, 160)
    u, v = np.rint(DOWN.project([(0.1, 0, 0.75), (0.2, 0.05, 0.51), (-0.2, 0.1, 0.5), (0.4, 0.3, 0)])).astype(int).T
    assert ids[v, u].tolist() == [3, 2, 1, 0]
    # the table's top, 0.6 x 0.4 m at 1.5 m: 80 x 53.3 px, of which the cloth and the hand hide a part
    assert (ids >= 1).sum() == 80 * 54


def test_an_empty_pixel_has_no_body_and_no_depth():
    """Where nothing is seen: -1, inf, not in the mask."""
    world = _world(_body("table", shape.Box((0.6, 0.4, 0.04)), (0, 0, 0.48)))
    ids, depth = render_ids(world, DOWN).numpy(), render_depth(world, DOWN).numpy()
    mask = render_masks(world, DOWN, "table").numpy()
    assert ids[0, 0] == -1 and depth[0, 0] == np.inf and mask.dtype == bool
    np.testing.assert_array_equal(mask, ids == 0)
    np.testing.assert_array_equal(mask, np.isfinite(depth))


def test_masks_are_where_the_ids_are():
    """The mask of each body is the part of the image where it is in front."""
    world = _room()
    ids = render_ids(world, DOWN).numpy()
    for k, body in enumerate(world.bodies):
        np.testing.assert_array_equal(render_masks(world, DOWN, body).numpy(), ids == k)


def test_left_out_bodies_hide_nothing():
    """Without the hand, the whole cloth is seen: 0.3 x 0.2 m at 1.49 m."""
    world = _room()
    mask = render_masks(world, DOWN, "cloth", without=[world.bodies[3]]).numpy()
    half = np.array([0.15, 0.1]) * 200 / 1.49
    centre = DOWN.project((0.1, 0, 0.51))
    v, u = np.mgrid[:120, :160]
    expected = (np.abs(u - centre[0]) < half[0]) & (np.abs(v - centre[1]) < half[1])
    np.testing.assert_array_equal(mask, expected)
    assert render_masks(world, DOWN, "cloth").numpy().sum() < expected.sum()


def test_depth_of_a_level_room():
    """Seen from straight above, depth is the difference in height."""
    depth = render_depth(_room(), DOWN, without=["hand"]).numpy()
    u, v = np.rint(DOWN.project([(0.2, 0.05, 0.51), (-0.2, 0.1, 0.5), (0.4, 0.3, 0)])).astype(int).T
    np.testing.assert_allclose(depth[v, u], [1.49, 1.5, 2.0], atol=6e-6)  # half a step of 10 um, and rounding


def test_a_plane_is_endless():
    """A floor reaches up to the horizon, and hides what is below it."""
    level = Camera(
        64,
        48,
        50.0,
        50.0,
        31.5,
        23.5,
        camera_to_world=[[0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 1.2], [0, 0, 0, 1]],
    )
    world = _world(_body("floor", shape.Plane()), _body("buried", shape.Sphere(0.3), (3.0, 0, -0.4)))
    ids = render_ids(world, level).numpy()
    assert (ids[24:] == 0).all() and (ids[:24] == -1).all()
    depth = render_depth(world, level).numpy()
    np.testing.assert_allclose(depth[24:, 0], 1.2 * 50.0 / (np.arange(24, 48) - 23.5), rtol=1e-6, atol=6e-6)


@pytest.mark.parametrize("chunk", [render.CHUNK_BYTES, 2 * 4 * 160 * 120, 1])
def test_batch_has_the_bits_of_single_worlds(chunk, monkeypatch):
    """World k of a batch looks as it looks alone, in chunks of any size; bodies alike in all are shared."""
    monkeypatch.setattr(render, "CHUNK_BYTES", chunk)
    many = _room(worlds=5)
    masks = render_masks(many, DOWN, "cloth").numpy()
    depths, ids = render_depth(many, DOWN).numpy(), render_ids(many, DOWN).numpy()
    assert masks.shape == depths.shape == ids.shape == (5, 120, 160)
    for k in range(5):
        alone = _room()
        alone.bodies[2].vertices = many.bodies[2].vertices[k]
        assert (render_masks(alone, DOWN, "cloth").numpy() == masks[k]).all()
        assert (render_depth(alone, DOWN).numpy() == depths[k]).all()
        assert (render_ids(alone, DOWN).numpy() == ids[k]).all()
    assert masks[0].sum() != masks[4].sum()


@pytest.mark.parametrize("distortion", [None, (-0.2, 0.04, 0.001, -0.001)])
def test_static_bodies_may_differ_by_world(distortion):
    """Floors and tables that stand elsewhere in each world look as they do alone, also through a lens."""
    camera = Camera(160, 120, 200.0, 200.0, 79.5, 59.5, camera_to_world=DOWN.camera_to_world, distortion=distortion)
    many = _room(worlds=3)
    for body in many.bodies:  # all bodies by world; hand and table are alike in all
        if body.vertices.ndim == 2:
            rise = 0.05 * np.arange(3)[:, None, None] * np.array([1.0, 0.5, 1.0]) * (body.name == "floor")
            body.vertices = body.vertices + rise
    many.bodies[1].vertices = many.bodies[1].vertices + 0.03 * np.arange(3)[:, None, None]
    depths = render_depth(many, camera).numpy()
    for k in range(3):
        alone = _room()
        for body, batched in zip(alone.bodies, many.bodies, strict=True):
            body.vertices = batched.vertices[k]
        assert (render_depth(alone, camera).numpy() == depths[k]).all()
    assert (depths[0] != depths[2]).mean() > 0.5


def test_a_real_world_is_drawn():
    """A World's masks, depth and ids come from here, also those of imagined futures."""
    import nuno

    world = nuno.World(device="cpu")
    world.add(nuno.box((0.6, 0.4, 0.04), name="table", position=(0, 0, 0.48)))
    cloth = world.add(nuno.sheet((0.3, 0.2), cells=(6, 4), name="cloth", position=(0.1, 0, 0.51)))
    mask = world.masks(DOWN, cloth).numpy()
    np.testing.assert_array_equal(mask, world.ids(DOWN).numpy() == 1)
    np.testing.assert_array_equal(mask, render_masks(_room(), DOWN, "cloth", without=["hand"]).numpy())
    np.testing.assert_array_equal(world.imagine(3).masks(DOWN, cloth).numpy(), np.stack([mask] * 3))
    assert world.depth(DOWN).numpy()[mask] == pytest.approx(1.49, abs=6e-6)  # half a depth step, and rounding


def test_region_is_a_cutout():
    """A region gives the same pixels as cutting them out."""
    world, region = _room(), Region(40, 30, 70, 50)
    whole = render_ids(world, DOWN).numpy()
    np.testing.assert_array_equal(render_ids(world, DOWN, region=region).numpy(), whole[30:80, 40:110])


def test_cloth_thickness_is_drawn_on_cloths_only():
    """A cloth on edge becomes visible; a box stays as it is."""
    cloth = _body("cloth", shape.Sheet((0.3, 0.2), (6, 4)))
    cloth.vertices = cloth.vertices[:, [0, 2, 1]] + (0, 0, 1.0)  # upright, below the camera
    world = _world(cloth, _body("box", shape.Box((0.1, 0.1, 0.1)), (-0.25, 0, 0.9)))
    thin, thick = render_ids(world, DOWN).numpy(), render_ids(world, DOWN, cloth_thickness=0.02).numpy()
    assert not (thin == 0).any()
    # its upper edge is 0.9 m away: 0.02 m are 4.4 px
    assert set((thick == 0).sum(axis=0)[60:100]) <= {4, 5}
    np.testing.assert_array_equal(thin == 1, thick == 1)


def test_distorted_boxes_have_bent_edges():
    """Large faces follow the lens: a table's outline is where the undistorted rays say."""
    lens = Camera(
        320, 240, 250.0, 250.0, 159.5, 119.5, distortion=(-0.2, 0.04, 0.001, -0.001),
        camera_to_world=DOWN.camera_to_world,
    )  # fmt: skip
    world = _world(_body("table", shape.Box((1.3, 0.9, 0.04)), (0, 0, 0.48)))
    mask = render_masks(world, lens, "table").numpy()
    v, u = np.mgrid[:240, :320].astype(float)
    points = lens.back_project(np.stack([u, v], axis=-1), 0.5)
    expected = (np.abs(points[..., 0]) < 0.65) & (np.abs(points[..., 1]) < 0.45)
    # straight pieces are off by less than 0.1 px, as is OpenCV's inverse: few centres of 700
    assert (mask ^ expected).sum() <= 0.03 * 700
    straight = Camera(320, 240, 250.0, 250.0, 159.5, 119.5, camera_to_world=DOWN.camera_to_world)
    assert (render_masks(world, straight, "table").numpy() ^ expected).sum() > 500


def test_a_body_of_another_world_goes_by_its_name():
    """A body stands for the body of the same name in a copy of its world."""
    here, copy = _room(), _room(worlds=2)
    np.testing.assert_array_equal(
        render_masks(copy, DOWN, here.bodies[2]).numpy(), render_masks(copy, DOWN, "cloth").numpy()
    )


def test_bad_arguments_are_refused():
    """Unknown bodies and impossible regions are named."""
    world = _room()
    with pytest.raises(UnknownNameError, match="cloth, floor, hand, table"):
        render_masks(world, DOWN, "towel")
    with pytest.raises(UnknownNameError, match="robot"):
        render_depth(world, DOWN, without=["robot"])
    with pytest.raises(InvalidInputError, match="left out"):
        render_masks(world, DOWN, "cloth", without=["cloth"])
    with pytest.raises(InvalidInputError, match="160 x 120"):
        render_ids(world, DOWN, region=Region(0, 0, 161, 10))
    with pytest.raises(InvalidInputError, match="thickness"):
        render_ids(world, DOWN, cloth_thickness=-0.1)
    with pytest.raises(InvalidInputError, match="a Camera is needed to draw with, got dict"):
        render_depth(world, {"width": 160})
