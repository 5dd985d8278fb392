"""Batches of paths: paths that are worked out together give what each gives alone, to the bit."""

import numpy as np

import nuno
from nuno.tables.kinematic_motion import arrive, make_schedule, path_batches_of
from nuno.tables.path_batch import KinematicGroup, PathBatch


def path_batch_of(bodies, seed=0):
    """Return a path batch of bodies with two keys, and set them on it."""
    random = np.random.default_rng(seed)
    turns = random.normal(size=(len(bodies), 2, 4))
    turns /= np.linalg.norm(turns, axis=-1, keepdims=True)
    places = random.normal(size=(len(bodies), 2, 3))
    made = PathBatch(tuple(body.key for body in bodies), np.array([0.0, 0.1]), places, turns)
    for body, path in zip(bodies, made.paths, strict=True):
        body._path = path
    return made


def test_a_schedule_is_that_of_the_paths_alone():
    """Positions and turns of all times, and where the bodies arrive; a body between breaks none of it."""
    bodies = [nuno.box((0.1, 0.1, 0.1), name=str(k)) for k in range(7)]
    path_batch_of(bodies)
    other = nuno.box((0.1, 0.1, 0.1), name="other")
    other._path = nuno.Path([0.0, 0.2], [[0, 0, 0], [1, 0, 0]])
    together = make_schedule([other, *bodies], 0.03, 0.09, 1 / 60)
    assert len(together.path_batches) == 1 and set(together.alone) == {other.key}
    arrive([other, *bodies], 0.05)
    placed = [(body._position.copy(), body._quaternion.copy()) for body in bodies]
    for body in bodies:
        own = body._path
        body._path = nuno.Path(own.times, own.positions, own.quaternions)
    apart = make_schedule([other, *bodies], 0.03, 0.09, 1 / 60)
    assert not apart.path_batches
    for body in (other, *bodies):
        for a, b in zip(together.poses[body.key], apart.poses[body.key], strict=True):
            np.testing.assert_allclose(a, b, rtol=0, atol=1e-15)  # Path scales quaternions to unit length once more
    arrive([other, *bodies], 0.05)
    for body, (position, quaternion) in zip(bodies, placed, strict=True):
        np.testing.assert_array_equal(body._position, position)
        np.testing.assert_allclose(body._quaternion, quaternion, rtol=0, atol=1e-15)


def test_a_path_batch_with_one_gone_is_taken_apart():
    """Where a body follows another path, or is not there, the others are worked out one by one."""
    bodies = [nuno.box((0.1, 0.1, 0.1), name=str(k)) for k in range(4)]
    path_batch_of(bodies)
    whole, others = path_batches_of(bodies)
    assert len(whole) == 1 and not others
    assert path_batches_of(bodies[:3]) == ([], bodies[:3])
    swapped = [bodies[1], bodies[0], *bodies[2:]]
    assert path_batches_of(swapped) == ([], swapped)
    bodies[2]._path = nuno.Path([0.0], [[0, 0, 0]])
    assert path_batches_of(bodies) == ([], bodies)


def test_a_company_goes_where_its_last_path_batch_goes():
    """Paths for good lead the bodies as those of each path batch would, to the bit; what was kept of them stays."""
    world = nuno.World(device="cpu")
    bodies = [world.add(nuno.box((0.1, 0.1, 0.1), name=str(k))) for k in range(5)]
    kinematic_group = KinematicGroup(tuple(body.key for body in bodies))
    kept = []
    for seed in range(2):
        kinematic_group.path_batch = path_batch_of(bodies, seed)
        expected = make_schedule(bodies, 0.03, 0.09, 1 / 60)
        for body, path in zip(bodies, kinematic_group.paths, strict=True):
            body._path = path
        found = make_schedule(bodies, 0.03, 0.09, 1 / 60)
        assert len(found.path_batches) == 1
        for key, pose in expected.poses.items():
            for a, b in zip(found.poses[key], pose, strict=True):
                np.testing.assert_array_equal(a, b)
        kept.append((kinematic_group.path_batch, [path.as_it_is() for path in kinematic_group.paths]))
    for path_batch, paths in kept:
        np.testing.assert_array_equal([path.positions for path in paths], path_batch.positions)
    # a snapshot keeps where they went when it was taken
    saved = world.save()
    kinematic_group.path_batch = path_batch_of(bodies, 7)
    for body, path in zip(bodies, kinematic_group.paths, strict=True):
        body._path = path
    world.restore(saved)
    assert [body._path for body in bodies] == kept[1][1]
    assert path_batches_of(bodies)[0][0][0] is kept[1][0]


def test_worlds_apart_go_where_each_would_alone():
    """A group whose paths differ by world: schedule and arrival are each world's own, to the bit."""
    bodies = [nuno.box((0.1, 0.1, 0.1), name=str(k)) for k in range(4)]
    random, times = np.random.default_rng(3), np.array([0.0, 0.1])
    turns = random.normal(size=(4, 3, 2, 4))
    turns /= np.linalg.norm(turns, axis=-1, keepdims=True)
    places = random.normal(size=(4, 3, 2, 3))
    group = KinematicGroup(tuple(body.key for body in bodies))
    found = []
    for world in (slice(None), 0, 1, 2):
        group.path_batch = PathBatch(group.keys, times, places[:, world].copy(), turns[:, world].copy())
        for body, path in zip(bodies, group.paths, strict=True):
            body._path = path
        poses = make_schedule(bodies, 0.03, 0.09, 1 / 60).poses
        arrive(bodies, 0.05)
        found.append(([poses[body.key] for body in bodies], group.arrived(bodies, 0.05, places[:, world].shape[1:-2])))
    for k in range(3):
        for together, alone in zip(found[0][0], found[k + 1][0], strict=True):
            for a, b in zip(together, alone, strict=True):
                np.testing.assert_array_equal(a[k], b)
        for a, b in zip(found[0][1], found[k + 1][1], strict=True):
            np.testing.assert_array_equal(a[:, k], b)
