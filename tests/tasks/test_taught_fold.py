"""Folds that hands teach: in the cloth's own frame, on other cloths, and what cannot be taught."""

import numpy as np
import pytest
from teaching import CLOTH, RELEASE, REST, SIZE, hand_paths, lesson, room

import nuno
from nuno import HandPath, InvalidInputError
from nuno.camera.rectangle import ClothRectangle
from nuno.tasks.cloth_frame import ClothFrame
from nuno.tasks.fold_comparison import compare_fold
from nuno.tasks.fold_motion import bent
from nuno.tasks.taught_fold import TaughtFold

SMALL = 1e-6  # [m] float32 positions near the origin


@pytest.fixture(scope="module")
def taught():
    """A fold in half by two hands."""
    return lesson(hand_paths())


def test_a_frame_leads_there_and_back():
    """Corners are at 0 and 1, whatever their sense; places and points are inverse to each other."""
    world = nuno.World(device="cpu")
    cloth = world.add(nuno.sheet((0.4, 0.3), cells=(4, 3), position=(0.5, -0.2, 0.7)))
    cloth.rotate(2.0, "z")
    for first in range(4):
        frame = ClothFrame.of(cloth, first)
        np.testing.assert_allclose(frame.size, (0.4, 0.3) if first % 2 == 0 else (0.3, 0.4), atol=SMALL)
        points = np.random.default_rng(0).normal(size=(5, 3))
        np.testing.assert_allclose(frame.to_world(frame.to_cloth(points)), points, atol=1e-9)
        np.testing.assert_allclose(frame.to_cloth(frame.corners[2] + (0, 0, 0.1)), (1, 1, 0.1), atol=1e-6)
    turned = ClothFrame(frame.corners[::-1])  # clockwise
    assert np.cross(*turned.axes)[2] > 0.0


def test_what_is_taught(taught):
    """The corners that were taken, when they were let go, and where they are to lie."""
    np.testing.assert_allclose(taught.size, SIZE, atol=SMALL)
    np.testing.assert_array_equal(taught.held, [(0, 0), (0, 1)])
    np.testing.assert_array_equal(taught.goals, [(1, 0), (1, 1)])
    np.testing.assert_allclose(taught.releases, RELEASE, atol=1 / 60)  # halfway between two frames of the video
    assert taught.times[0] == 0.0 and taught.times[-1] == taught.releases[0]
    np.testing.assert_allclose(taught.ways[:, -1, 0], 1.0, atol=1e-6)
    # the apex of the arc: 0.2 m, and half of the 6 mm by which it ends higher
    assert taught.ways[0, :, 2].max() == pytest.approx(0.203, abs=1e-3)


def test_on_another_cloth(taught):
    """Of half the size and turned, it begins at its corners, ends over the others, and rises half as high."""
    _, towel = room(size=(0.2, 0.15))
    towel.rotate(0.5, "z")
    motion = taught.on(towel)
    corners = ClothFrame.of(towel).corners
    np.testing.assert_allclose(motion.ways[:, 0], corners[[0, 3]], atol=SMALL)
    np.testing.assert_allclose(motion.ways[:, -1], corners[[1, 2]] + (0, 0, 0.006), atol=1e-5)
    rises = [way[:, 2].max() - way[0, 2] for way in motion.ways]
    np.testing.assert_allclose(rises, 0.5 * 0.2 + 0.5 * 0.006, atol=1e-3)
    np.testing.assert_allclose(towel.vertices[motion.held], corners[[0, 3]], atol=SMALL)
    np.testing.assert_allclose(towel.vertices[motion.goals], corners[[1, 2]], atol=SMALL)
    slow = taught.on(towel, seconds=4.0)
    assert slow.times[-1] == slow.releases[0] == pytest.approx(4.0)


@pytest.mark.parametrize("angle", [0.0, 1.0, 2.5, -2.0])
def test_forward(taught, angle):
    """An oblong cloth is folded the way of its longer side that is nearer to forward; a square one to 45 degrees."""
    direction = np.array([np.cos(angle), np.sin(angle)])
    for size, nearest in (((0.4, 0.3), 0.0), ((0.3, 0.3), np.cos(np.pi / 4) - 1e-6)):
        _, towel = room(size=size)
        motion = taught.on(towel, forward=direction)
        way = (motion.ways[:, -1] - motion.ways[:, 0])[:, :2].mean(axis=0)
        assert way @ direction / np.linalg.norm(way) >= nearest
        if size[0] > size[1]:
            assert abs(way[1]) < 1e-3 * abs(way[0])


def test_bent_ways():
    """The end moves by the shift, the beginning stays, and what rises over the straight line is multiplied."""
    way = np.array([(0.0, 0.0, 1.0), (1.0, 0.0, 1.5), (2.0, 0.0, 1.2)])
    found = bent(way, height=2.0, shift=np.array([0.2, 0.4]))
    np.testing.assert_allclose(found, [(0.0, 0.0, 1.0), (1.1, 0.2, 1.9), (2.2, 0.4, 1.2)])
    np.testing.assert_allclose(bent(way), way)


def test_one_hand_teaches_too():
    """A corner carried onto the one across."""
    times = np.linspace(0.0, 1.5, 40)
    s = times / 1.5
    path = np.stack([-0.2 + 0.39 * s, -0.15 + 0.29 * s, REST + 0.2 * np.sin(np.pi * s) + 0.006 * s], axis=1)
    taught = lesson([HandPath(times, path, times < 1.45)])
    np.testing.assert_array_equal(taught.held, [(0, 0)])
    np.testing.assert_array_equal(taught.goals, [(1, 1)])


def test_hands_that_take_and_let_go_apart():
    """A hand that takes later waits at the cloth, one that lets go earlier rests where it did."""
    left, right = hand_paths()
    left = HandPath(left.times, left.positions, (left.times > 0.2) & (left.times < 1.2))
    taught = lesson([left, right])
    own = {tuple(uv): k for k, uv in enumerate(taught.held)}
    first = own[(0.0, 0.0)]
    np.testing.assert_allclose(taught.releases[[first, 1 - first]], (1.2, RELEASE), atol=1 / 30)
    assert np.ptp(taught.ways[first][taught.times < 0.2], axis=0).max() < 1e-12
    assert np.ptp(taught.ways[first][taught.times > 1.22], axis=0).max() < 1e-12


def test_compared_with_itself(taught):
    """On a cloth of its own size the taught end is 0 away, and 5 mm where it lies 5 mm higher; half is doubled."""
    world = nuno.World(device="cpu")
    cloth = world.add(nuno.sheet(SIZE, cells=(12, 9), position=(0.0, 0.0, REST)))
    motion = taught.on(cloth)
    end = motion.frame.to_world(taught.vertices)
    same = compare_fold(motion, end)
    assert same.distance < SMALL and same.doubled == same.taught_doubled
    assert 0.35 < same.doubled < 0.5  # a fold that slid, at most half of the cloth
    # the upper layer is 5 mm over the lower one: raised by 2 mm, each is nearest to its own
    raised = compare_fold(motion, end + np.array((0.0, 0.0, 0.002)))
    assert raised.distance == pytest.approx(0.002, rel=0.05)
    assert raised.share == pytest.approx(raised.distance / 0.4)


def test_a_replay_teaches_as_the_hands_do():
    """From a replay, from a rectangle that was measured the other way round: the same points, the same ways."""
    hands = hand_paths()
    cloth = nuno.sheet(SIZE, cells=(12, 9), position=(0.0, 0.0, REST))
    corners = cloth.vertices[[0, 12, -1, -13]][[1, 0, 3, 2]]
    rectangle = ClothRectangle(corners, *SIZE, corners.mean(axis=0), np.pi, 0.0)
    camera = nuno.Camera(32, 24, 20.0, 20.0, 15.5, 11.5)
    result = nuno.replay_fold(
        None, hands, camera=camera, table_height=REST - 0.0025, rectangle=rectangle, materials={"own": CLOTH},
        hand_radius=0.01, cells=12, substeps=10, device="cpu", progress=False,
    )  # fmt: skip
    replayed, direct = TaughtFold.from_replay(result), lesson(hands)
    np.testing.assert_allclose(replayed.times, direct.times)
    there = ClothFrame(corners).to_world(replayed.ways)
    np.testing.assert_allclose(there, ClothFrame(cloth.vertices[[0, 12, -1, -13]]).to_world(direct.ways), atol=1e-5)


# What cannot be taught


def test_hands_that_never_touch():
    """Named, with how near they come."""
    far = [HandPath(hand.times, hand.positions + np.array((0.0, 0.0, 0.3)), hand.held) for hand in hand_paths()]
    with pytest.raises(InvalidInputError, match="never touch the cloth"):
        lesson(far)


def test_hands_that_hold_nothing():
    """Held is never true."""
    shifted = [HandPath(hand.times, hand.positions, np.zeros(len(hand.times), bool)) for hand in hand_paths()]
    with pytest.raises(InvalidInputError, match="no hand holds anything"):
        lesson(shifted)
    with pytest.raises(InvalidInputError, match="one or more HandPath"):
        lesson([])


def test_a_hand_in_the_middle():
    """Of the cloth, where a robot's hand would take a patch."""
    with pytest.raises(InvalidInputError, match=r"hand 0 takes the cloth at \(0\.50, 0\.50\)"):
        inner = hand_paths((0.0,))[0]
        lesson([HandPath(inner.times, inner.positions + np.array((0.2, 0.0, 0.0)), inner.held)])


def test_a_hand_that_takes_hold_twice():
    """Two folds are two lessons."""
    hand = hand_paths()[0]
    with pytest.raises(InvalidInputError, match="hand 0 takes hold more than once"):
        lesson([HandPath(hand.times, hand.positions, (hand.times < 0.3) | ((hand.times > 0.45) & (hand.times < 0.6)))],
               reach=0.2)  # fmt: skip


@pytest.mark.parametrize(
    ("change", "match"),
    [
        (lambda t, p: (t, np.where(p > 0.1, np.nan, p)), "positions must be finite"),
        (lambda t, p: (t[::-1], p), "must increase"),
        (lambda t, p: (t[:-1], p), "shape"),
    ],
)
def test_paths_that_are_none(change, match):
    """NaN, times that do not increase, and shapes that do not fit never become a path."""
    hand = hand_paths()[0]
    times, positions = change(hand.times, hand.positions)
    with pytest.raises(InvalidInputError, match=match):
        HandPath(times, positions, hand.held[: len(times)])


def test_cloths_that_it_cannot_be_brought_to(taught):
    """One that is no sheet, one that does not lie flat, a direction that is none."""
    world, towel = room()
    box = world.add(nuno.box((0.1, 0.1, 0.1), position=(0.0, 0.0, 2.0)))
    with pytest.raises(InvalidInputError, match="only a sheet"):
        taught.on(box)
    with pytest.raises(InvalidInputError, match="must be a direction"):
        taught.on(towel, forward=(0.0, 0.0, 1.0))
    with pytest.raises(InvalidInputError, match="seconds"):
        taught.on(towel, seconds=0.0)
    towel.rotate(0.3, "y")
    with pytest.raises(InvalidInputError, match="must lie flat"):
        taught.on(towel)


def test_a_fold_that_brings_no_corner_to_a_corner():
    """A border carried to the middle has no corners to be squared by."""
    half = []
    for hand in hand_paths():
        x, y, z = hand.positions.T
        half.append(HandPath(hand.times, np.stack([0.5 * x - 0.1, y, z], axis=1), hand.held))
    taught = lesson(half)
    with pytest.raises(InvalidInputError, match="must carry corners onto corners"):
        taught.on(room()[1]).goals  # noqa: B018
