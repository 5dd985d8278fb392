"""Pictures: depth and bodies as the other renderers draw them, light by Lambert's law, shadows, patterns and noise."""

import numpy as np
import pytest

import nuno
from nuno.camera.camera import Camera
from nuno.camera.picture import Chequer, Lamp, take_picture
from nuno.errors import InvalidInputError, UnknownNameError
from nuno.shapes.color import linear, rgb

DOWN = np.diag([1.0, -1.0, -1.0, 1.0])  # a camera that looks straight down


def above(height=1.0, size=64, focal=64.0, distortion=None):
    """A camera at a height [m], looking down at the origin, x to the right."""
    pose = DOWN.copy()
    pose[2, 3] = height
    return Camera(size, size, focal, focal, (size - 1) / 2, (size - 1) / 2, pose, distortion)


def light_of(levels):
    """Amounts of light that a screen's levels stand for."""
    return linear(np.asarray(levels) / 255.0)


def test_depth_and_bodies_are_those_of_the_other_renderers():
    """To the bit, for every kind of shape, an endless floor and a cloth that hangs."""
    world = nuno.World(device="cpu")
    world.add(nuno.plane())
    world.add(nuno.box((0.2, 0.3, 0.1), position=(0.1, 0, 0.05)))
    world.add(nuno.sphere(0.1, position=(-0.2, 0, 0.2)))
    world.add(nuno.soft_box((0.1, 0.1, 0.1), cells=(2, 2, 2), position=(0.2, 0.2, 0.3)))
    cloth = world.add(nuno.sheet((0.3, 0.3), cells=(6, 6), position=(0, -0.1, 0.4)))
    world.attach(cloth)
    world.run(0.1)
    camera = above()
    picture = take_picture(world, camera)
    np.testing.assert_array_equal(picture.ids.numpy(), world.ids(camera).numpy())
    # the plane's depth is worked out in float32 here: one step of 10 um more or less
    np.testing.assert_allclose(picture.depth.numpy(), world.depth(camera).numpy(), atol=1.1e-5)
    np.testing.assert_array_equal(picture.mask(cloth), world.masks(camera, cloth).numpy())
    assert picture.color.shape == (64, 64, 3) and picture.time == world.time


def test_depth_is_infinite_where_nothing_is_seen():
    """Beside a box in an empty world."""
    world = nuno.World(device="cpu")
    world.add(nuno.box((0.2, 0.3, 0.1)))
    depth = take_picture(world, above()).depth.numpy()
    assert np.isposinf(depth[0, 0]) and np.isfinite(depth[32, 32])


def test_light_falls_by_lamberts_law():
    """A plate under a lamp at angles whose cosine is known: sky and lamp times the colour, to a level of rounding."""
    world = nuno.World(device="cpu")
    plate = world.add(nuno.box((2.0, 2.0, 0.01), color=(0.6, 0.4, 0.2)))
    for angle in (0.0, 0.6, 1.2):
        lamp = Lamp(
            position=(1000.0 * np.sin(angle), 0.0, 1000.0 * np.cos(angle)), strength=0.7, sky=0.2, shadows=False
        )
        seen = take_picture(world, above(), lamp=lamp).color.numpy()[32, 32]
        expected = linear(rgb(plate.color)) * (0.7 * np.cos(angle) + 0.2)
        np.testing.assert_allclose(light_of(seen), expected, atol=0.005)


def test_a_sphere_is_shaded_smoothly_and_a_box_has_sharp_edges():
    """Normals of a sphere are radial, and its light falls with the distance from its middle; a tilted box has two."""
    world = nuno.World(device="cpu")
    ball = world.add(nuno.sphere(0.3, color="white"))
    lamp = Lamp(position=(0, 0, 1e3), strength=0.8, sky=0.0, shadows=False)
    picture = take_picture(world, above(), lamp=lamp)
    v, u = np.nonzero(picture.mask(ball))
    depth = picture.depth.numpy()[v, u]
    points = np.stack([(u - 31.5) * depth / 64, -(v - 31.5) * depth / 64, 1.0 - depth], axis=1)
    inside = np.hypot(points[:, 0], points[:, 1]) < 0.25
    light = light_of(picture.color.numpy()[v, u, 0])[inside]
    # 0.02: the mesh's corners stand for the sphere, and its normals are means of its faces'
    np.testing.assert_allclose(light, 0.8 * points[inside, 2] / 0.3, atol=0.02)
    world.remove(ball)
    box = world.add(nuno.box((0.4, 0.4, 0.4), color="white", quaternion=nuno.Coordinates().rotate(0.6, "y").quaternion))
    picture = take_picture(world, above(), lamp=lamp)
    levels = np.unique(picture.color.numpy()[picture.mask(box)][:, 0])
    expected = 0.8 * np.cos([0.6, np.pi / 2 - 0.6])
    assert all(min(abs(light_of(levels) - e)) < 0.01 for e in expected) and len(levels) <= 4


def test_a_shadow_falls_where_the_lamp_does_not_reach():
    """Under a floating plate the ground is lit by the sky alone where similar triangles tell, and by both beside."""
    world = nuno.World(device="cpu")
    world.add(nuno.plane(color="white"))
    plate = world.add(nuno.box((0.2, 0.2, 0.01), position=(0, 0, 0.3), color="white"))
    lamp = Lamp(position=(2.0, 0.0, 2.3), strength=0.6, sky=0.3)
    camera = above(2.0, 128, 128.0)
    picture = take_picture(world, camera, lamp=lamp)

    def at(x, y):
        u, v = np.rint(camera.project((x, y, 0.0))).astype(int)
        return light_of(picture.color.numpy()[v, u, 0])

    # the plate's middle casts at -0.3 m: 0.3 / 2.0 of the lamp's distance beyond it; half as wide as 0.1 * 2.3 / 2.0
    assert at(-0.3, 0.0) == pytest.approx(0.3, abs=0.01)
    assert at(-0.3, 0.09) == pytest.approx(0.3, abs=0.01)
    towards = np.array((2.0, 0.2, 2.3))
    assert at(0.0, -0.2) == pytest.approx(0.3 + 0.6 * 2.3 / np.linalg.norm(towards), abs=0.01)
    without = take_picture(world, camera, lamp=Lamp(lamp.position, 0.6, 0.3, shadows=False), without=[plate])
    assert (light_of(without.color.numpy()) > 0.5).all()


def test_a_lamp_that_is_no_point_throws_half_shadows():
    """Under an edge half way up, light falls by the share of the disc that is seen past it: a circle's segment."""
    radius, world = 0.2, nuno.World(device="cpu")
    world.add(nuno.plane(color="white"))
    plate = world.add(nuno.box((2.0, 2.0, 0.002), position=(-1.0, 0.0, 1.0)))
    lamp = Lamp(position=(0.0, 0.0, 2.0), strength=0.8, sky=0.0, radius=radius)
    camera = above(height=0.9, focal=80.0)
    open_sky = Lamp(lamp.position, 0.8, 0.0, shadows=False)
    lit = light_of(take_picture(world, camera, lamp=lamp).color.numpy()[31, :, 0])
    free = light_of(take_picture(world, camera, lamp=open_sky, without=[plate]).color.numpy()[31, :, 0])
    x = camera.back_project([(u, 31) for u in range(64)], 0.0)[:, 0]
    d = np.clip(-x / radius, -1.0, 1.0)
    seen = (np.arccos(d) - d * np.sqrt(1.0 - d**2)) / np.pi
    # two points of 24 at the edge of what is seen, and a texel of each one's shadow map
    np.testing.assert_allclose(lit / free, seen, atol=2 / 24)
    assert (np.diff(lit / free) > -0.02).all() and np.diff(lit / free).max() < 0.15, "no large step"


def test_a_picture_is_saved(tmp_path):
    """As PNG to the level; a picture of several worlds and an unknown ending are refused, and nothing is left."""
    import cv2

    world = nuno.World(device="cpu")
    world.add(nuno.box((0.2, 0.3, 0.1), color="red"))
    picture = take_picture(world, above())
    picture.save(tmp_path / "box.png")
    np.testing.assert_array_equal(cv2.imread(str(tmp_path / "box.png"))[..., ::-1], picture.color.numpy())
    for name in ("box", "box.nonsense"):
        with pytest.raises(InvalidInputError, match=r"ends in \.png"):
            picture.save(tmp_path / name)
    with pytest.raises(InvalidInputError, match="got those of 2"):
        take_picture(world.imagine(2), above()).save(tmp_path / "two.png")
    assert [path.name for path in tmp_path.iterdir()] == ["box.png"]


def test_a_chequered_cloth_keeps_its_fields_when_it_moves():
    """Fields belong to the cloth: a quarter turn of the cloth turns them along, and half of it is of either colour."""
    world = nuno.World(device="cpu")
    cloth = world.add(nuno.sheet((0.4, 0.4), cells=(8, 8), color="white"))
    lamp = Lamp(position=(0, 0, 1e3), strength=0.0, sky=1.0, shadows=False)
    first = take_picture(world, above(), lamp=lamp, patterns={cloth: Chequer(0.1, "red")})
    fields = first.color.numpy()[..., 1] == 0
    share = (fields & first.mask(cloth)).sum() / first.mask(cloth).sum()
    assert share == pytest.approx(0.5, abs=0.05)  # rows of pixels on the fields' edges
    cloth.rotate(np.pi / 2, "z")
    second = take_picture(world, above(), lamp=lamp, patterns={cloth: Chequer(0.1, "red")})
    turned = np.rot90(fields, 1)
    assert (turned == (second.color.numpy()[..., 1] == 0)).mean() > 0.99


def test_noise_is_seeded_and_samples_smooth_edges():
    """The same seed gives the same bytes; edges of a mean of 3 x 3 have levels between; noise has its deviation."""
    world = nuno.World(device="cpu")
    world.add(nuno.box((0.3, 0.3, 0.1), color="gray", quaternion=nuno.Coordinates().rotate(0.3, "z").quaternion))
    camera = above()
    one, same, other = (take_picture(world, camera, noise=3.0, seed=s).color.numpy() for s in (1, 1, 2))
    np.testing.assert_array_equal(one, same)
    assert (one != other).any()
    clean = take_picture(world, camera).color.numpy()
    difference = one.astype(float) - clean
    # 12,288 draws: 0.6 % of the deviation; rounding to levels adds 1 / 12 to the variance
    assert difference.std() == pytest.approx(np.sqrt(9.0 + 1 / 12), rel=0.03)
    smooth = take_picture(world, camera, samples=3)
    assert len(np.unique(smooth.color.numpy()[..., 0])) > len(np.unique(clean[..., 0]))
    np.testing.assert_array_equal(smooth.ids.numpy(), take_picture(world, camera).ids.numpy())


def test_every_world_of_a_batch_is_taken():
    """World k of a batch gives, to the bit, what it gives alone."""
    world = nuno.World(device="cpu")
    world.add(nuno.plane())
    cloth = world.add(nuno.sheet((0.3, 0.3), cells=(4, 4), position=(0, 0, 0.4)))
    world.attach(cloth)
    futures = world.imagine(2)
    futures.grip(cloth, [[0], [24]], to=world.find("sheet").vertices[[0, 24]])
    futures.run(0.2)
    both = take_picture(futures, above(), lamp=Lamp(shadows=False))
    assert both.color.shape == (2, 64, 64, 3) and both.mask(cloth).shape == (2, 64, 64)
    for k in range(2):
        alone = nuno.World(device="cpu")
        alone.add(nuno.plane())
        single = alone.add(nuno.sheet((0.3, 0.3), cells=(4, 4), position=(0, 0, 0.4), name="sheet"))
        alone.attach(single)
        alone.grip(single, [[0, 24][k]], to=world.find("sheet").vertices[[0, 24][k]])
        alone.run(0.2)
        picture = take_picture(alone, above(), lamp=Lamp(shadows=False), seed=0)
        np.testing.assert_array_equal(picture.color.numpy(), both.color.numpy()[k])
        np.testing.assert_array_equal(picture.depth.numpy(), both.depth.numpy()[k])


def test_others_are_drawn_in_a_bodys_place():
    """A robot's looks instead of its hull: seen as the body that they stand for; none make it unseen."""
    world = nuno.World(device="cpu")
    box = world.add(nuno.box((0.2, 0.2, 0.2)))
    looks = nuno.sphere(0.05, color="red")
    picture = take_picture(world, above(), instead={box: [looks]})
    assert 0 < picture.mask(box).sum() < take_picture(world, above()).mask(box).sum() / 4
    assert not take_picture(world, above(), instead={box: []}).mask(box).any()


def test_bad_input():
    """Named errors that say what is valid."""
    world = nuno.World(device="cpu")
    world.add(nuno.box((0.2, 0.2, 0.2)))
    with pytest.raises(UnknownNameError, match="box"):
        take_picture(world, above(), patterns={"towel": Chequer(0.1)})
    with pytest.raises(InvalidInputError, match="samples"):
        take_picture(world, above(), samples=0)
    with pytest.raises(InvalidInputError, match="noise"):
        take_picture(world, above(), noise=-1.0)
    with pytest.raises(InvalidInputError, match="chequer's size"):
        take_picture(world, above(), patterns={"box": Chequer(0.0)})
    assert not take_picture(nuno.World(device="cpu"), above()).mask().any()
