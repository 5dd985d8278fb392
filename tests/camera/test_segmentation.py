"""Finding the cloth, flat and lifted, in synthetic images with exact masks."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from synthetic import LOOKS, Pair, look_at, make_pair

from few_variants import few
from nuno.camera.camera import Camera
from nuno.camera.image import read_image
from nuno.camera.scene_without_cloth import compare
from nuno.camera.segmentation import look_after, segment_after, segment_before
from nuno.camera.table import Table, plane_coordinates, table_margin
from nuno.errors import ClothNotFoundError, ImageError, InvalidInputError

BY_NAME = {look.name: number for number, look in enumerate(LOOKS)}
# A cloth and a table that differ in brightness only, both grey: then the cloth in its own shade may look just
# like the table, or like the table in the cloth's shadow, and no pixel can say which it is.
AMBIGUOUS = {"light grey on grey", "dark grey on grey", "white on light grey"}
CLEAR = [look.name for look in LOOKS if look.name not in AMBIGUOUS]


def overlap(found: np.ndarray, true: np.ndarray) -> float:
    """Intersection over union."""
    return float((found & true).sum() / max((found | true).sum(), 1))


def pair(name: str, seed: int = 500, *, lift: bool = True) -> Pair:
    """The pair of images of a look."""
    return make_pair(LOOKS[BY_NAME[name]], seed + BY_NAME[name], lift=lift)


@pytest.fixture(scope="module")
def striped() -> Pair:
    """One pair for the tests of arguments."""
    return pair("blue stripes on wood")


@pytest.mark.parametrize(
    "name", [pytest.param(look.name, marks=pytest.mark.long if k % 4 else ()) for k, look in enumerate(LOOKS)]
)
def test_flat_cloth_is_found(name: str) -> None:
    """The mask before is right to about half a pixel along its outline, for every pattern and colour."""
    scene = pair(name, lift=False)
    found = segment_before(scene.before, scene.camera, scene.table)
    # Half a pixel along an outline of 600 px around 20,000 px would be 0.985.
    assert overlap(found, scene.mask_before) > 0.98


@pytest.mark.parametrize("name", few(CLEAR[::2], *CLEAR[::6]))
def test_lifted_cloth_is_found(name: str) -> None:
    """The mask after leaves out the shadow and the hand, and has the cloth in its own shade."""
    scene = pair(name)
    found = segment_after(scene.after, scene.camera, scene.table, scene.before, scene.mask_before, scene.hand)
    # Half a pixel along the outline of a folded cloth of 10,000 px is about 0.97.
    assert overlap(found, scene.mask_after) > 0.95


@pytest.mark.parametrize("name", few(sorted(AMBIGUOUS), min(AMBIGUOUS)))
def test_grey_on_grey_is_mostly_found(name: str) -> None:
    """Where brightness alone tells cloth from table, texture and the shadow's depth find most of it."""
    scene = pair(name)
    found = segment_after(scene.after, scene.camera, scene.table, scene.before, scene.mask_before, scene.hand)
    # Over 24 such scenes, four in five were above 0.85 and the worst at 0.61: this only guards against
    # collapse.
    assert overlap(found, scene.mask_after) > 0.6


def checks(first: tuple[int, ...], wood: tuple[int, ...], beyond: tuple[int, ...], near: float) -> tuple:
    """An image of a cloth of two colours of 5 cm checks on a table, its camera and table, and the cloth's mask.

    Args:
        first: One colour of the checks; the other is a light grey.
        wood: The table's colour, with streaks.
        beyond: The colour of all that is not the table's top.
        near: x of the cloth's edge that is nearest to the camera [m]; the table's is at -0.4.
    """
    rng = np.random.default_rng(0)
    table = Table(0.7, (0.4, 0.5), (0.0, 0.0))
    camera = look_at(np.array([-1.0, 0.0, 1.3]), np.array([0.0, 0.0, 0.7]), 520.0)
    xy = plane_coordinates(camera, table.height)
    squares = (np.floor(xy / 0.05).sum(axis=-1) % 2 == 0)[..., None]
    cloth = (xy[..., 0] > near) & (xy[..., 0] < 0.0) & (np.abs(xy[..., 1]) < 0.25)
    streaks = cv2.GaussianBlur(rng.normal(size=cloth.shape), (0, 0), 3.0, sigmaY=30.0)
    top = np.array(wood) * (1.0 + 0.04 * streaks / streaks.std())[..., None]
    image = np.where((table_margin(table, xy) > 0)[..., None], top, beyond)
    image = np.where(cloth[..., None], np.where(squares, first, (215, 215, 215)), image)
    image = cv2.GaussianBlur(image, (0, 0), 0.5) + rng.normal(0.0, 3.0, image.shape)
    return np.clip(np.round(image), 0, 255).astype(np.uint8), camera, table, cloth


def test_checks_of_the_tables_colour_along_the_outline() -> None:
    """Where a pattern meets the outline in the table's own colour, a flat cloth still has no bays."""
    image, camera, table, cloth = checks((104, 112, 108), (104, 108, 112), (60, 90, 60), -0.3)
    # With the bays it is 0.84. Not all are filled: where the table's streaks differ from a square, one remains.
    assert overlap(segment_before(image, camera, table), cloth) > 0.9


def test_what_lies_beyond_the_table_is_no_cloth_on_it() -> None:
    """A floor in one of the cloth's colours, 3 mm from the cloth, stays out of the mask."""
    image, camera, table, cloth = checks((60, 62, 60), (160, 120, 90), (60, 62, 60), -0.397)
    assert overlap(segment_before(image, camera, table), cloth) > 0.96  # a pixel of the whole outline is 0.97


@pytest.mark.parametrize("border", [0.03, 0.06, 0.09])
@pytest.mark.parametrize("colours", [((120, 105, 200), (190, 195, 155)), ((200, 95, 55), (75, 95, 95))])
def test_a_cloth_that_covers_most_of_the_table(colours: tuple, border: float) -> None:
    """A cloth is found where it leaves a border of 3 to 9 cm of its table, and the cloth is most of what lies there."""
    rng = np.random.default_rng(0)
    table = Table(0.7, (0.4, 0.6), (0.0, 0.0))
    camera = look_at(np.array([-1.0, 0.0, 1.3]), np.array([0.0, 0.0, 0.7]), 380.0)
    margin = table_margin(table, plane_coordinates(camera, table.height))
    image = np.where((margin > 0)[..., None], colours[1], (96, 92, 88))
    image = np.where((margin > border)[..., None], colours[0], image).astype(float)
    image = cv2.GaussianBlur(image, (0, 0), 0.5) + rng.normal(0.0, 3.0, image.shape)
    found = segment_before(np.clip(np.round(image), 0, 255).astype(np.uint8), camera, table)
    assert overlap(found, margin > border) > 0.97  # a pixel of the whole outline is 0.98


def faint(difference: tuple[int, ...]) -> tuple:
    """A cloth of 5 cm checks, every other in the speckled table's colour, the others darker by a difference."""
    rng = np.random.default_rng(0)
    table = Table(0.7, (0.4, 0.5), (0.0, 0.0))
    camera = look_at(np.array([-1.0, 0.0, 1.3]), np.array([0.0, 0.0, 0.7]), 520.0)
    xy = plane_coordinates(camera, table.height)
    squares = (np.floor(xy / 0.05).sum(axis=-1) % 2 == 0)[..., None]
    cloth = (np.abs(xy[..., 0]) < 0.2) & (np.abs(xy[..., 1]) < 0.25)
    speckles = cv2.GaussianBlur(rng.normal(size=cloth.shape), (0, 0), 4.0)
    wood = np.array((150.0, 125.0, 95.0))
    top = wood * (1.0 + 0.09 * speckles / speckles.std())[..., None]
    image = np.where((table_margin(table, xy) > 0)[..., None], top, (60, 90, 60))
    image = np.where(cloth[..., None], np.where(squares, wood, wood - difference), image)
    image = cv2.GaussianBlur(image, (0, 0), 0.5) + rng.normal(0.0, 3.0, image.shape)
    return np.clip(np.round(image), 0, 255).astype(np.uint8), camera, table, cloth


def test_a_cloth_hardly_unlike_the_table() -> None:
    """Differences no larger than the table's speckles make a cloth where they fill a rectangle."""
    image, camera, table, cloth = faint((28, -8, 0))
    # Without the squares that are like the table it would be 0.5; with all but those at the outline 0.8.
    assert overlap(segment_before(image, camera, table), cloth) > 0.9


def test_a_cloth_too_like_the_table() -> None:
    """Where nothing tells, the error says what would help; the table's top, which the floor surrounds, is no cloth."""
    image, camera, table, _ = faint((4, -4, 0))
    with pytest.raises(ClothNotFoundError, match="hint"):
        segment_before(image, camera, table)


@pytest.mark.long
@pytest.mark.parametrize("name", sorted(AMBIGUOUS))
def test_doubt_is_told(name: str) -> None:
    """Much of a cloth in the table's colour is said to be in doubt, and next to nothing of one that is unlike it."""
    for look, doubtful in ((name, True), ("red on brown", False)):
        scene = pair(look)
        mask, doubt = look_after(scene.after, scene.camera, scene.table, scene.before, scene.mask_before, scene.hand)
        # From 0.13 to 0.38 of the three, and at most 0.002 of all others.
        assert (doubt.sum() > 0.1 * mask.sum()) == doubtful


def test_one_mask_serves_the_other(striped: Pair) -> None:
    """The mask found before is good enough to find the cloth after."""
    before = segment_before(striped.before, striped.camera, striped.table)
    after = segment_after(striped.after, striped.camera, striped.table, striped.before, before, striped.hand)
    assert overlap(after, striped.mask_after) > 0.95


def test_same_input_same_mask(striped: Pair) -> None:
    """Nothing is left to chance."""
    arguments = (
        striped.after,
        striped.camera,
        striped.table,
        striped.before,
        striped.mask_before,
        striped.hand,
    )
    assert (segment_after(*arguments) == segment_after(*arguments)).all()
    first, second = (segment_before(striped.before, striped.camera, striped.table) for _ in range(2))
    assert (first == second).all()


@pytest.mark.parametrize("name", ["red on brown", "grey checks on brown", "navy on dark grey"])
def test_table_of_unknown_size(name: str) -> None:
    """A cloth that the table surrounds is found without the table's extents."""
    scene = pair(name, lift=False)
    found = segment_before(scene.before, scene.camera, Table(scene.table.height))
    assert overlap(found, scene.mask_before) > 0.98


@pytest.mark.parametrize("half_extents", [(2.0, 2.0), (100.0, 100.0)])
@pytest.mark.parametrize("name", few(["red on brown", "navy on dark grey"], "navy on dark grey"))
def test_table_said_to_be_larger_than_it_is_seen(name: str, half_extents: tuple[float, float]) -> None:
    """A table whose edge is not where it is said to be does not keep the cloth from being found."""
    scene = pair(name, lift=False)
    found = segment_before(scene.before, scene.camera, Table(scene.table.height, half_extents))
    assert overlap(found, scene.mask_before) > 0.98


@pytest.mark.parametrize("name", ["red on brown", "blue stripes on wood", "grey checks on brown"])
def test_an_image_that_is_little_more_than_the_cloth(name: str) -> None:
    """Sixteen pixels of table around the cloth are enough."""
    scene = pair(name, lift=False)
    rows, columns = np.nonzero(scene.mask_before)
    left, top = max(columns.min() - 16, 0), max(rows.min() - 16, 0)
    window = (slice(top, rows.max() + 17), slice(left, columns.max() + 17))
    image = np.ascontiguousarray(scene.before[window])
    camera = replace(
        scene.camera, width=image.shape[1], height=image.shape[0], cx=scene.camera.cx - left, cy=scene.camera.cy - top
    )
    assert overlap(segment_before(image, camera, scene.table), scene.mask_before[window]) > 0.98


@pytest.mark.parametrize("known", [True, False])
def test_hints(striped: Pair, known: bool) -> None:
    """A pixel on the cloth and a box around it lead to the same cloth."""
    table = striped.table if known else Table(striped.table.height)
    rows, columns = np.nonzero(striped.mask_before)
    middle = (columns.mean(), rows.mean())
    box = (columns.min() - 4, rows.min() - 4, columns.max() + 4, rows.max() + 4)
    for hint in (middle, box):
        found = segment_before(striped.before, striped.camera, table, hint=hint)
        assert overlap(found, striped.mask_before) > 0.98


def test_hint_chooses_between_cloths(striped: Pair) -> None:
    """Of two things on the table, the larger is the cloth unless a hint points at the other."""
    image = striped.before.copy()
    columns = np.nonzero(striped.mask_before)[1]
    places = [np.array([-0.1, y, striped.table.height]) for y in (-0.35, 0.35)]
    pixels = striped.camera.project(places)
    u, v = np.round(pixels[np.abs(pixels[:, 0] - columns.mean()).argmax()]).astype(int)
    patch = np.zeros(striped.mask_before.shape, dtype=bool)
    patch[v - 20 : v + 20, u - 30 : u + 30] = True
    patch &= ~striped.mask_before
    image[patch] = (40, 140, 60)
    assert overlap(segment_before(image, striped.camera, striped.table), striped.mask_before) > 0.98
    assert overlap(segment_before(image, striped.camera, striped.table, hint=(u, v)), patch) > 0.9


@pytest.mark.parametrize("hint", [(1, 2, 3), (-5, 10), (10, 700), (50, 50, 40, 90), (np.nan, 3)])
def test_bad_hints(striped: Pair, hint: tuple[float, ...]) -> None:
    """A hint that is no pixel or box of the image is refused."""
    with pytest.raises(InvalidInputError):
        segment_before(striped.before, striped.camera, striped.table, hint=hint)


def test_empty_table() -> None:
    """A table without a cloth, speckled as it is, is a named error and not a mask of speckles."""
    for number, known in [(0, True), (3, True), (7, True), (9, True), (0, False), (8, False)]:
        scene = make_pair(LOOKS[number], 7 + number, lift=False, cloth=False)
        with pytest.raises(ClothNotFoundError):
            segment_before(scene.before, scene.camera, scene.table if known else Table(scene.table.height))


def test_camera_that_looks_away(striped: Pair) -> None:
    """A camera that does not see the table finds no cloth."""
    pose = striped.camera.camera_to_world.copy()
    pose[:3, :3] = pose[:3, :3] @ np.diag([-1.0, 1.0, -1.0])
    camera = Camera(640, 480, 500.0, 500.0, 319.5, 239.5, pose)
    with pytest.raises(ClothNotFoundError):
        segment_before(striped.before, camera, striped.table)


def test_nothing_in_the_hand(striped: Pair) -> None:
    """A hand with no cloth anywhere near is a named error: the image after shows the bare table."""
    bare = make_pair(LOOKS[BY_NAME["blue stripes on wood"]], 500 + BY_NAME["blue stripes on wood"], lift=False).after
    with pytest.raises(ClothNotFoundError):
        segment_after(bare, striped.camera, striped.table, striped.before, striped.mask_before, striped.hand)


@pytest.mark.filterwarnings("error")
def test_a_black_image_has_no_cloth(striped: Pair) -> None:
    """Nor has one in which a channel is black a gain for it; NumPy warns of no division by it."""
    known = (striped.camera, striped.table, striped.before, striped.mask_before, striped.hand)
    with pytest.raises(ClothNotFoundError, match="colours of the cloth"):
        segment_after(np.zeros_like(striped.after), *known)
    background = compare(
        striped.before, striped.after * np.array((1, 0, 1), np.uint8), striped.mask_before,
        np.ones_like(striped.mask_before), np.zeros_like(striped.mask_before),
    )  # fmt: skip
    assert np.isfinite(background.density()).all()


def test_hand_far_away(striped: Pair) -> None:
    """A hand behind the camera, with all that the cloth could reach, is a named error."""
    with pytest.raises(ClothNotFoundError):
        segment_after(
            striped.after,
            striped.camera,
            striped.table,
            striped.before,
            striped.mask_before,
            (-9.0, 0.0, 1.0),
        )


def test_masks_of_files(striped: Pair) -> None:
    """A mask of 0 and 255 counts as one of False and True; an empty one is a named error."""
    levels = striped.mask_before.astype(np.uint8) * 255
    arguments = (striped.after, striped.camera, striped.table, striped.before)
    assert (
        segment_after(*arguments, levels, striped.hand) == segment_after(*arguments, levels > 0, striped.hand)
    ).all()
    with pytest.raises(ClothNotFoundError):
        segment_after(*arguments, levels * 0, striped.hand)


@pytest.mark.parametrize("hand", [(0.0, 0.0), (np.nan, 0.0, 1.0), (0.0, np.inf, 1.0)])
def test_bad_hands(striped: Pair, hand: tuple[float, ...]) -> None:
    """A hand's position is three finite numbers."""
    with pytest.raises(InvalidInputError):
        segment_after(striped.after, striped.camera, striped.table, striped.before, striped.mask_before, hand)


def test_images_must_fit(striped: Pair) -> None:
    """Images and masks of another size or kind than the camera's are refused, with what was received."""
    good = (striped.before, striped.mask_before, striped.hand)
    with pytest.raises(ImageError, match="480, 640, 3"):
        segment_before(striped.before[:100], striped.camera, striped.table)
    with pytest.raises(ImageError, match="float64"):
        segment_before(striped.before / 255.0, striped.camera, striped.table)
    with pytest.raises(ImageError):
        segment_after(striped.after[..., 0], striped.camera, striped.table, *good)
    with pytest.raises(ImageError):
        segment_after(striped.after, striped.camera, striped.table, good[0], good[1][:9], good[2])


def test_read_image(tmp_path) -> None:
    """An image file comes back as RGB; anything else is a named error."""
    path = tmp_path / "red.png"
    cv2.imwrite(str(path), np.full((4, 6, 3), (0, 0, 255), dtype=np.uint8))
    image = read_image(path)
    assert image.shape == (4, 6, 3) and image.dtype == np.uint8 and (image == (255, 0, 0)).all()
    (tmp_path / "text.png").write_text("no image")
    (tmp_path / "empty.png").write_bytes(b"")
    for name in ("text.png", "empty.png", "missing.png"):
        with pytest.raises(ImageError, match=name):
            read_image(tmp_path / name)


@pytest.mark.parametrize(
    "bad",
    [
        {"height": np.nan},
        {"height": 0.7, "half_extents": (0.4, -0.1)},
        {"height": 0.7, "thickness": -0.01},
        {"height": 0.7, "centre": (np.inf, 0.0)},
    ],
)
def test_bad_tables(bad: dict) -> None:
    """A table's numbers are finite and its sizes positive."""
    with pytest.raises(InvalidInputError):
        Table(**bad)
