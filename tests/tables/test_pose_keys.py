"""Key poses of bodies on paths of their own and on path batches, which a kernel writes: where NumPy puts them."""

import numpy as np
import pytest

import nuno
from nuno.contact.particle.kinematic_pose import FRAME_SIZE, FRAMES, KEY_SIZE, ROW, STANDING
from nuno.contact.particle.shape_contact import COLUMNS
from nuno.shapes import quaternion as quat
from nuno.shapes.path import path_as_it_is
from nuno.shapes.shape import Hull
from nuno.tables.colliders import Colliders
from nuno.tables.kinematic_motion import make_schedule
from nuno.tables.path_batch import KinematicGroup, PathBatch

FRAME = 1 / 60


def lead(group, bodies, times, places, turns):
    """Set bodies on one path batch."""
    group.path_batch = PathBatch(group.keys, times, places, turns)
    for body, path in zip(bodies, group.paths, strict=True):
        body._path = path


def sent(worlds, frames, apart):
    """Return the table and the worlds' greatest speeds for boxes and a hull sent on ways of so many frames.

    Then the same by NumPy: positions and quaternions (worlds, bodies, frames, 3, ...) and speeds.
    """
    random = np.random.default_rng(4)
    wedge = [(0, 0, 0), (0.3, 0, 0), (0, 0.1, 0), (0, 0, 0.1)]  # its box's middle is not its origin, their mean
    hull = nuno.Body(Hull(wedge, [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]), name="hull")
    bodies = [*[nuno.box((0.1, 0.2, 0.1), name=str(k)) for k in range(3)], hull]
    shape = (len(bodies), worlds, frames + 1) if worlds > 1 else (len(bodies), frames + 1)
    places = np.cumsum(random.normal(0.0, 0.01, (*shape, 3)), axis=-2)
    turns = np.array([1.0, 0.0, 0.0, 0.0]) + np.cumsum(random.normal(0.0, 0.3, (*shape, 4)), axis=-2)
    turns /= np.linalg.norm(turns, axis=-1, keepdims=True)
    times = 0.1 + FRAME * np.arange(frames + 1)
    for body, place, turned in zip(bodies, places, turns, strict=True):
        if worlds > 1:
            body._position, body._quaternion = place[:, 0], turned[:, 0]
        body._path = nuno.Path(times, place, turned)
    if not apart:
        group = KinematicGroup(tuple(body.key for body in bodies))
        lead(group, bodies, times, places, turns)
    colliders = Colliders.from_bodies(bodies, worlds)
    schedule = make_schedule(bodies, 0.1, frames * FRAME, FRAME)
    assert len(schedule.path_batches) == 1 - apart
    colliders.follow(schedule)
    table = colliders.shapes.pose.numpy().reshape(-1, len(bodies), FRAMES, FRAME_SIZE)[:, :, : frames + 1]
    middle = np.array([0.15, 0.05, 0.05]) - np.mean(wedge, axis=0)
    radii = np.array([*3 * [np.linalg.norm([0.05, 0.1, 0.05])], np.linalg.norm([0.15, 0.05, 0.05])])
    where = [schedule.poses[body.key] for body in bodies]
    turn = np.stack([np.broadcast_to(t, (worlds, *t.shape[-2:])) for _, t in where], axis=1)
    place = np.stack([np.broadcast_to(p, (worlds, *p.shape[-2:])) for p, _ in where], axis=1)
    place = place + quat.rotate(turn, np.array([0 * middle, 0 * middle, 0 * middle, middle])[:, None])
    way = np.linalg.norm(np.diff(place, axis=2), axis=-1)
    angle = 2.0 * np.arccos(np.minimum(np.abs((turn[:, :, 1:] * turn[:, :, :-1]).sum(axis=-1)), 1.0))
    speed = ((way + angle * radii[:, None]) / np.diff(schedule.times)).max(axis=(1, 2))
    keys = np.minimum(2 * np.arange(frames + 1)[:, None] + np.arange(3), 2 * frames)
    fastest = colliders.shapes.shape_speed.numpy().astype(float)
    turn = np.where(turn[..., :1] < 0.0, -turn, turn)
    return table, fastest, (place[:, :, keys], turn[:, :, keys], speed)


def poses_in(table):
    """Return positions (..., frames, 3, 3) and quaternions of the table's keys, w above zero."""
    keys = table[..., 3:STANDING].reshape(*table.shape[:-1], 3, KEY_SIZE).astype(float)
    turns = keys[..., 3:] * np.where(keys[..., 3:4] < 0.0, -1.0, 1.0)
    return table[..., None, :3] + keys[..., :3], turns


@pytest.mark.parametrize("apart", [False, True])
@pytest.mark.parametrize(("worlds", "frames"), [(1, 1), (1, 4), (3, 1), (3, 4)])
def test_keys_are_where_the_paths_are(worlds, frames, apart):
    """The kernel's keys are NumPy's, but for float's rounding (1e-6) and 1e-8 of a way for rounded times."""
    table, fastest, (place, turn, speed) = sent(worlds, frames, apart)
    found, turned = poses_in(table)
    np.testing.assert_allclose(found, place, rtol=0, atol=2e-6)
    np.testing.assert_allclose(turned, turn, rtol=0, atol=2e-6)
    # a bound, of turns that are near to each other up to 1 % above
    assert len(fastest) == worlds
    assert (fastest > 0.999 * speed).all() and (fastest < 1.02 * speed).all()


@pytest.mark.parametrize("apart", [False, True])
def test_what_stands_throughout_a_frame_is_where_the_table_of_shapes_has_it(apart):
    """The same bits, in the world and the frames in which it stands, also at the end; a world that stands has no speed.

    Of the paths' keys the last three are one, and in one world of three all are. The frame after the first of them may
    begin a rounding before it.
    """
    wedge = [(0, 0, 0), (0.3, 0, 0), (0, 0.1, 0), (0, 0, 0.1)]
    hull = nuno.Body(Hull(wedge, [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]), name="hull")
    bodies = [nuno.box((0.1, 0.2, 0.1), name="box"), hull]
    random = np.random.default_rng(6)
    places, turns = random.normal(0.0, 0.1, (2, 3, 5, 3)), random.normal(size=(2, 3, 5, 4))
    places[:, :, 3:], turns[:, :, 3:] = places[:, :, 2:3], turns[:, :, 2:3]
    places[:, 1], turns[:, 1] = places[:, 1, :1], turns[:, 1, :1]
    turns[0, 1] = 0.6, 0.7, 0.6, 0.7  # two of its products cancel out
    turns /= np.linalg.norm(turns, axis=-1, keepdims=True)
    times = 0.1 + FRAME * np.arange(5)
    for body, place, turn in zip(bodies, places, turns, strict=True):
        body._position, body._quaternion = place[:, -1], turn[:, -1]
        body._path = path_as_it_is(times, place, turn)
    if not apart:
        lead(KinematicGroup(tuple(body.key for body in bodies)), bodies, times, places, turns)
    colliders = Colliders.from_bodies(bodies, 3)
    colliders.follow(make_schedule(bodies, 0.1, 4 * FRAME, FRAME))
    table = colliders.shapes.pose.numpy().reshape(3, 2, FRAMES, FRAME_SIZE)[:, :, :5]
    expected = np.zeros((3, 2, 5), dtype=bool)
    expected[:, :, 3:] = expected[1] = True
    np.testing.assert_array_equal(np.delete(table[..., STANDING] == 1.0, 2, axis=2), np.delete(expected, 2, axis=2))
    rows = colliders.shapes.table.numpy().reshape(3, 2, COLUMNS)[:, :, None, :12]
    found = table[..., ROW : ROW + 12]
    np.testing.assert_array_equal(found[expected], np.broadcast_to(rows, found.shape)[expected])
    speeds = colliders.shapes.shape_speed.numpy()
    assert speeds[1] == 0.0 and speeds[0] > 0.0 and speeds[2] > 0.0


def test_frames_of_a_run_are_those_of_runs_of_one_frame():
    """The same bits, however many frames a run has: what a robot in a batch and one alone are told of its links."""
    bodies = [nuno.box((0.1, 0.2, 0.1), name=str(k)) for k in range(3)]
    random, group = np.random.default_rng(5), KinematicGroup(tuple(body.key for body in bodies))
    places, turns = random.normal(0.0, 0.1, (3, 5, 3)), random.normal(size=(3, 5, 4))
    turns /= np.linalg.norm(turns, axis=-1, keepdims=True)
    times = 0.3 + np.arange(5) / 60  # as a world counts them, not in whole nanoseconds
    tables = []
    for frames in (4, 1):
        rows = []
        for k in range(0, 4, frames):
            own = slice(k, k + frames + 1)
            lead(group, bodies, times[own], places[:, own], turns[:, own])
            colliders = Colliders.from_bodies(bodies)
            colliders.follow(make_schedule(bodies, times[k], times[k + frames] - times[k], FRAME))
            table = colliders.shapes.pose.numpy().reshape(3, FRAMES, FRAME_SIZE)
            rows.append(table[:, :frames].copy())
        tables.append(np.concatenate(rows, axis=1))
    positions, quaternions = zip(*(poses_in(table) for table in tables), strict=True)
    np.testing.assert_array_equal(*positions)
    np.testing.assert_array_equal(*quaternions)
