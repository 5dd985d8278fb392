"""A world of a batch is the world alone, to the bit, also where the batch's worlds differ from each other."""

import numpy as np
import pytest

import nuno
from random_worlds import RandomWorld, differences, state_of, wrenches_of
from varied_worlds import Variation, run

SHORT, LONG = (5, 6, 8, 10, 18, 19, 25, 29, 36, 41, 55, 58, 104, 106, 127, 1101, 1249, 1352, 1383), range(1000, 1400)
"""Seeds; the short ones are some in which a world differed: where lists of contacts and the ends of pushes were the
batch's, then where a step's length or their number was rounded, where a body was led in one world and stood in
others, where one was put elsewhere in some, where some were reset to before a body was led, and where a path is
under way in one alone; the last but one where a body stood on a path that led elsewhere in others."""
FEW = (29, 55, 58, 106)
"""Of those, some that take no second each and have all kinds of changes but leaving dynamics."""
LONGEST = (5, 19)
"""Of those, two that take more seconds than all others."""
WORLDS, COLOURS = 3, 4


def check_worlds(seed, device):
    """Make a world by random operations and its copies different, run them, and compare each with itself alone.

    Returns:
        Names of the changes that happened, and what differs.
    """
    world = RandomWorld(seed, device=device).happen(10).world
    variation, found = Variation(7000 + seed, world, WORLDS), []

    def compare(what, adopted=False):
        for k, single in enumerate(variation.singles):
            copy = (variation.batch, k)
            if adopted:
                world.adopt(variation.batch, k)
                copy = (world, None)
            # what grips bore is not told of a world that has another past
            for extract in (state_of,) if adopted else (state_of, wrenches_of):
                told = differences(extract(*copy), extract(single))
                if extract is wrenches_of and "reset" in variation.log:
                    # another grip may be there in one world alone; and of a leading body the two frames before a reset
                    # are the others', which may be 1 ns off: 1e-9 s * 1 m/s / (1/60 s)^2 of an acceleration
                    told = [each for each in told if each.startswith("grip") and float(each.split()[-2]) > 1e-5]
                found.extend(f"{what}, world {k}: {each}" for each in told)

    try:
        for number in range(COLOURS):
            variation.happen(3)
            compare(f"changed {number} times")
            variation.do(run)
            compare(f"run {number} times")
            if found:
                return variation.log, found
    except nuno.SimulationDiverged:
        return variation.log, found
    compare("adopted", adopted=True)
    return variation.log, found


def check(seeds, device):
    """Check many batches; tell of all that differ, by seed."""
    wrong, happened = [], set()
    for seed in seeds:
        try:
            log, found = check_worlds(seed, device)
        except Exception as error:
            raise AssertionError(f"seed {seed}: {type(error).__name__}: {error}") from error
        happened |= set(log)
        if found:
            wrong.append(f"seed {seed} after {', '.join(log)}:\n    " + "\n    ".join(found[:8]))
    assert not wrong, f"{len(wrong)} of {len(seeds)} batches\n" + "\n".join(wrong[:5])
    return happened


def test_a_few_worlds_of_a_batch_that_differ():
    """Of the same, so many as take seconds."""
    assert "run" in check(FEW, "cpu")


@pytest.mark.long
def test_worlds_of_a_batch_that_differ():
    """Other places, velocities, pushes, paths, grips and friction in each world: each is what it is alone."""
    happened = check([seed for seed in SHORT if seed not in FEW + LONGEST], "cpu")
    assert happened >= {"place", "velocity", "push", "path", "hold", "friction", "attach", "detach", "reset", "run"}


def test_parts_of_frames_have_as_many_substeps_by_itself_as_with_others():
    """A ball falls the same near a box that is held, which it does not touch, and far from it.

    Of ten substeps a frame 0.01 s has six, also where the last digit of 0.07 s - 0.06 s says a little more.
    """

    def fallen(x):
        world = nuno.World(device="cpu", substeps=10)
        ball = world.attach(world.add(nuno.sphere(0.05, position=(0.0, 0.0, 1.0))))
        box = world.attach(world.add(nuno.box((0.05, 0.05, 0.05), position=(x, 0.0, 0.95))))
        world.grip(box, to=box.position)
        for _ in range(10):
            world.run(0.01)
        return ball.position.tolist()

    assert fallen(0.12) == fallen(2.0)


def test_a_push_that_is_nothing_in_one_world_ends_its_frame_too():
    """A frame is cut where a push ends in any world: one that is pushed by nothing alone goes in the same steps."""

    def pushed(world, force):
        ball = world.attach(world.add(nuno.sphere(0.05, position=(0.0, 0.0, 1.0))))
        batch = world.imagine(len(force)) if len(force) > 1 else world
        batch.push(ball, force if len(force) > 1 else force[0], duration=0.04)
        batch.run(0.1)
        return batch.find(ball.name).position

    both = pushed(nuno.World(device="cpu"), [(1.0, 0.0, 0.0), (0.0, 0.0, 0.0)])
    assert both[1].tolist() == pushed(nuno.World(device="cpu"), [(0.0, 0.0, 0.0)]).tolist()


def test_what_is_thrown_farther_than_expected_meets_what_it_would_alone():
    """A cloth that a grip tears down 0.4 m within a frame, beside a world whose cloth lies where it comes to.

    Worlds of a batch share a list of the shapes nearby. What moves farther than the list looks met the floor in the
    batch, which it had not met alone.
    """

    def torn(heights):
        world = nuno.World(device="cpu", substeps=6)
        world.add(nuno.plane())
        sheet = world.add(nuno.sheet((0.2, 0.2), cells=(3, 3), position=(0.0, 0.0, 0.3)))
        world.attach(sheet)
        batch = world.imagine(len(heights), thorough=False) if len(heights) > 1 else world
        batch._quiet = True
        cloth, height = batch.find(sheet.name), np.array(heights)
        cloth.locate(np.stack([0.0 * height, 0.0 * height, height], axis=1) if len(heights) > 1 else (0, 0, heights[0]))
        first = np.atleast_3d(cloth.vertices).reshape(len(heights), -1, 3)[:, 0]
        down = np.stack([first, first - (0.0, 0.0, 0.4)], axis=1)
        batch.grip(cloth, [0], to=nuno.Path((0.0, 1.0 / 60.0), down if len(heights) > 1 else down[0]))
        batch.run(0.05)
        return cloth.vertices

    both, alone = torn((0.3, 0.01)), torn((0.3,))
    np.testing.assert_array_equal(both[0], alone)


@pytest.mark.parametrize(("height", "other"), [(0.2, 0.028), (0.3, 0.04)])
def test_edges_thrown_farther_than_expected_meet_what_they_would_alone(height, other):
    """A sheet that grips tear down 1.5 m in two frames past a post, beside a world whose sheet lies on the post.

    Worlds of a batch share the lists of sharp shapes and of edges near them, and when those are looked at. What moves
    farther than the lists look met the post's rim in the batch, which it had not met alone: by 8 and 81 mm.
    """

    def torn(*heights):
        world = nuno.World(device="cpu", substeps=6)
        world.add(nuno.cylinder(0.02, 0.05, position=(0.02, 0.013, 0.0)))
        sheet = world.add(nuno.sheet((0.3, 0.3), cells=(4, 4), position=(0.0, 0.0, height)))
        world.attach(sheet)
        batch = world.imagine(len(heights), thorough=False) if len(heights) > 1 else world
        batch._quiet = True
        cloth = batch.find(sheet.name)
        cloth.locate(np.array([(0.0, 0.0, h) for h in heights]) if len(heights) > 1 else (0.0, 0.0, height))
        points = np.atleast_3d(cloth.vertices).reshape(len(heights), -1, 3)
        for corner in (0, 4, 20, 24):
            start = points[:, corner]
            down = np.stack([start, start - (0.0, 0.0, 1.5)], axis=1)
            batch.grip(cloth, [corner], to=nuno.Path((0.0, 2.0 / 60.0), down if len(heights) > 1 else down[0]))
        batch.run(0.05)
        return cloth.vertices

    np.testing.assert_array_equal(torn(height, other)[0], torn(height))


@pytest.mark.parametrize(("height", "way"), [(0.028, (0.8, 0.0, -0.5)), (0.035, (0.6, 0.0, -0.2))])
def test_edges_thrown_past_a_post_near_others_meet_what_they_would_alone(height, way):
    """A sheet between two posts that grips tear past one, beside a world whose sheet has its other edges near that one.

    Each edge looks only at the posts that it may touch: those at one end of the sheet at one post, in the world alone.
    Where they looked at what they may touch in any world of a batch, they met the other post there: by 91 and 102 mm.
    """

    def torn(*starts):
        world = nuno.World(device="cpu", substeps=6)
        for x in (-0.12, 0.12):
            world.add(nuno.cylinder(0.02, 0.05, position=(x, 0.013, 0.0)))
        sheet = world.add(nuno.sheet((0.3, 0.3), cells=(4, 4), position=(0.0, 0.0, height)))
        world.attach(sheet)
        batch = world.imagine(len(starts), thorough=False) if len(starts) > 1 else world
        batch._quiet = True
        cloth = batch.find(sheet.name)
        if len(starts) > 1:
            cloth.locate(np.array([(x, 0.0, height) for x in starts]))
        points = np.atleast_3d(cloth.vertices).reshape(len(starts), -1, 3)
        for corner in (0, 4, 20, 24):
            start = points[:, corner]
            there = np.stack([start, start + way], axis=1)
            batch.grip(cloth, [corner], to=nuno.Path((0.0, 2.0 / 60.0), there if len(starts) > 1 else there[0]))
        batch.run(0.05)
        return cloth.vertices

    np.testing.assert_array_equal(torn(0.0, 0.2)[0], torn(0.0))


@pytest.mark.parametrize("kind", ["box", "plane"])
def test_what_stands_on_a_path_is_touched_as_what_has_none(kind):
    """A sheet on a tilted tray that is put somewhere, beside a world in which the tray moves.

    The place of what moves is summed up from three numbers and its turn divided by its length, in float32: the last
    digits of the tray's pose were others.
    """

    def lain(*speeds):
        world = nuno.World(device="cpu", substeps=6)
        at, turn = np.array([0.123, 0.234, 0.345]), (0.99, 0.05, 0.03, 0.02)
        pose = {"name": "tray", "position": at, "quaternion": turn}
        tray = world.add(nuno.box((0.4, 0.4, 0.03), **pose) if kind == "box" else nuno.plane(**pose))
        sheet = world.add(nuno.sheet((0.2, 0.2), cells=(3, 3), name="sheet", position=at + np.array([0, 0, 0.05])))
        world.attach(sheet)
        batch = world.imagine(len(speeds)) if len(speeds) > 1 else world
        if any(speeds):
            ways = np.stack([np.array([at, at + np.array([0.1 * speed, 0, 0])]) for speed in speeds])
            batch.move("tray", nuno.Path([0.0, 0.1], ways, np.broadcast_to(tray.quaternion, (len(speeds), 2, 4))))
        batch.run(0.15)
        return batch.find("sheet").vertices

    np.testing.assert_array_equal(lain(0.3, 0.0)[1], lain(0.0))


@pytest.mark.slow
def test_more_worlds_of_a_batch_that_differ():
    """The same for those that take longest."""
    check(LONGEST, "cpu")


@pytest.mark.slow
@pytest.mark.parametrize("start", range(LONG[0], LONG[-1], 50))
def test_many_worlds_of_batches_that_differ(start):
    """The same for hundreds of batches."""
    check(range(start, start + 50), "cpu")


@pytest.mark.cuda
@pytest.mark.parametrize("start", range(0, 40, 4))
def test_worlds_of_a_batch_that_differ_on_cuda(start):
    """The same on CUDA."""
    check(range(start, start + 4), "cuda:0")


@pytest.mark.cuda
@pytest.mark.slow
@pytest.mark.parametrize("start", range(LONG[0], LONG[-1], 50))
def test_many_worlds_of_batches_that_differ_on_cuda(start):
    """The same for hundreds of batches on CUDA."""
    check(range(start, start + 50), "cuda:0")
