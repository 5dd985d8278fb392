"""Head cameras: a pair at its baseline, where the head is, that sees the robot's own arms before what they hide."""

import numpy as np
import pytest

import nuno
from nuno.camera.segmentation import segment_before
from nuno.camera.table import Table
from nuno.errors import InvalidInputError, UnknownNameError
from nuno.robot.head_cameras import HeadCameras
from nuno.robot.stereo import triangulate


@pytest.fixture
def scene(g1):
    """A world with G1 before a table with a towel, its hands over it, and the links."""
    world = nuno.World(device="cpu")
    world.add(nuno.box((0.7, 1.2, 0.02), position=(0.75, 0, 0.71), name="table"))
    world.add(nuno.sheet((0.3, 0.4), cells=(6, 8), position=(0.55, 0, 0.725), color="#d8d2c0", name="towel"))
    assert g1.reach({"left_hand": (0.42, 0.15, 0.8), "right_hand": (0.42, -0.15, 0.8)})
    return world, g1, g1.enter(world)


@pytest.mark.parametrize(("name", "baseline"), [("talos", 0.07), ("g1", 0.05)])
def test_the_pair_has_its_baseline_and_looks_the_same_way(name, baseline, request):
    """Either half of it from the robot's camera, along its x; axes alike."""
    robot = request.getfixturevalue(name)
    left, middle, right = (robot.camera(which).camera_to_world for which in ("head_left", "head", "head_right"))
    np.testing.assert_allclose(right[:3, 3] - left[:3, 3], baseline * middle[:3, 0], atol=1e-9)
    np.testing.assert_allclose(0.5 * (right + left), middle, atol=1e-9)


@pytest.mark.long
def test_both_arms_are_seen_and_hide_the_towel(scene):
    """Arms on their sides of the image; where an arm is, the towel is not; without the robot all of it is seen."""
    _, _, links = scene
    pictures = HeadCameras(links, size=0.25).look()
    assert sorted(pictures) == ["head_left", "head_right"]
    arms = {side: [b for b in links.bodies if f"{side}_wrist" in b.name or f"{side}_elbow" in b.name]
            for side in ("left", "right")}  # fmt: skip
    for name, picture in pictures.items():
        columns = {side: np.nonzero(picture.mask(*bodies))[1] for side, bodies in arms.items()}
        assert all(len(seen) > 50 for seen in columns.values())  # pixels, of 19,200
        assert columns["left"].mean() < 0.5 * picture.camera.width < columns["right"].mean()
        whole = nuno.World(device="cpu")
        whole.add(nuno.sheet((0.3, 0.4), cells=(6, 8), position=(0.55, 0, 0.725), name="towel"))
        alone = whole.masks(picture.camera, "towel").numpy()
        robots = picture.mask(*links.bodies)
        assert (alone & robots).sum() > 50, name
        np.testing.assert_array_equal(picture.mask("towel"), alone & ~robots)
        depth = picture.depth.numpy()
        assert depth[robots].min() > 0.1 and depth[picture.mask("towel")].min() > 0.4


@pytest.mark.long
def test_visual_meshes_are_drawn_in_place_of_hulls(scene):
    """Hulls hide more than what they are around; both have the pixels of the visual meshes, nearly all."""
    _, _, links = scene
    look, hulls = (HeadCameras(links, ("head_left",), size=0.25, looks=looks).look()["head_left"]
                   for looks in ("visual", "collision"))  # fmt: skip
    seen, hull = look.mask(*links.bodies), hulls.mask(*links.bodies)
    assert seen.sum() != hull.sum()
    # G1's palms have no collision shape, and are seen all the same
    assert (seen & ~hull).sum() > 20


def test_cameras_are_where_the_links_are_and_depth_fits_the_pair(scene):
    """Half way of a motion as the bodies are; the disparity of a point of the table is that of its depth."""
    world, robot, links = scene
    cameras = HeadCameras(links, size=0.5)
    before = robot.camera("head_left").camera_to_world.copy()
    robot.translate((0.04, 0, 0), wrt="world")
    links.follow(2 / 60)
    world.step()
    now = cameras.camera("head_left").camera_to_world
    np.testing.assert_allclose(now[:3, 3] - before[:3, 3], (0.02, 0, 0), atol=1e-9)
    pictures = cameras.look()
    left, right = pictures["head_left"], pictures["head_right"]
    v, u = (int(np.median(axis)) for axis in np.nonzero(left.mask("towel")))
    point = left.camera.camera_to_world[:3, 3] + left.camera.rays((u, v)) * left.depth.numpy()[v, u]
    found = triangulate(left.camera, right.camera, (u, v), right.camera.project(point))
    np.testing.assert_allclose(found.positions[0], point, atol=1e-4)  # depth in steps of 10 um
    pixel = np.rint(right.camera.project(point)).astype(int)
    assert right.mask("towel")[pixel[1], pixel[0]]


def test_rate_latency_and_seeded_noise(scene):
    """10 Hz and 50 ms late: the picture stands until the next has come; the same seed gives the same bytes."""
    world, _, links = scene
    runs = [HeadCameras(links, ("head_left",), size=0.125, noise=2.0, rate=10.0, latency=0.05, seed=5) for _ in "ab"]
    told = []
    for _ in range(13):
        a, b = (cameras.look()["head_left"] for cameras in runs)
        np.testing.assert_array_equal(a.color.numpy(), b.color.numpy())
        told.append(a.time)
        world.step()
    # frames of 1/60 s: taken at 0 and 0.1 (frame 6), told at 0.15 (frame 9)
    np.testing.assert_allclose(told, [0.0] * 9 + [0.1] * 4, atol=1e-9)


def test_the_towel_is_found_in_what_talos_sees(talos):
    """Pictures look enough like photographs for the segmentation that photographs are given to: 98 % of its pixels."""
    world = nuno.World(device="cpu")
    world.add(nuno.plane(color="#8a8f96"))
    world.add(nuno.box((0.7, 1.2, 0.02), position=(0.75, 0, 0.71), color="#9b6b43", name="table"))
    turn = nuno.Coordinates().rotate(0.3, "z").quaternion
    towel = nuno.sheet((0.3, 0.4), cells=(6, 8), position=(0.64, 0, 0.724), quaternion=turn, color="#d8d2c0")
    world.add(towel)
    talos.angle_vector({"head_1_joint": 0.78, "torso_2_joint": 0.4})
    cameras = HeadCameras(talos.enter(world), ("head_left",), samples=2, noise=1.5)
    picture = cameras.look()["head_left"]
    found = segment_before(picture.color.numpy(), picture.camera, Table(0.72))
    true = picture.mask(towel)
    assert true.sum() > 10000
    assert (found & true).sum() > 0.98 * (found | true).sum()


def test_bad_input(scene):
    """Named errors that say what is valid."""
    _, _, links = scene
    with pytest.raises(UnknownNameError, match="head_left"):
        HeadCameras(links, ("knee",))
    with pytest.raises(InvalidInputError, match="looks must be one of"):
        HeadCameras(links, looks="pretty")
    with pytest.raises(InvalidInputError, match="rate"):
        HeadCameras(links, rate=0.0)
    with pytest.raises(UnknownNameError, match="head_right"):
        HeadCameras(links, ("head_right",)).camera("head_left")
