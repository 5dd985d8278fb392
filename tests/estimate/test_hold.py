"""By which point a garment is held: candidates, symmetries, images, and small cases."""

import json
from dataclasses import replace

import numpy as np
import pytest

import nuno
from nuno import ImageError, InvalidInputError
from nuno.estimate.hold_views import hold_mask, hold_masks
from nuno.estimate.imagined_holds import begin, hold_candidates
from nuno.mesh.sewn import BACK, FRONT

HAND = np.array((0.2, -0.1, 1.3))  # [m]
GUESS = nuno.HoldGuess(1e-4)


def camera_at(yaw, size=0.3):
    """Level with what hangs from the hand, at an angle about the vertical."""
    eye = HAND + size * np.array((6.0 * np.cos(yaw), 6.0 * np.sin(yaw), -0.5))
    return nuno.Camera.look_at(eye, HAND - (0.0, 0.0, 0.5 * size), fov=0.35, width=320, height=240)


@pytest.fixture(scope="module")
def sock():
    """A coarse one, of about 100 vertices."""
    return nuno.garment("sock", cell=0.03)


@pytest.fixture(scope="module")
def holds(sock):
    """The sock held by a few points: heel, toe, leg and their like behind."""
    held = sorted({int(one[v]) for one in sock.symmetries for v in (
        sock.nearest((-0.12, 0.15), "front"), sock.nearest((0.08, -0.1), "front"), sock.nearest((-0.07, 0.0), "front"),
        sock.nearest((0.12, -0.1), "both"), sock.nearest((-0.11, -0.14), "both"),
    )})  # fmt: skip
    return nuno.imagine_holds(sock, candidates=held, guesses=[GUESS], device="cpu", progress=False)


@pytest.mark.parametrize("name", ["t-shirt", "skirt", "sock", "towel"])
def test_candidates_cover_both_layers(name):
    """Every vertex is within 0.7 spacings of one on the cloth; symmetries take candidates to candidates."""
    garment = nuno.garment(name, cell=0.05 if name != "sock" else 0.03)
    spacing = 0.15 if name != "sock" else 0.08
    chosen = hold_candidates(garment, spacing)
    assert len(set(chosen)) == len(chosen)
    assert garment.distances(chosen).min(axis=0).max() <= 0.7 * spacing
    for one in garment.symmetries:
        assert set(one[chosen]) == set(chosen)
    if garment.layers == 2:
        assert {FRONT, BACK} <= set(garment.layer[chosen])


def test_garments_begin_with_the_held_layer_up(sock):
    """A point of the back: turned over, its layer above. Upright: its middle straight below. Nothing is deformed."""
    rest = np.linalg.norm(sock.vertices[:, None] - sock.vertices[:1], axis=2)
    for layer in ("front", "back"):
        vertex = sock.nearest((-0.07, 0.05), layer)
        for upright in (False, True):
            x = begin(sock, vertex, upright)
            np.testing.assert_allclose(x[vertex], 0.0, atol=1e-15)
            np.testing.assert_allclose(np.linalg.norm(x[:, None] - x[:1], axis=2), rest, atol=1e-12)
            if upright:
                assert np.hypot(*x.mean(axis=0)[:2]) < 0.01 and x.mean(axis=0)[2] < 0.0
            else:
                assert x[:, 2].max() < 1e-12  # nothing lies above the held layer


def test_the_truth_itself_is_found(holds):
    """A future drawn at one of the turns is that future: overlap 1, and no candidate is likelier.

    Alike by the front's symmetry on the back, a rotation: the same silhouette at another turn, so as likely but for
    how the garment folded.
    """
    turns = 2.0 * np.pi * np.array((3, 14)) / 24
    for k in (0, 3):
        cameras = [camera_at(0.0), camera_at(np.pi / 2)]
        masks = [hold_masks(holds, [(0, k)], [turns[0]], camera, HAND)[0] for camera in cameras]
        result = nuno.estimate_hold(holds.garment, masks, cameras, HAND, holds=holds, hand_radius=0.0)
        assert result.vertex == holds.candidates[k] and result.distance(result.vertex) == 0.0
        assert result.overlap > 0.97  # drawn at another resolution than it is compared at
        assert result.probabilities.sum() == pytest.approx(1.0)
        np.testing.assert_allclose(result.positions()[result.vertex], HAND, atol=1e-4)
        assert k in result.groups[0] and result.confidence_up_to_symmetry >= result.confidence


def test_symmetric_candidates_look_alike(holds):
    """A sock held by its front and by its back at the same place: mirror images of each other.

    In the plane of the sock's flat shape they are, vertex by vertex: z becomes -z, and with it the garment turns over.
    The best overlap of the one's silhouettes over all turns with the other's is near 1; folds that fall as chance has
    it take a little. A point elsewhere overlaps less.
    """
    sock, camera = holds.garment, camera_at(0.3)
    place = {int(v): k for k, v in enumerate(holds.candidates)}
    front = next(k for v, k in place.items() if sock.layer[v] == FRONT)
    back = place[int(sock.swap[holds.candidates[front]])]
    mask = hold_masks(holds, [(0, front)], [0.4], camera, HAND)[0]
    turns = np.linspace(0.0, 2.0 * np.pi, 72, endpoint=False)

    def overlap(k):
        masks = hold_masks(holds, [(0, k)] * len(turns), turns, camera, HAND)
        return max((m & mask).sum() / (m | mask).sum() for m in masks)

    others = [overlap(k) for k in range(len(holds.candidates)) if k not in (front, back)]
    assert overlap(back) > 0.8 and overlap(back) > max(others)
    result = nuno.estimate_hold(sock, mask, camera, HAND, holds=holds, hand_radius=0.0)
    assert {front, back} <= set(result.groups[0].tolist())
    assert result.distance(int(holds.candidates[back]), up_to_symmetry=True) <= result.distance(
        int(holds.candidates[back])
    )


def test_a_garment_is_found_by_its_background(holds):
    """What differs from the empty scene is the garment, to a pixel's rim; nothing that differs is refused."""
    camera = camera_at(0.0)
    mask = hold_masks(holds, [(0, 0)], [0.0], camera, HAND)[0]
    rng = np.random.default_rng(0)
    empty = (120 + rng.normal(0, 2, (*mask.shape, 3))).astype(np.uint8)
    image = np.where(mask[..., None], np.array((180, 60, 60), np.uint8), empty)
    found = hold_mask(image, empty, camera, HAND)
    assert (found & mask).sum() / (found | mask).sum() > 0.9
    result = nuno.estimate_hold(holds.garment, image, camera, HAND, backgrounds=empty, holds=holds)
    assert 0 in result.groups[0]
    with pytest.raises(ImageError, match="like its background"):
        hold_mask(empty, empty, camera, HAND)


@pytest.mark.parametrize("colour", [(180, 80, 50), (60, 60, 60)], ids=["red", "the floor's tint"])
def test_a_shadow_is_no_garment(holds, colour):
    """On the floor, where it touches the garment in the image; a grey garment on grey is not taken for a shadow."""
    camera = nuno.Camera.look_at((1.9, 0.3, 0.8), (0, 0, 0.55), fov=0.65)
    mask = hold_masks(holds, [(0, 0)], [0.0], camera, HAND)[0]
    empty = np.full((*mask.shape, 3), (200, 200, 200), np.uint8)
    rows, columns = np.nonzero(mask)
    low, middle = rows.max(), int(columns[rows == rows.max()].mean())
    shadow = np.zeros_like(mask)
    shadow[low - 10 : low + 10, middle : middle + 60] = True
    image = np.where(shadow[..., None], np.uint8(0.6 * empty), empty)
    image = np.where(mask[..., None], np.array(colour, np.uint8), image)
    found = hold_mask(image, empty, camera, HAND)
    assert (found & mask).sum() > 0.97 * mask.sum()
    if colour[0] != colour[1]:
        assert (found & ~mask).sum() < 0.03 * mask.sum()


def test_results_are_written(holds, tmp_path):
    """result.json has what the result has, and a picture lies beside it; a bad fit is told."""
    camera = camera_at(0.0)
    mask = hold_masks(holds, [(0, 1)], [0.0], camera, HAND)[0]
    result = nuno.estimate_hold(holds.garment, mask, camera, HAND, holds=holds)
    result.save(tmp_path)
    read = json.loads((tmp_path / "result.json").read_text())
    assert read == json.loads(json.dumps(result.to_dict())) and len(read["ranking"]) == len(holds.candidates)
    assert (tmp_path / "result.png").stat().st_size > 10_000
    assert repr(result).startswith("<HoldResult: sock held at")
    everywhere = np.ones_like(mask)
    odd = nuno.estimate_hold(holds.garment, everywhere, camera, HAND, holds=holds)
    assert any("overlaps" in warning for warning in odd.warnings)


def test_a_single_candidate_is_not_called_sure(holds):
    """It has no rival, so that its probability is 1 whatever is seen: a warning says so."""
    camera = camera_at(0.0)
    mask = hold_masks(holds, [(0, 1)], [0.0], camera, HAND)[0]
    result = nuno.estimate_hold(holds.garment, mask, camera, HAND, holds=holds)
    assert not any("only one candidate" in warning for warning in result.warnings)
    alone = replace(
        result, holds=replace(holds, candidates=holds.candidates[:1]), probabilities=np.ones(1), order=np.array([0])
    )
    assert "only one candidate" in alone.warnings[-1]


def test_bad_input_is_refused(holds, sock):
    """By name, before anything is imagined."""
    camera, mask = camera_at(0.0), np.ones((240, 320), bool)
    with pytest.raises(InvalidInputError, match="one for each of 2"):
        nuno.estimate_hold(sock, [mask], [camera, camera], HAND, holds=holds)
    with pytest.raises(InvalidInputError, match="backgrounds"):
        nuno.estimate_hold(sock, np.zeros((240, 320, 3), np.uint8), camera, HAND, holds=holds)
    with pytest.raises(InvalidInputError, match="very garment"):
        nuno.estimate_hold(nuno.garment("sock", cell=0.04), mask, camera, HAND, holds=holds)
    with pytest.raises(InvalidInputError, match="behind"):
        nuno.estimate_hold(sock, mask, camera, camera.camera_to_world[:3, 3] + (1.0, 0.0, 0.0), holds=holds)
    with pytest.raises(ImageError):
        nuno.estimate_hold(sock, np.zeros_like(mask), camera, HAND, holds=holds)
    for wrong in ({"candidates": [-1]}, {"candidates": [0.5]}, {"guesses": [1]}, {"guesses": []}, {"spacing": 0.0}):
        with pytest.raises(InvalidInputError):
            nuno.imagine_holds(sock, device="cpu", **wrong)
    with pytest.raises(InvalidInputError, match="for imagine_holds"):
        nuno.estimate_hold(sock, mask, camera, HAND, holds=holds, spacing=0.1)
