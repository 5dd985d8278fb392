"""Replaying a fold of a cloth that the engine itself folded, on another mesh than the replay's."""

import json

import numpy as np
import pytest

import nuno
from nuno import ClothNotFoundError, HandPath, ImageError, InvalidInputError
from nuno.shapes.surface import closest_points

TOP = 0.72  # [m] height of the table top
REST_HEIGHT = 0.0025  # [m]
SIZE = (0.4, 0.3)  # [m]
HALF = (0.45, 0.6)  # [m] of the table top
RELEASE = 1.65  # [s]
TRUE = nuno.Cloth(area_density=0.25, bending_rigidity=8e-5, stretch_stiffness=3000.0, thickness=2 * REST_HEIGHT)
GUESSES = {
    "limp": nuno.Cloth(area_density=0.3, bending_rigidity=2e-6, stretch_stiffness=3000.0, thickness=2 * REST_HEIGHT),
    "true": TRUE,
}
OPTIONS = {"cells": 16, "substeps": 12, "device": "cpu", "progress": False}


def make_camera():
    """A small camera 0.9 m before the table and 0.6 m above it, looking 30 degrees down."""
    down, pose = np.deg2rad(30.0), np.eye(4)
    pose[:3, :3] = [[0, -np.sin(down), np.cos(down)], [-1, 0, 0], [0, -np.cos(down), -np.sin(down)]]
    pose[:3, 3] = (-0.9, 0.0, TOP + 0.6)
    return nuno.Camera(320, 240, 250.0, 250.0, 159.5, 119.5, pose)


def hand_paths():
    """Two hands that carry the corners of the side at -x over to the other side in 1.5 s, and let go at 1.65 s."""
    times = np.arange(0.0, 2.4, 1 / 30)
    s = np.clip(times / 1.5, 0.0, 1.0)
    angle = np.pi * s**3 * (10.0 + s * (6.0 * s - 15.0))  # minimum jerk
    x, z = -0.2 * np.cos(angle), 0.2 * np.sin(angle) + 0.006 * s
    return [
        HandPath(times, np.stack([x, np.full_like(x, y), TOP + REST_HEIGHT + z], axis=1), times < RELEASE)
        for y in (-0.15, 0.15)
    ]


@pytest.fixture(scope="module")
def folded():
    """The true fold: masks every sixth frame, the mask before, the last surface."""
    camera, hands = make_camera(), hand_paths()
    world = nuno.World(device="cpu", substeps=16)
    world.add(nuno.box((2 * HALF[0], 2 * HALF[1], 0.04), name="table", position=(0, 0, TOP - 0.02)))
    cloth = world.add(nuno.sheet(SIZE, cells=(18, 14), position=(0, 0, TOP + REST_HEIGHT)))
    first = world.masks(camera, cloth).numpy()
    world.attach(cloth, TRUE)
    corners = [cloth.vertices[:, :2] @ (1.0, sign) for sign in (1.0, -1.0)]
    grips = [
        world.grip(cloth, [int(c.argmin())], to=nuno.Path(hand.times, hand.positions))
        for c, hand in zip(corners, hands, strict=True)
    ]
    masks = {}
    for k, t in enumerate(hands[0].times):
        if t > RELEASE and grips:
            for grip in grips:
                grip.release()
            grips = []
        world.run(t - world.time)
        if k % 6 == 0:
            masks[k] = world.masks(camera, cloth).numpy()
    return first, masks, np.asarray(cloth.vertices), cloth.faces


def options(folded, **changes):
    """Arguments of replay_fold for the true fold, with changes."""
    given = dict(
        camera=make_camera(), table_height=TOP, table_half_extents=HALF, table_centre=(0, 0), first_mask=folded[0],
        masks=folded[1], materials=GUESSES, hand_radius=0.0,
    )  # fmt: skip
    return given | OPTIONS | changes


@pytest.fixture(scope="module")
def result(folded):
    """The replay."""
    return nuno.replay_fold(None, hand_paths(), **options(folded))


def test_the_replay_agrees(result, folded):
    """With the true masks, frame by frame: at this size 2 px of outline, 2 % each way, make 0.92."""
    assert set(result.agreement) == set(folded[1]) and result.given == set(folded[1])
    values = list(result.agreement.values())
    assert np.mean(values) > 0.93 and min(values) > 0.85
    assert result.warnings == []


def test_the_final_surface(result, folded):
    """The mean distance to the true surface, both ways, is under 2 % of the longer side; the fold moved it by 30 %."""
    true, faces = folded[2:]
    there = closest_points(result.final, true, faces).positions(true, faces)
    back = closest_points(true, result.final, result.faces).positions(result.final, result.faces)
    assert np.linalg.norm(there - result.final, axis=1).mean() < 0.02 * SIZE[0]
    assert np.linalg.norm(back - true, axis=1).mean() < 0.02 * SIZE[0]
    unmoved = closest_points(result.vertices[0], true, faces).positions(true, faces)
    assert np.linalg.norm(unmoved - result.vertices[0], axis=1).mean() > 0.08 * SIZE[0]  # a test that can fail


def test_the_true_material_is_kept(result):
    """Of a guess forty times too limp and the true one, the true one agrees better."""
    assert result.material_name == "true" and result.material is GUESSES["true"]
    assert result.scores["true"] > result.scores["limp"]


def test_the_hands_led_the_cloth(result):
    """Held corners are at the hands while they hold, to a millimetre of the offset at the start; then no longer led."""
    frame = 30
    for hold in result.fold.holds:
        corner = result.faces[hold.faces[0]][hold.barycentric[0].argmax()]
        offset = result.vertices[0, corner] - result.hands_at[0, hold.hand]
        assert np.linalg.norm(offset) < 0.004  # a pixel
        np.testing.assert_allclose(
            result.vertices[frame, corner], result.hands_at[frame, hold.hand] + offset, atol=1e-3
        )
        assert hold.begin == 0.0 and hold.end == pytest.approx(RELEASE, abs=1 / 60)


def test_the_layers(result, folded):
    """As much lies under another layer as in the true fold, to 1 cm at the three free borders of the upper one."""
    flat = nuno.sheet(SIZE, cells=(18, 14)).vertices[:, :2] / SIZE + 0.5
    true = nuno.find_layers(*folded[2:], flat)
    layers = result.layers
    assert sum(true.area[1:]) > 0.3 * SIZE[0] * SIZE[1]  # it is folded
    assert sum(layers.area[1:]) == pytest.approx(sum(true.area[1:]), abs=0.01 * (SIZE[0] / 2 * 2 + SIZE[1]))
    end = 0.15 if layers.over(0.15, 0.5) else 0.85  # the side that was not carried over
    (over,) = layers.over(end, 0.5)
    assert (over[0] - 0.5) * (end - 0.5) < 0.0 and abs(over[1] - 0.5) < 0.05  # the other half, straight across


def test_adopt_goes_on_from_the_end(folded):
    """The single world becomes the kept replay's end, bit for bit."""
    result = nuno.replay_fold(None, hand_paths(), **options(folded, materials={"true": TRUE}))
    world = result.adopt()
    np.testing.assert_array_equal(world.find("cloth").vertices.astype(np.float32), result.fold.states[-1, 0])
    world.run(0.1)


def test_a_world_is_as_it_is_alone(result, folded):
    """The true material's world of the batch of two equals, bit for bit, its replay by itself."""
    alone = nuno.replay_fold(None, hand_paths(), **options(folded, materials={"true": TRUE}))
    np.testing.assert_array_equal(alone.vertices, result.vertices)
    np.testing.assert_array_equal(alone.masks, result.masks)


def test_what_is_saved(result, tmp_path):
    """Masks, the surface, the replay and the answer can be read back."""
    import cv2

    result.save(tmp_path, names={0: "000", 12: "012"})
    assert sorted(p.name for p in tmp_path.glob("mask_*")) == ["mask_000.png", "mask_012.png"]
    mask = cv2.imread(str(tmp_path / "mask_012.png"), cv2.IMREAD_UNCHANGED)
    np.testing.assert_array_equal(mask == 255, result.masks[12])
    assert set(np.unique(mask)) == {0, 255}
    final = np.load(tmp_path / "final.npz")
    np.testing.assert_array_equal(final["vertices"], result.final)
    assert final["faces"].shape == (len(result.faces), 3)
    replay = nuno.Recording.load(tmp_path / "replay.npz")
    np.testing.assert_array_equal(replay["cloth"].vertices, result.vertices)
    assert (tmp_path / "replay.glb").read_bytes()[:4] == b"glTF"
    data = json.loads((tmp_path / "result.json").read_text())
    assert data["material"]["name"] == "true" and len(data["frames"]) == len(result.times)
    assert data["agreement"]["mean"] == pytest.approx(np.mean(list(result.agreement.values())))
    assert data["frames"][6]["compared_with"] == "mask" and data["frames"][7]["agreement"] is None
    for name in ("strip.png", "layers.png", "hands.png"):
        assert min(cv2.imread(str(tmp_path / name)).shape[:2]) > 100


def test_the_hands_paths_are_drawn(result):
    """From above and over time, each path as it was given, and thick while the hand holds."""
    above, beside = result.hands_figure().axes
    for hand in range(result.hands_at.shape[1]):
        whole = next(line for line in above.lines if line.get_label() == f"hand {hand}")
        np.testing.assert_array_equal(whole.get_xydata(), result.hands_at[:, hand, :2])
    thick = [line for line in beside.lines if line.get_linewidth() > 2]
    assert len(thick) == sum(hold.held_cloth for hold in result.fold.holds) > 0
    for line, hold in zip(thick, result.fold.holds, strict=True):
        times = line.get_xdata()
        assert hold.begin <= times.min() and times.max() <= hold.end


def test_one_hand_away_is_a_warning(folded):
    """A hand that holds beside the cloth moves nothing, and that is said."""
    near, far = hand_paths()
    far = HandPath(far.times, far.positions + np.array((0, 0.5, 0.3)), far.held)
    result = nuno.replay_fold(None, [near, far], **options(folded, masks=None, materials={"true": TRUE}))
    assert any("hand 1 holds" in warning and "moved nothing" in warning for warning in result.warnings)
    assert any("no frame to compare" in warning for warning in result.warnings)
    assert [hold.held_cloth for hold in result.fold.holds] == [True, False]


def test_a_hold_that_begins_later(folded):
    """A hand that takes the cloth on the way takes what is nearest then; before, the cloth lies still."""
    hand = hand_paths()[0]
    waits = HandPath(hand.times + 0.5, hand.positions, hand.held)
    times = np.append(np.arange(0.0, 0.5, 0.1), waits.times[:20])
    early = HandPath(
        times, np.concatenate([np.repeat(hand.positions[:1], 5, axis=0), hand.positions[:20]]), np.arange(25) >= 5
    )
    result = nuno.replay_fold(None, [early], **options(folded, masks=None, materials={"true": TRUE}))
    (hold,) = result.fold.holds
    assert hold.begin == pytest.approx(0.45) and hold.end == np.inf and hold.held_cloth
    np.testing.assert_allclose(result.vertices[4], result.vertices[0], atol=2e-4)  # it settles on the table
    assert result.final[:, 2].max() > TOP + 0.01


BAD_HANDS = {
    "nan": (lambda t, p, h: (t, np.where(p == p[3, 0], np.nan, p), h), "finite"),
    "times": (lambda t, p, h: (t[::-1], p, h), "increase"),
    "equal times": (lambda t, p, h: (np.where(t > 0.3, 0.3, t), p, h), "increase"),
    "too few": (lambda t, p, h: (t, p[:-1], h), "shape"),
    "held": (lambda t, p, h: (t, p, h.astype(float)), "bool"),
}


@pytest.mark.parametrize("name", BAD_HANDS)
def test_a_bad_path_is_named(name):
    """Positions that are not finite, times that do not increase, arrays that do not fit."""
    spoil, words = BAD_HANDS[name]
    hand = hand_paths()[0]
    with pytest.raises(InvalidInputError, match=words):
        HandPath(*spoil(hand.times, hand.positions, hand.held))


def never(hand):
    """The same hand, which never holds."""
    return HandPath(hand.times, hand.positions, np.zeros(len(hand.times), dtype=bool))


def lifted(hand):
    """The same hand, half a metre higher."""
    return HandPath(hand.times, hand.positions + np.array((0, 0, 0.5)), hand.held)


BAD = {
    "no hands": (dict(hands=[]), InvalidInputError, "HandPath"),
    "never held": (dict(hands=[never(h) for h in hand_paths()]), InvalidInputError, "held is never true"),
    "never touching": (dict(hands=[lifted(h) for h in hand_paths()]), InvalidInputError, "never touch"),
    "frame times": (dict(frame_times=[0.0, 0.0, 1.0]), InvalidInputError, "increase"),
    "one time": (dict(hands=[HandPath([0.0], [[0.0, 0.0, TOP]], np.array([True]))]), InvalidInputError, "two or more"),
    "frames": (dict(masks={999: np.zeros((240, 320))}), InvalidInputError, "999"),
    "mask size": (dict(masks={0: np.zeros((10, 10))}), ImageError, "shape"),
    "an image that is not there": (dict(images={0: "nothing.png"}), ImageError, "nothing.png"),
    "materials": (dict(materials=[]), InvalidInputError, "materials"),
    "preset": (dict(materials=["velvet"]), nuno.UnknownNameError, "velvet"),
    "height": (dict(table_height=np.nan), InvalidInputError, "table_height"),
    "nothing to see": (dict(first_mask=None), InvalidInputError, "first image"),
    "no cloth": (
        dict(first_image=np.full((240, 320, 3), 120, np.uint8), first_mask=None), ClothNotFoundError, "no cloth",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", BAD)
def test_bad_input_is_named(name, folded):
    """Named errors that say what is wrong."""
    changes, error, words = BAD[name]
    given = options(folded, **changes)
    with pytest.raises(error, match=words):
        nuno.replay_fold(given.pop("first_image", None), given.pop("hands", hand_paths()), **given)
