"""Estimating a pick from masks: a cloth picked by the engine itself, on another mesh than the estimator's."""

import json
from dataclasses import replace

import cv2
import numpy as np
import pytest

import nuno
from nuno import ImageError, InvalidInputError
from nuno.camera import raster
from nuno.camera.table import Table
from nuno.estimate.contact_sheet import contact_sheet
from nuno.estimate.hypotheses import HYPOTHESES, Discretisation
from nuno.estimate.lift_prior import log_prior_of_lift
from nuno.estimate.pick_sight import draw_futures, masks_of_turned
from nuno.estimate.ranking import SHARE
from nuno.estimate.rotations import turn

TOP = 0.72  # [m] height of the table top
REST_HEIGHT = 0.0025  # [m]
SIZE = np.array((0.5, 0.35))  # [m]
CENTRE, YAW = np.array((0.05, 0.02, TOP + REST_HEIGHT)), 0.35  # [m], [rad]
UV = (0.8, 0.2)  # the picked point on the sheet: a grid point of 6 x 6
HALF = (0.45, 0.6)  # [m] of the table top
TURN = float(np.radians(20))  # [rad] of the cloth about the hand's vertical, in `turned`
DOUBLES = Discretisation(15, 12, HYPOTHESES[::2])  # tells neighbouring points of a 6 x 6 grid apart
QUICK = Discretisation(10, 10, HYPOTHESES[::3])  # and this one does not


def make_camera():
    """A small camera 1 m before the table and 0.5 m above it, looking 25 degrees down."""
    down, pose = np.deg2rad(25.0), np.eye(4)
    pose[:3, :3] = [[0, -np.sin(down), np.cos(down)], [-1, 0, 0], [0, -np.cos(down), -np.sin(down)]]
    pose[:3, 3] = (-0.95, 0.0, TOP + 0.5)
    return nuno.Camera(320, 240, 250.0, 250.0, 159.5, 119.5, pose)


@pytest.fixture(scope="module")
def seen():
    """What is seen of a lift by 0.4 m, 5 cm sideways."""
    return lifted(UV, (0.04, -0.03, 0.4))


def lifted(uv, way):
    """The masks before and after, the hand, what the label rule says of the picked point, and the mask after a turn."""
    camera = make_camera()
    world = nuno.World(device="cpu", substeps=18)
    world.add(nuno.box((2 * HALF[0], 2 * HALF[1], 0.04), name="table", position=(0, 0, TOP - 0.02)))
    cloth = world.add(nuno.sheet(SIZE, cells=(15, 10), position=CENTRE)).rotate(YAW, "z", wrt="world")
    corners = cloth.vertices[[0, 15, 175, 160]]  # u, v = (0, 0), (1, 0), (1, 1), (0, 1)
    before = world.masks(camera, cloth).numpy()
    world.attach(cloth, nuno.Cloth(bending_rigidity=3e-4, area_density=0.3, thickness=2 * REST_HEIGHT))
    point = cloth.at(*uv)
    start = point.positions(cloth.vertices, cloth.faces)[0]
    hand = start + np.array(way)
    world.grip(cloth, point, to=nuno.Path([0.0, 1.5], [start, hand], interpolation="minimum_jerk"))
    world.run(3.5)
    after = world.masks(camera, cloth).numpy()
    cloth.rotate(TURN, "z", wrt="world")
    cloth.translate(hand - point.positions(cloth.vertices, cloth.faces)[0], wrt="world")
    turned = world.masks(camera, cloth).numpy()
    # C00 is the corner nearest to pixel (0, 0); the sheet's x is the longer side, so u runs from or to C00
    first = int(np.linalg.norm(camera.project(corners), axis=1).argmin())
    from_end = ((0, 1, 1, 0)[first], (0, 0, 1, 1)[first])
    u, v = (1 - a if end else a for a, end in zip(uv, from_end, strict=True))
    true = (round(u * 5), round(v * 5))
    return {"before_mask": before, "after_mask": after, "hand": hand}, true, (u, v), corners[first], turned


def options(seen, **changes):
    """Arguments of estimate_pick for what was seen, with changes."""
    given = dict(camera=make_camera(), table_height=TOP, table_half_extents=HALF, table_centre=(0, 0))
    return given | seen[0] | dict(discretisations=[QUICK], device="cpu", progress=False) | changes


@pytest.fixture(scope="module")
def result(seen):
    """The estimate with the 6 x 6 grid."""
    return nuno.estimate_pick(None, None, **options(seen, discretisations=[DOUBLES]))


@pytest.mark.long
def test_what_was_learned_is_asked_unless_left_out(result, seen):
    """The truth is found without it too, by other evidence: that of the hand-made likelihood alone."""
    without = nuno.estimate_pick(None, None, **options(seen, discretisations=[DOUBLES], learned=False))
    assert without.best == seen[1]
    assert np.abs(without.scores - result.scores).max() > 0.1
    np.testing.assert_allclose(without.eq1, result.eq1, atol=1e-12)  # same futures, of which it changes nothing


@pytest.mark.long
def test_the_prior_of_the_lift_is_added_unless_left_out(seen):
    """Without it the scores are the evidence alone, to the bit, and so they are with a prior that is flat.

    With it they are the sum of both, but for what the order of three sums rounds off (the hand may go two ways).
    """
    points = np.array(((0.0, 0.0), (0.21, 0.4), (1.0, 0.5), (0.7, 0.9)))  # no grid
    given = options(seen, candidates=points)
    alone, flat, with_it = (nuno.estimate_pick(None, None, **given, sideways=s) for s in (None, 1e12, 0.5))
    np.testing.assert_array_equal(flat.scores, alone.scores)
    prior = log_prior_of_lift(alone.rectangle, points, seen[0]["hand"], 0.5)
    assert np.ptp(prior) > 0.5
    np.testing.assert_allclose(with_it.scores, alone.scores + prior, rtol=4e-16)
    assert alone.to_dict()["sideways"] is None and with_it.to_dict()["sideways"] == 0.5
    np.testing.assert_array_equal(nuno.estimate_pick(None, None, **given).scores, with_it.scores)
    likely = np.exp(with_it.scores - with_it.scores.max())
    # no surer than the evidence says
    assert with_it.confidence == with_it.probabilities.max() <= (likely / likely.sum()).max() + 1e-12
    assert with_it.probabilities.sum() == pytest.approx(1.0)
    np.testing.assert_array_equal(np.argsort(with_it.probabilities), np.argsort(with_it.scores))
    for score in ("chamfer", "eq1"):
        one, other = (nuno.estimate_pick(None, None, **given, score=score, sideways=s) for s in (None, 0.5))
        np.testing.assert_array_equal(one.scores, other.scores)


@pytest.mark.long
def test_a_lift_far_sideways_is_still_found():
    """A corner that was carried 0.4 m along the cloth's side and 0.35 m up: the silhouette tells.

    The prior holds the point that is under the hand now for tens of times as likely.
    """
    seen = lifted((0.0, 0.0), (0.4 * np.cos(YAW), 0.4 * np.sin(YAW), 0.35))
    result = nuno.estimate_pick(None, None, **options(seen, discretisations=[DOUBLES]))
    prior = log_prior_of_lift(result.rectangle, result.labels / 5, seen[0]["hand"], 0.5)
    true = result.labels.tolist().index(list(seen[1]))
    assert prior[true] < prior.max() - np.log(20.0)
    assert result.best == seen[1] and result.confidence > 0.8


def test_a_path_that_was_seen_tells_where_it_began(seen):
    """Coarse meshes do not tell neighbours apart; the path begins at the true point, 7 cm from its neighbours."""
    way = np.array((0.04, -0.03, 0.4))
    share = np.linspace(0.0, 1.0, 30)[:, None]
    path = seen[0]["hand"] - way + (share**3 * (10.0 + share * (6.0 * share - 15.0))) * way
    found = nuno.estimate_pick(None, None, **options(seen, hand_path=path))
    assert found.best == seen[1]
    with pytest.raises(InvalidInputError, match="hand_path must end where the hand is"):
        nuno.estimate_pick(None, None, **options(seen, hand_path=path[:-12]))


def test_the_picked_point_is_found(result, seen):
    """The best of 36 is the point that was picked, and the rest are ranked behind it."""
    assert result.best == seen[1]
    assert result.labels.shape == (36, 2) and sorted(result.order) == list(range(36))
    assert result.ranking[0][:2] == result.best
    assert (np.diff(result.scores[result.order]) <= 0).all() and 0 < result.confidence <= 1
    # eq. (1) counts the pixels that agree, of which most are empty: all are high, the best among the highest
    assert result.eq1[result.order[0]] >= np.sort(result.eq1)[-3] > 0.95


def test_the_cloth_is_measured(result, seen):
    """Corners in the label rule's order, within half a pixel's 2 to 3 mm; the long side first."""
    np.testing.assert_allclose(result.rectangle.corners[0], seen[3], atol=4e-3)
    np.testing.assert_allclose((result.rectangle.long_m, result.rectangle.short_m), SIZE, atol=5e-3)


def test_stages_are_timed_and_futures_kept(result):
    """Seconds by stage add up; the futures are a batch of guesses x candidates."""
    stages = result.seconds
    assert set(stages) == {"read", "see", "compile", "imagine", "compare", "total"}
    assert min(stages.values()) >= 0.0
    assert sum(stages.values()) - stages["total"] == pytest.approx(stages["total"], rel=1e-9)
    assert result.futures.world.world_count == 36 * len(DOUBLES.hypotheses)
    assert result.masks.shape == (36, 120, 160) and result.real.mask.shape == (120, 160)


@pytest.fixture
def small(seen):
    """The estimate with a 3 x 2 grid, anew for every test."""
    return nuno.estimate_pick(None, None, **options(seen, candidates=(3, 2)))


def test_the_same_input_gives_the_same_answer(small, seen):
    """Every score, bit for bit; also where the rectangle is given instead of the mask that it came from."""
    again = nuno.estimate_pick(None, None, **options(seen, candidates=(3, 2)))
    given = options(seen, candidates=(3, 2), rectangle=small.rectangle, before_mask=None)
    measured = nuno.estimate_pick(None, None, **given)
    assert measured.rectangle is small.rectangle and measured.mask_before is None
    for other in (again, measured):
        np.testing.assert_array_equal(other.scores, small.scores)
        np.testing.assert_array_equal(other.eq1, small.eq1)


def test_adopt_gives_the_best_future(small, seen):
    """The single world becomes what the best future is, and can be run on."""
    result = small
    futures = result.futures.world
    future = futures.find("cloth").vertices[result.best_index]
    world = result.adopt()
    cloth = world.find("cloth")
    # float32 positions of about 1 m, turned and moved: three roundings of 6e-8
    np.testing.assert_allclose(cloth.vertices, turn(future, result.hand, result.turn), atol=3e-7)
    assert world.world_count == 1 and cloth.is_dynamic and world.time == futures.time
    assert result.best_index % 6 == result.order[0]
    highest = cloth.vertices[:, 2].argmax()
    np.testing.assert_allclose(cloth.vertices[highest], seen[0]["hand"], atol=5e-3)  # it hangs in the hand
    world.run(0.1)
    assert np.isfinite(cloth.vertices).all()


@pytest.mark.long
def test_a_cloth_that_turned_is_recognised(result, seen):
    """A cloth that turned by 20 degrees in the hand: the point and the turn are found, and adopted."""
    given = options(seen, after_mask=seen[4], discretisations=[DOUBLES], rectangle=result.rectangle)
    found = nuno.estimate_pick(None, None, **given)
    assert found.best == seen[1] and found.turn == pytest.approx(TURN)
    assert abs(result.turn) < TURN / 2 + 1e-9  # the one that did not turn is not taken for turned
    true = found.order[0]
    still = nuno.estimate_pick(None, None, **given, turns=[0.0])
    assert still.turn == 0.0 and still.scores[true] < found.scores[true]
    future = found.futures.world.find("cloth").vertices[found.best_index]
    cloth = found.adopt().find("cloth")
    np.testing.assert_allclose(cloth.vertices, turn(future, found.hand, TURN), atol=3e-7)
    camera = make_camera().scaled(0.5)
    drawn = found.world.masks(camera, cloth).numpy()
    assert (drawn != found.masks[true]).mean() < 0.01  # a mask is drawn as thick as the cloth is, a body is not


@pytest.mark.parametrize("raised", [0.0, 0.1])
def test_a_cloth_is_not_turned_into_the_table(raised, small):
    """Where a turned vertex would be inside the table the future is adopted as it is."""
    small.futures.world.find("table").translate((0.0, 0.0, raised))
    future = small.futures.world.find("cloth").vertices[small.best_index]
    expected = future if raised else turn(future, small.hand, TURN)
    world = replace(small, turn=TURN).adopt()
    np.testing.assert_allclose(world.find("cloth").vertices, expected, atol=3e-7)


def test_a_turned_future_is_drawn_as_its_turned_mesh(small, seen):
    """The turned view of a cloth before a table that stays, against turned vertices in the true view."""
    camera, hand, table = make_camera(), seen[0]["hand"], Table(TOP, HALF, (0.0, 0.0))
    worlds = np.arange(small.futures.world.world_count)
    keys, region = draw_futures(small.futures, camera, table, TURN, hand)
    part = raster.masks_of(keys).numpy()
    drawn = np.zeros((len(worlds), camera.height, camera.width), dtype=bool)
    drawn[:, region.y0 : region.y0 + region.height, region.x0 : region.x0 + region.width] = part
    turned = masks_of_turned(small.futures, worlds, np.full(len(worlds), TURN), camera, table, hand)
    # vertices are snapped to 1/256 px, a few in a thousand of them to the other side: a pixel may change with one
    assert np.count_nonzero(drawn != turned) <= len(worlds) and drawn.any(axis=(1, 2)).all()


@pytest.mark.long
def test_another_grid(seen):
    """6 x 11 candidates, the picked point among them: the answer is it or a neighbour at a step of 6 x 6."""
    result = nuno.estimate_pick(None, None, **options(seen, candidates=(6, 11)))
    assert result.grid == (6, 11) and len(result.ranking) == 66
    found = np.array(result.best) / (5, 10)
    assert np.abs(found - seen[2]).max() <= 0.2 + 1e-9


def test_points_instead_of_a_grid(result, seen):
    """Fractions of the sides, on no vertex of the mesh: the nearest to the picked one wins."""
    opposite = np.clip(1 - np.array(seen[2]), 0.07, 0.93)
    points = np.array([(0.03, 0.5), (0.5, 0.97), seen[2], (0.33, 0.41), opposite])
    found = nuno.estimate_pick(None, None, **options(seen, candidates=points, rectangle=result.rectangle))
    assert found.best == pytest.approx(seen[2])
    np.testing.assert_array_equal(found.labels, points)
    assert all(isinstance(value, float) for value in found.best)


def test_images_of_a_plain_cloth_change_nothing(small, seen):
    """Its pattern says nothing: scores are those of masks alone, on request bit for bit.

    A residual that is 0 comes out as the float32 rounding of sums of squares of about 3: some 1e-6 beside the floor of
    0.003, halved and 25 times that in the evidence.
    """
    images = [
        np.where(seen[0][mask][..., None], (150, 90, 60), (60, 70, 80)).astype(np.uint8)
        for mask in ("before_mask", "after_mask")
    ]
    looks = nuno.estimate_pick(*images, **options(seen, candidates=(3, 2), rectangle=small.rectangle))
    assert looks.score_name == "log_evidence_with_pattern" and small.score_name == "log_evidence"
    np.testing.assert_allclose(looks.scores, small.scores, rtol=0, atol=12.5 * 1e-6 / 0.003)
    given = options(seen, candidates=(3, 2), rectangle=small.rectangle, score="silhouette")
    masks = nuno.estimate_pick(*images, **given)
    assert masks.score_name == "log_evidence"
    np.testing.assert_array_equal(masks.scores, small.scores)


def test_a_sure_answer_ends_the_stages(small, seen):
    """Once a candidate is as likely as `sure`, later stages are left out, bit for bit; 1 runs them all."""
    stages = [QUICK, replace(QUICK, hypotheses=HYPOTHESES[1:3], best=3)]
    given = options(seen, candidates=(3, 2), discretisations=stages)
    early = nuno.estimate_pick(None, None, **given, sure=small.confidence)
    np.testing.assert_array_equal(early.scores, small.scores)
    late = nuno.estimate_pick(None, None, **given, sure=1.0)
    looked = late.scores != small.scores
    likely = np.cumsum(small.probabilities[small.order])
    plausible = min(3, max(2, 1 + int((likely < SHARE).sum())))
    assert looked.sum() == plausible and looked[small.order[:plausible]].all()


def test_a_doubtful_answer_says_how_likely_it_is(small):
    """Below `LOW_CONFIDENCE` the warning gives the probability of the answer and names the next; above it says none."""
    scores = np.full(6, -50.0)
    scores[[4, 1, 3]] = np.log((0.6, 0.3, 0.1))
    order = np.argsort(-scores, kind="stable")
    doubtful = replace(small, scores=scores, order=order, trusted=1.0, seen_warnings=())
    assert doubtful.confidence == pytest.approx(0.6)
    (warning,) = doubtful.warnings
    assert (
        warning == "low confidence: (2, 0) is right with a probability of 60 %, (0, 1) with 30 % and (1, 1) with 10 %"
    )
    sure = replace(doubtful, scores=np.where(scores > -1, scores, -50.0))
    assert not sure.warnings
    # what is not trusted is not said, however sure the evidence
    assert replace(sure, trusted=0.7).confidence == pytest.approx(0.7, abs=1e-9)
    assert "low confidence" in replace(sure, trusted=0.7).warnings[-1]
    other = replace(
        doubtful, scores=np.array((0.9, 0.5, 0.5, 0.89, 0.1, 0.1)), score_name="iou", order=np.array([0, 3, 1, 2, 4, 5])
    )
    assert "(1, 1)" in other.warnings[0] and "almost as well" in other.warnings[0]


def test_a_single_candidate_is_not_called_sure(small):
    """It has no rival, so that its probability is 1 whatever is seen: a warning says so, of every score."""
    for name in ("log_evidence", "iou"):
        alone = replace(
            small, labels=small.labels[:1], scores=np.array([0.5]), order=np.array([0]), score_name=name,
            seen_warnings=(),
        )  # fmt: skip
        assert alone.confidence == 1.0 and "only one candidate" in " ".join(alone.warnings)
        assert str(alone.to_dict()["warnings"]).count("only one candidate") == 1


@pytest.mark.parametrize(("score", "name"), [("iou", "iou"), ("eq1", "eq1")])
def test_other_scores(score, name, result, seen):
    """They rank by another measure; the paper's is what eq1 reports."""
    given = options(seen, score=score, rectangle=result.rectangle, candidates=(3, 2))
    found = nuno.estimate_pick(None, None, **given)
    assert found.score_name == name and (found.scores <= 1).all() and (found.scores >= 0).all()
    if score == "eq1":
        np.testing.assert_array_equal(found.scores, found.eq1)


def test_an_endless_table(result, seen):
    """Without extents the table is a plane at its height."""
    endless = dict(table_half_extents=None, table_centre=None)
    given = options(seen, candidates=(2, 2), rectangle=result.rectangle, **endless)
    found = nuno.estimate_pick(None, None, **given)
    assert [body.name for body in found.world.bodies] == ["table", "cloth"]


def test_save_and_figure(result, tmp_path):
    """result.json holds to_dict; the picture is the contact sheet, which ``figure`` shows, too."""
    result.save(tmp_path / "a" / "b")
    folder = tmp_path / "a" / "b"
    assert json.loads((folder / "result.json").read_text()) == json.loads(json.dumps(result.to_dict()))
    assert (folder / "result.png").stat().st_size > 10_000
    picture = cv2.imread(str(folder / "result.png"))[..., ::-1]
    np.testing.assert_array_equal(picture, contact_sheet(result))
    (axes,) = result.figure().axes
    np.testing.assert_array_equal(axes.images[0].get_array(), picture)
    result.save(tmp_path / "c", picture=False)
    assert [path.name for path in (tmp_path / "c").iterdir()] == ["result.json"]


BAD = {
    "no image": (dict(before_mask=None), InvalidInputError, "image before"),
    "no image after": (dict(after_mask=None), InvalidInputError, "both images|image before"),
    "mask of another size": (dict(after_mask=np.ones((10, 10), bool)), ImageError, "240, 320"),
    "empty mask after": (dict(after_mask=np.zeros((240, 320), bool)), ImageError, "empty"),
    "empty mask before": (dict(before_mask=np.zeros((240, 320), bool)), nuno.ClothNotFoundError, "empty"),
    "a hand of two": (dict(hand=(0, 1)), InvalidInputError, "hand"),
    "a hand of nan": (dict(hand=(0, 1, np.nan)), InvalidInputError, "hand"),
    "a hand behind the camera": (dict(hand=(-3, 0, 1)), InvalidInputError, "behind"),
    "a hand out of view": (dict(hand=(0, 9, 1)), InvalidInputError, "outside"),
    "one candidate": (dict(candidates=(1, 6)), InvalidInputError, "2 x 2"),
    "a point off the cloth": (dict(candidates=[(0.5, 1.2)]), InvalidInputError, "fractions"),
    "no points": (dict(candidates=np.zeros((0, 2))), InvalidInputError, "candidates"),
    "points of three": (dict(candidates=[(0, 0, 0)]), InvalidInputError, "candidates"),
    "an unknown score": (dict(score="best"), InvalidInputError, "chamfer"),
    "no mesh": (dict(discretisations=[]), InvalidInputError, "discretisation"),
    "no turn of 0": (dict(turns=(0.1,)), InvalidInputError, "turns"),
    "a lift straight up": (dict(sideways=0.0), InvalidInputError, "sideways"),
    "a lift of nan": (dict(sideways=np.nan), InvalidInputError, "sideways"),
    "a lift of a word": (dict(sideways="far"), InvalidInputError, "sideways"),
    "sure beyond all doubt": (dict(sure=1.5), InvalidInputError, "sure"),
    "no such device": (dict(device="gpu"), InvalidInputError, "device"),
    "a camera without entries": (dict(camera={}), InvalidInputError, "width"),
    "a table of nan": (dict(table_height=np.nan), InvalidInputError, "table_height"),
    "a table of no thickness": (dict(table_thickness=0.0), InvalidInputError, "table_thickness"),
    "a rest height below the table": (dict(rest_height=-0.01), InvalidInputError, "rest_height"),
    "a lift of no time": (dict(lift_seconds=0.0), InvalidInputError, "lift_seconds"),
    "no image file": (dict(before="nothing.png", before_mask=None), ImageError, "nothing.png"),
}  # fmt: skip


@pytest.mark.parametrize("name", BAD)
def test_bad_inputs(name, seen):
    """Each raises its named error, which says what is valid."""
    changes, error, words = BAD[name]
    given = options(seen, **changes)
    with pytest.raises(error, match=words):
        nuno.estimate_pick(given.pop("before", None), None, **given)
