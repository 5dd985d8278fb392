"""Trials of carrying: eq. (2) and (3), when a mat has fallen, and what bears it."""

from dataclasses import replace

import numpy as np
import pytest

import nuno
from nuno.tasks.carry_mat import FOAM
from nuno.tasks.carry_plan import key_times, make_plan, motion_along, track_arms
from nuno.tasks.carry_trials import EVERY, FALLEN, FRAME_RATE, carry, judge, make_room

SETTLE, SECONDS = 0.5, 2.0
DISTANCES = np.array([0.3, 0.4])


@pytest.fixture(scope="module")
def plan(talos, glides):
    """Return the plan of two robots that glide ahead by 0.1 m."""
    times = key_times(SETTLE, SECONDS)
    motions = [motion_along(walk, times) for walk in glides(DISTANCES, 1.0, (0.1, 0.0, 0.0))]
    mat = nuno.soft_box((0.6, 0.4, 0.02), cells=(9, 6, 3))
    tracks = track_arms(talos, motions, DISTANCES, arms="hulls", settle=SETTLE, seconds=SECONDS)
    return make_plan(tracks, mat, FOAM, hold="support", arm_friction=0.5)


def seen(plan, offset):
    """Return the mean of a mat (frames, 1, 3) whose place on the robot is ``offset`` (frames, 3), and its gaps."""
    middle = (plan.base[0, ::2] + offset)[:, None]
    return middle, np.zeros((plan.frames // EVERY + 1, 1, 2))


def test_the_value_is_the_integral_of_the_distance(plan):
    """Eq. (2) and (3): a mat that drifts by v t from its place, while the robot moves, has F = v T^2 / 2."""
    times = key_times(SETTLE, SECONDS)[::2]
    drift = np.where(times > 0.0, times, 0.0)[:, None] * np.array([0.0, 0.006, 0.008])  # 0.01 m/s
    outcome = judge(plan, np.array([0]), *seen(plan, drift + np.array([0.4, 0.0, 0.1])))
    assert outcome.value[0] == pytest.approx(0.5 * 0.01 * SECONDS**2, rel=1e-9)  # trapezia are exact on a line
    assert outcome.reason == ("",)


def test_a_mat_that_sinks_has_fallen(plan):
    """The threshold is on the height that is lost, and the time is when it is passed."""
    times = key_times(SETTLE, SECONDS)[::2]
    fall = np.where(times > 0.5, -(times - 0.5) * 2.0 * FALLEN, 0.0)[:, None] * np.array([0.0, 0.0, 1.0])
    outcome = judge(plan, np.array([0]), *seen(plan, fall))
    assert outcome.failed_at[0] == pytest.approx(1.0, abs=1.5 / FRAME_RATE)
    assert np.isnan(outcome.value[0]) and "fell by more than" in outcome.reason[0]


@pytest.mark.parametrize(("side", "name"), [(0, "the left arm"), (1, "the right arm"), (None, "both arms")])
def test_an_arm_without_the_mat_is_a_failure(plan, side, name):
    """A gap that lasts counts from when it opened, a short one not at all."""
    middle, gaps = seen(plan, np.zeros((plan.frames + 1, 3)))
    chosen = slice(None) if side is None else side
    gaps[8:10, 0, chosen] = 0.1
    assert judge(plan, np.array([0]), middle, gaps).reason == ("",)
    gaps[12:, 0, chosen] = 0.1
    outcome = judge(plan, np.array([0]), middle, gaps)
    assert outcome.reason == (f"lost contact with {name}",)
    assert outcome.failed_at[0] == pytest.approx(12 * EVERY / FRAME_RATE - SETTLE)


@pytest.mark.long
def test_a_trial_is_what_it_is_alone(plan):
    """Promise of the design: world k of a batch gives, bit for bit, what it gives alone; each has its own paths."""
    walks, offsets = np.array([0, 1, 0]), np.array([[0.1, 0.0], [0.12, 0.05], [0.05, -0.05]])

    def end_of(chosen):
        last = []
        futures = make_room(plan, "cpu").imagine(len(chosen))
        carry(futures, plan, walks[chosen], offsets[chosen], lambda mat, _: last.append(mat.vertices))
        return last[-1].reshape(len(chosen), -1, 3)

    together = end_of([0, 1, 2])
    for k in range(3):
        np.testing.assert_array_equal(end_of([k])[0], together[k])


@pytest.mark.long
def test_trials_that_failed_are_dropped_and_the_others_go_on_to_the_bit(plan):
    """Hands behind the mats' middles lose four of six in the first half second: what comes of all is the same."""
    walks = np.array([0, 1, 0, 1, 0, 1])
    offsets = np.array([[-0.15, 0.0], [0.12, 0.0], [-0.15, 0.1], [-0.15, 0.1], [0.1, 0.0], [-0.2, 0.0]])
    found = []
    for drops in (False, True):
        found.append(carry(make_room(plan, "cpu").imagine(6), plan, walks, offsets, drops=drops))
    whole, dropped = found
    assert whole.reason == dropped.reason and sum(reason != "" for reason in whole.reason) == 4
    for name in ("value", "failed_at"):
        np.testing.assert_array_equal(getattr(dropped, name), getattr(whole, name))
    left = np.flatnonzero(np.isnan(dropped.middle[-1, :, 0]))
    assert len(left) == 4 and not np.isnan(whole.failed_at[left]).any()
    seen = ~np.isnan(dropped.middle)
    np.testing.assert_array_equal(dropped.middle[seen], whole.middle[seen])


@pytest.mark.long
def test_the_arms_bear_the_weight(plan):
    """Statics: at rest what the arms do to the mat is its weight, within 1 % (as in the tests of contact forces)."""
    futures = make_room(plan, "cpu").imagine(2)
    carry(futures, plan, np.array([0, 1]), np.array([[0.1, 0.0], [0.12, 0.0]]))
    futures.set_material("mat", replace(FOAM, air_drag=6.0))  # so that it comes to rest, as the arms have
    futures.run(1.5)
    contacts = futures.contacts("mat")
    weight = 60.0 * 0.6 * 0.4 * 0.02 * 9.81
    for world in range(2):
        own = contacts.worlds == world
        names = {contacts.others[k] for k in np.flatnonzero(own)}
        assert names and all(name.startswith("arm") for name in names)
        assert contacts.forces[own, 2].sum() == pytest.approx(weight, rel=0.01)


def test_boxes_contain_the_links(talos):
    """A link's box is around its hull, and a hand is one shape."""
    from nuno.shapes import quaternion as quat
    from nuno.tasks.arms import ERROR, arm_shapes

    boxes, hulls = arm_shapes(talos, "boxes"), arm_shapes(talos, "hulls")
    assert [shape.part.link for shape in boxes] == [shape.part.link for shape in hulls]
    assert [shape.part.link for shape in boxes].count("left_hand") == 1
    for box, hull in zip(boxes, hulls, strict=True):
        vertices = hull.part.position + quat.rotate(hull.part.quaternion, hull.part.shape.mesh()[0])
        inside = quat.rotate(box.part.quaternion * [1, -1, -1, -1], vertices - box.part.position)
        # hulls are simpler than the links' own, and up to ERROR from them
        assert (np.abs(inside) <= 0.5 * np.array(box.part.shape.size) + ERROR).all()
