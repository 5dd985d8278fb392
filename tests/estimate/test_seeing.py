"""What the image after shows: the same at once and meanwhile, with what goes wrong."""

import numpy as np
import pytest

import nuno
from nuno.camera.camera import Camera
from nuno.camera.rectangle import ClothRectangle
from nuno.camera.table import Table
from nuno.estimate.doubt import share_of_doubt
from nuno.estimate.seeing import _doubts, _oddities, _outside, _uncovered, begin_to_see

POSE = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, -1.0, 0.0, 0.0], [0.0, 0.0, -1.0, 1.0], [0.0, 0.0, 0.0, 1.0]])
CAMERA = Camera(80, 60, 60.0, 60.0, 39.5, 29.5, POSE)
CORNERS = np.array([(-0.1, -0.1, 0.0), (0.1, -0.1, 0.0), (0.1, 0.1, 0.0), (-0.1, 0.1, 0.0)])


def seen(mask_after, meanwhile, hidden=None):
    """Return what a mask shows under a hand at the image's middle."""
    rectangle = ClothRectangle(CORNERS, 0.2, 0.2, CORNERS.mean(axis=0), 0.0, 0.0)
    return begin_to_see(
        None, None, None, mask_after, camera=CAMERA, table=Table(0.0), rectangle=rectangle,
        hand=np.array((0.0, 0.0, 0.2)), hand_radius=0.01, hidden=hidden, with_pattern=True, meanwhile=meanwhile,
    )  # fmt: skip


def square():
    """Return a mask (60, 80) with a square of cloth."""
    mask = np.zeros((60, 80), dtype=bool)
    mask[20:50, 20:60] = True
    return mask


@pytest.mark.parametrize("hidden", [None, "right half"])
def test_the_same_is_seen_at_once_and_meanwhile(hidden):
    """Silhouettes at half and quarter size, without the hand's and hidden pixels; no pattern without images."""
    covered = None
    if hidden:
        covered = np.zeros((60, 80), dtype=bool)
        covered[:, 40:] = True
    now, later = seen(square(), False, covered)(), seen(square(), True, covered)()
    assert (now.camera.width, now.coarse[0].width) == (40, 20) and now.pattern is later.pattern is None
    assert now.silhouette.ignore.any() and not (now.silhouette.mask & now.silhouette.ignore).any()
    assert now.silhouette.mask[:, 20:].any() == (hidden is None)
    for a, b in ((now.silhouette, later.silhouette), (now.coarse[1], later.coarse[1])):
        np.testing.assert_array_equal(a.mask, b.mask)
        np.testing.assert_array_equal(a.ignore, b.ignore)


def test_what_goes_wrong_meanwhile_is_raised_by_the_wait():
    """A mask of nothing but the hand's pixels is raised as it would be at once."""
    mask = np.zeros((60, 80), dtype=bool)
    mask[30, 40] = True
    wait = seen(mask, True)
    with pytest.raises(nuno.ImageError, match="empty"):
        wait()
    with pytest.raises(nuno.ImageError, match="empty"):
        seen(mask, False)


def test_a_cloth_that_is_not_at_the_hand_is_odd():
    """A silhouette far from what the hand hides gets a warning, one beside it none."""
    ignored, near, far = np.zeros((3, 60, 80), dtype=bool)
    ignored[10:16, 10:16] = True
    near[17:40, 10:30] = True
    far[40:55, 40:70] = True
    assert _oddities(near, ignored) == ()
    (warning,) = _oddities(far, ignored)
    # 25 px both ways between the hand's last pixel and the cloth's first; OpenCV's 5 x 5 distance is right to 2 %
    assert "away from the hand" in warning and 33 <= int(warning.split(" px")[0].split()[-1]) <= 36


def test_what_the_image_after_does_not_show_is_told():
    """A hand out of the image, by its pixel, and a cloth that goes on beyond the border, by its outline's share."""
    at_hand = np.zeros((60, 80), dtype=bool)
    at_hand[10:16, 10:16] = True
    nothing = np.zeros_like(at_hand)
    assert _outside(square(), at_hand, np.array((12.5, 12.5))) == ()
    (hand,) = _outside(square(), nothing, np.array((40.0, -70.0)))
    assert "pixel (40, -70) of 80 x 60" in hand and share_of_doubt(0.0, (hand,)) == pytest.approx(0.4)
    below = square()
    below[50:] = below[49]  # goes on to the border: 40 of its 2 (38 + 40) outline's pixels
    (cut,) = _outside(below, at_hand, np.array((12.5, 12.5)))
    assert cut.startswith("26% of the cloth's outline")
    assert len(_outside(below, nothing, np.array((40.0, -70.0)))) == 2
    assert _outside(nothing, at_hand, np.array((12.5, 12.5))) == ()


def test_a_mask_in_doubt_gets_a_warning():
    """A tenth of the cloth may be in doubt without a word; a mask that was given never is."""
    doubt = np.zeros((60, 80), dtype=bool)
    doubt[20:24, 20:50] = True  # 120 of 1,200 px
    assert _doubts(square(), None) == _doubts(square(), doubt) == ()
    doubt[24] = True
    (warning,) = _doubts(square(), doubt)
    assert "17%" in warning and "after_mask" in warning  # 200 px


def test_cloth_in_place_of_the_hand_gets_a_warning():
    """Where most of the middle of the hand's pixels was found to be cloth; beside them there may be any."""
    ignored, mask = np.zeros((2, 60, 80), dtype=bool)
    ignored[10:20, 10:20] = True
    mask[15:40, 10:30] = True
    assert _uncovered(mask, ignored) == ()  # half of them
    mask[13:15, 10:30] = True
    (warning,) = _uncovered(mask, ignored)  # of rows 11 to 18, which are the middle, 6 of 8
    assert warning.startswith("the image after shows cloth where the hand is told to be")
    rim = ignored.copy()
    rim[12:18, 12:18] = False
    assert _uncovered(rim, ignored) == ()
    assert _uncovered(mask, np.zeros_like(mask)) == ()  # the hand is out of the image


def test_where_the_cloth_begins_tells_whether_the_hand_is_higher_or_lower():
    """Seen from the side: cloth 10 px and more under the hand says lower, beside it nothing, at the hand nothing."""
    camera = Camera.look_at((-1.0, 0.0, 0.3), (0.0, 0.0, 0.3), fov=0.9, width=80, height=60)
    rectangle = ClothRectangle(CORNERS, 0.2, 0.2, CORNERS.mean(axis=0), 0.0, 0.0)

    def hand_is(rows, columns):
        mask = np.zeros((60, 80), dtype=bool)
        mask[rows, columns] = True
        return begin_to_see(
            None, None, None, mask, camera=camera, table=Table(0.0), rectangle=rectangle, hand=np.array((0, 0, 0.3)),
            hand_radius=0.01, hidden=None, with_pattern=False, meanwhile=False,
        )().hand_is  # fmt: skip

    at_hand, under, beside = slice(28, 58), slice(44, 58), slice(25, 35)
    assert hand_is(at_hand, slice(35, 45)) == 0
    assert hand_is(under, slice(35, 45)) == -1
    assert hand_is(beside, slice(55, 70)) == 0
