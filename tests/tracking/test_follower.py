"""Following a cloth: what does not change, what is caught up with, and what is refused."""

import logging

import numpy as np
import pytest

import nuno

CAMERA = nuno.Camera.look_at((0.0, -0.3, 1.2), (0.0, 0.0, 0.2), 0.7, width=120, height=90)


def room(height=0.002, *, gravity=(0.0, 0.0, -9.81), cells=(8, 6), table=True):
    """Return a world with a towel, and the towel."""
    world = nuno.World(device="cpu", gravity=gravity)
    if table:
        world.add(nuno.box((1.0, 1.0, 0.02), name="table", position=(0, 0, -0.01)))
    towel = world.add(nuno.sheet((0.4, 0.3), cells, name="towel", position=(0, 0, height)))
    world.attach(towel)
    return world, towel


def look(world, towel, camera=CAMERA):
    """Return mask and depth of what a camera sees."""
    return world.masks(camera, towel).numpy(), world.depth(camera).numpy()


def lifted(world, towel, seconds=1.0):
    """Let a hand take the towel's first corner up."""
    start = towel.vertices[0]
    return world.grip(
        towel, [0], to=nuno.Path([world.time, world.time + seconds], [start, start + np.array([0.1, 0.05, 0.15])])
    )


def test_a_still_cloth_that_is_seen_as_it_is_stays_still():
    """A cloth at rest whose image is its own is drawn by no force but what the depth's steps of 10 um make."""
    world, towel = room()
    alone, same = room()
    world.run(0.2), alone.run(0.2)
    seen = look(world, towel)
    follower = nuno.follow(world, towel, CAMERA, pixels=100_000)
    for k in range(1, 4):
        told = follower.update(0.2 + 0.1 * k, *seen)
        alone.run(0.1)
        assert told.used and told.agreement == 1.0
        assert told.error < 1e-5  # [m], the step of depths that are drawn
    assert np.abs(told.forces).max() < 1e-6 * towel.mass * 9.81 / len(towel.vertices) + 1e-5
    assert np.abs(towel.vertices - same.vertices).max() < 1e-5


@pytest.mark.parametrize("what", ["dropped", "hidden", "empty"])
def test_what_shows_nothing_leaves_the_cloth_to_physics(what, caplog):
    """Dropped images, images in which all is hidden, and empty ones leave physics' bits; the last is told once."""
    world, towel = room()
    alone, same = room()
    lifted(world, towel), lifted(alone, same)
    follower = nuno.follow(world, towel, CAMERA)
    nothing, all_ = np.zeros((90, 120), bool), np.ones((90, 120), bool)
    with caplog.at_level(logging.WARNING, "nuno"):
        for k in range(1, 6):
            parts = {"dropped": (None,), "hidden": (all_, None, all_), "empty": (nothing,)}[what]
            told = follower.update(0.1 * k, *parts)
            assert not told.used and told.reason == what and not told.forces.any()
    alone.run(0.5)
    np.testing.assert_array_equal(towel.vertices, same.vertices)
    np.testing.assert_array_equal(towel.velocities, same.velocities)
    assert world.time == pytest.approx(0.5)
    said = [r for r in caplog.records if "said once" in r.getMessage()]
    assert len(said) == (1 if what == "empty" else 0)


def test_what_drew_the_cloth_ends_where_nothing_is_seen():
    """Hidden from one image on, the cloth moves from then on by physics' bits, whatever drew it before."""
    world, towel = room()
    shown, there = room()
    shown.set_vertices(there, there.vertices + np.array([0.02, 0.0, 0.0]))
    mask, depth = look(shown, there)
    follower = nuno.follow(world, towel, CAMERA)
    for k in range(1, 4):  # friction holds it, so that a steady force builds up
        assert follower.update(0.1 * k, mask, depth).forces.any()
    alone = world.imagine(1)
    alone.run(0.1)
    hidden = np.ones_like(mask)
    assert not follower.update(0.4, mask, depth, hidden).forces.any()
    np.testing.assert_array_equal(towel.vertices, alone.find("towel").vertices)


def test_a_cloth_elsewhere_is_caught_up_with_across_its_plane():
    """Without weight, a sheet 3 cm nearer to the camera is met within 3 mm in ten images of a tenth of a second."""
    world, towel = room(0.2, gravity=(0, 0, 0), table=False)
    shown, there = room(0.23, gravity=(0, 0, 0), table=False)
    follower = nuno.follow(world, towel, CAMERA)
    for k in range(1, 11):
        told = follower.update(0.1 * k, *look(shown, there))
    # a residual falls to 1/e in 0.08 s: after a second only what it overshoots and the depth's noise, 0, are left
    assert np.abs(towel.vertices - there.vertices)[:, 2].max() < 0.003
    assert told.error < 0.003


@pytest.mark.parametrize("with_depth", [True, False])
def test_a_cloth_aside_is_caught_up_with_along_its_plane(with_depth):
    """By its outline a sheet 2 cm aside is met within half a pixel of 8 mm, with depth and with masks alone."""
    world, towel = room(0.2, gravity=(0, 0, 0), table=False)
    shown, there = room(0.2, gravity=(0, 0, 0), table=False)
    shown.set_vertices(there, there.vertices + np.array([0.02, 0.0, 0.0]))
    mask, depth = look(shown, there)
    follower = nuno.follow(world, towel, CAMERA)
    for k in range(1, 16):
        follower.update(0.1 * k, mask, depth if with_depth else None)
    assert np.abs(towel.vertices.mean(axis=0) - there.vertices.mean(axis=0))[0] < 0.004


def test_forces_are_masses_times_what_the_residual_asks_for():
    """Seen 1 cm nearer, a weightless sheet is pushed by its mass times a mean acceleration along that way."""
    world, towel = room(0.2, gravity=(0, 0, 0), table=False)
    shown, there = room(0.21, gravity=(0, 0, 0), table=False)
    told = nuno.follow(world, towel, CAMERA, iterations=1).update(0.1, *look(shown, there))
    # pulled for half the span T and braked by 0.6 of it: a way of 0.2875 a T^2, and on average 0.2 a
    wanted = (1.0 - np.exp(-0.1 / 0.08)) * 0.01
    mean = 0.2 * wanted / (0.2875 * 0.1**2) * towel.mass
    total = told.forces.sum(axis=0)
    assert total[2] == pytest.approx(mean, rel=0.1)  # the camera is aslant, and pixels at the rim are some 8 mm wide
    assert np.abs(total[:2]).max() < 0.15 * mean


def test_a_batch_of_equal_futures_is_one():
    """Several futures of one material come to the bits of a single one."""
    found = []
    for materials in ((), (nuno.Cloth(),) * 3):
        world, towel = room()
        lifted(world, towel)
        shown, there = room()
        shown.set_vertices(there, there.vertices + np.array([0.01, 0.0, 0.0]))
        lifted(shown, there)
        follower = nuno.follow(world, towel, CAMERA, materials=materials)
        for k in range(1, 5):
            shown.run(0.1)
            told = follower.update(0.1 * k, *look(shown, there))
        found.append(towel.vertices)
    np.testing.assert_array_equal(*found)
    np.testing.assert_allclose(told.probabilities, 1.0 / 3.0)


def test_the_likeliest_material_is_adopted():
    """A hanging sheet that sags as a limp one is taken for limp rather than for stiff."""
    shown, there = room(0.3, table=False)
    limp, stiff = nuno.Cloth(bending_rigidity=1e-6), nuno.Cloth(bending_rigidity=2e-2)
    shown.set_material(there, limp)
    world, towel = room(0.3, table=False)
    for each, body in ((shown, there), (world, towel)):
        middle = [k for k, p in enumerate(body.vertices) if abs(p[0]) < 0.06]
        each.grip(body, middle, to=body.vertices[middle].mean(axis=0))
    follower = nuno.follow(world, towel, CAMERA, materials=(stiff, limp))
    for k in range(1, 6):
        shown.run(0.1)
        told = follower.update(0.1 * k, *look(shown, there))
    assert told.future == 1 and told.probabilities[1] > 0.9
    assert np.all(np.asarray(towel.material.bending_rigidity) == 1e-6)


@pytest.mark.parametrize("frames", [1, 2, 3, 3.5, 4, 5, 6])
def test_a_cloth_aside_comes_nearer_whatever_the_rate_of_images(frames):
    """On a table, 15 mm aside, a cloth is met within half a cell (25 mm) at any rate, and goes no other way."""
    world, towel = room()
    shown, there = room()
    shown.set_vertices(there, there.vertices + np.array([0.015, 0.0, 0.0]))
    seen = look(shown, there)
    follower = nuno.follow(world, towel, CAMERA)
    farthest = 0.0
    for k in range(1, int(72 / frames) + 1):
        follower.update(k * frames / 60.0, *seen)
        farthest = max(farthest, np.linalg.norm(towel.vertices - there.vertices, axis=1).mean())
    assert farthest < 0.0175  # what begins at 15 mm, and half a pixel of 8 mm at most
    assert np.linalg.norm(towel.vertices - there.vertices, axis=1).mean() < 0.01


def test_an_image_of_the_world_s_own_time_draws_nothing_and_says_so(caplog):
    """Of two followers of a world the second is told that no time is left; by turns both cloths are drawn."""

    def two(aside):
        world = nuno.World(device="cpu")
        world.add(nuno.box((1.0, 1.0, 0.02), name="table", position=(0, 0, -0.01)))
        cloths = [
            world.add(nuno.sheet((0.2, 0.2), (5, 5), name=name, position=(x + aside, 0, 0.002)))
            for name, x in (("a", -0.15), ("b", 0.15))
        ]
        for cloth in cloths:
            world.attach(cloth)
        return world, cloths

    shown, there = two(0.0)
    seen = [look(shown, cloth) for cloth in there]
    world, cloths = two(0.015)
    first, second = (nuno.follow(world, cloth, CAMERA) for cloth in cloths)
    with caplog.at_level(logging.WARNING, "nuno"):
        assert second.update(0.0, *seen[1]).reason == "instant"  # a first image, which is told of no one
        assert not caplog.records
        assert first.update(0.1, *seen[0]).used
        before = cloths[1].vertices
        for _ in range(2):
            told = second.update(0.1, *seen[1])
            assert told.reason == "instant" and not told.used and not told.forces.any()
    np.testing.assert_array_equal(cloths[1].vertices, before)
    assert [r.getMessage() for r in caplog.records if "by turns" in r.getMessage()] != []
    assert sum("said once" in r.getMessage() for r in caplog.records) == 1
    for k in range(3, 33):
        assert (first, second)[k % 2].update(0.05 * k, *seen[k % 2]).used
    for cloth, true in zip(cloths, there, strict=True):
        assert np.linalg.norm(cloth.vertices - true.vertices, axis=1).mean() < 0.01  # it began 15 mm off


@pytest.mark.parametrize("everywhere", [True, False])
def test_a_cloth_without_any_known_depth_is_followed_by_its_mask(everywhere):
    """Where the depth has holes all over the cloth, what its mask alone tells comes of it, to the bit."""
    found = []
    for with_depth in (True, False):
        world, towel = room()
        shown, there = room()
        shown.set_vertices(there, there.vertices + np.array([0.02, 0.0, 0.0]))
        mask, depth = look(shown, there)
        holes = np.where(np.ones_like(mask) if everywhere else mask > 0, np.nan, depth)
        follower = nuno.follow(world, towel, CAMERA)
        for k in range(1, 6):
            told = follower.update(0.1 * k, mask, holes if with_depth else None)
            assert told.used and told.agreement > 0.5
        found.append(towel.vertices)
    np.testing.assert_array_equal(*found)


def test_a_gripped_corner_stays_in_the_hand():
    """A grip on a path holds its corner whatever the images show."""
    world, towel = room()
    grip = lifted(world, towel)
    shown, there = room()
    shown.set_vertices(there, there.vertices + np.array([0.02, 0.01, 0.0]))
    follower = nuno.follow(world, towel, CAMERA)
    for k in range(1, 6):
        told = follower.update(0.1 * k, *look(shown, there))
        assert not told.forces[0].any()
    assert grip.active and world.time == pytest.approx(0.5)
    expected = grip.spec.at(np.array([0.5]))[0, 0, 0]
    assert np.abs(towel.vertices[0] - expected).max() < 1e-5  # float32 at a metre, and the grip is stiff


def test_hands_that_change_their_grip_are_followed():
    """A grip that is let go and another that is taken between images act in the futures, too."""
    world, towel = room()
    follower = nuno.follow(world, towel, CAMERA, materials=(nuno.Cloth(), nuno.Cloth(area_density=0.3)))
    grip = lifted(world, towel)
    follower.update(0.1)
    grip.release()
    place = towel.vertices[-1] + np.array([0.0, 0.0, 0.05])
    world.grip(towel, [len(towel.vertices) - 1], to=nuno.Path([0.1, 0.3], [towel.vertices[-1], place]))
    follower.update(0.5)
    assert np.abs(towel.vertices[-1] - place).max() < 1e-5  # as above
    assert not grip.active


def test_a_box_on_the_towel_goes_along():
    """Another dynamic body goes through the same time, once, and hides what is under it."""
    world, towel = room()
    brick = world.add(nuno.box((0.1, 0.1, 0.05), name="brick", position=(0, 0, 0.03)))
    world.attach(brick, nuno.Rigid())
    world.run(0.3)
    seen = look(world, towel)
    follower = nuno.follow(world, towel, CAMERA)
    for k in range(1, 4):
        told = follower.update(0.3 + 0.1 * k, *seen)
    assert told.agreement > 0.98 and told.error < 0.001  # what the box presses flat goes on for a while
    assert abs(brick.position[2] - 0.029) < 0.002  # it rests on the cloth, 4 mm thick


def test_restoring_amidst_goes_on_as_before():
    """A world that was saved and restored between images comes to the same bits."""
    found = []
    for restore in (False, True):
        world, towel = room()
        lifted(world, towel)
        shown, there = room()
        lifted(shown, there)
        follower = nuno.follow(world, towel, CAMERA)
        for k in range(1, 5):
            if restore and k == 3:
                saved = world.save()
                world.run(0.05)
                world.restore(saved)
            shown.run(0.1)
            follower.update(0.1 * k, *look(shown, there))
        found.append(towel.vertices)
    np.testing.assert_array_equal(*found)


def test_what_drew_a_cloth_ends_where_the_program_puts_it_elsewhere():
    """Put where it is seen, a cloth that friction held aside is pushed by nothing that was built up before."""
    world, towel = room()
    shown, there = room()
    shown.set_vertices(there, there.vertices + np.array([0.02, 0.0, 0.0]))
    world.run(0.3), shown.run(0.3)
    seen = look(shown, there)
    follower = nuno.follow(world, towel, CAMERA)
    for k in range(1, 4):
        assert follower.update(0.3 + 0.15 * k, *seen).forces.any()
    world.set_vertices(towel, there.vertices, np.zeros_like(there.vertices))
    told = follower.update(0.9, *seen)
    # as of a still cloth that is seen as it is: but the depth's steps of 10 um nothing draws it
    assert np.abs(told.forces).max() < 1e-6 * towel.mass * 9.81 / len(towel.vertices) + 1e-5


def test_images_are_segmented_by_the_first_ones_colours():
    """A colour image does as its mask does, to within the pixels at its rim."""
    world, towel = room()
    lifted(world, towel)
    shown, there = room()
    lifted(shown, there)
    follower = nuno.follow(world, towel, CAMERA)
    follower.update(0.0, nuno.take_picture(shown, CAMERA).color.numpy())
    for k in range(1, 4):
        shown.run(0.1)
        told = follower.update(0.1 * k, nuno.take_picture(shown, CAMERA).color.numpy())
    assert told.used and told.agreement > 0.9
    assert np.linalg.norm(towel.vertices - there.vertices, axis=1).mean() < 0.003


def test_streams_and_several_cameras():
    """A stream of tuples and mappings is followed; with two cameras each shows its own, or nothing."""
    world, towel = room()
    other = nuno.Camera.look_at((0.3, -0.3, 1.2), (0.0, 0.0, 0.2), 0.7, width=120, height=90)
    masks = [look(world, towel, camera)[0] for camera in (CAMERA, other)]
    follower = nuno.follow(world, towel, (CAMERA, other))
    told = list(follower.through([(0.1, masks), {"time": 0.2, "seen": [None, masks[1]]}, (0.3,)]))
    assert [each.reason for each in told] == [None, None, "dropped"]
    assert told[0].points > told[1].points > 0
    with pytest.raises(nuno.InvalidInputError, match="an image of a stream"):
        list(follower.through([0.4]))


def test_a_static_body_that_is_moved_hides_and_is_moved_in_the_futures():
    """A hand that the program moves between images hides the cloth where it is now."""
    world, towel = room()
    lid = world.add(nuno.box((0.6, 0.6, 0.01), name="lid", position=(2.0, 0, 0.5)))
    seen = look(world, towel)[0]
    follower = nuno.follow(world, towel, CAMERA)
    assert follower.update(0.1, seen).visible.all()
    lid.locate((0.0, 0.0, 0.3))
    told = follower.update(0.2, np.zeros_like(seen))
    assert told.reason == "hidden" and not told.visible.any()


def test_late_images_and_times_that_go_backwards(caplog):
    """An image of before the world's time is passed over, and told once; one before the last image is an error."""
    world, towel = room()
    seen = look(world, towel)[0]
    follower = nuno.follow(world, towel, CAMERA)
    follower.update(0.1, seen)
    world.run(0.3)
    with caplog.at_level(logging.WARNING, "nuno"):
        before = towel.vertices
        for time in (0.2, 0.25):
            told = follower.update(time, seen)
            assert told.reason == "late" and not told.used
    np.testing.assert_array_equal(towel.vertices, before)
    assert sum("came when the world" in record.getMessage() for record in caplog.records) == 1
    with pytest.raises(nuno.InvalidInputError, match="time goes backwards"):
        follower.update(0.1, seen)
    assert follower.update(0.5, seen).used


def test_long_gaps_go_by_physics():
    """After a gap of two seconds an image is used, and the world is at its time."""
    world, towel = room()
    follower = nuno.follow(world, towel, CAMERA)
    seen = look(world, towel)[0]
    follower.update(0.1, seen)
    assert follower.update(2.1, seen).used
    assert world.time == pytest.approx(2.1)


def test_bad_images_are_named_and_change_nothing():
    """Sizes, kinds and millimetres are refused before anything changes."""
    world, towel = room()
    follower = nuno.follow(world, towel, CAMERA)
    mask, depth = look(world, towel)
    negative = np.where(mask > 0, -depth, depth)
    bad = [(np.zeros((3, 4), bool),), (mask, depth[:5]), (mask, 1000.0 * depth), (mask, None, depth[:4]),
           (mask, negative), (None, -depth),
           (np.zeros((90, 120, 3)),), ("mask",), (mask, "depth"),
           (np.zeros((90, 120, 3), np.uint8), 1000.0 * depth)]  # fmt: skip
    for parts in bad:
        with pytest.raises(nuno.ImageError):
            follower.update(0.1, *parts)
    with pytest.raises(nuno.InvalidInputError):
        follower.update(float("nan"), mask)
    with pytest.raises(nuno.InvalidInputError):
        follower.update(0.1, mask, camera=CAMERA.scaled(0.5))
    assert world.time == 0.0


def test_what_cannot_be_followed_is_refused():
    """Static cloths, other bodies, batches, worlds that run, and cloths that were detached meanwhile."""
    world, towel = room()
    with pytest.raises(nuno.InvalidInputError, match="only cloth"):
        nuno.follow(world, "table", CAMERA)
    with pytest.raises(nuno.BodyStateError, match="batch"):
        nuno.follow(world.imagine(2), "towel", CAMERA)
    for wrong in ({"reach": 0.0}, {"iterations": 0}, {"pixels": -1}):
        with pytest.raises(nuno.InvalidInputError):
            nuno.follow(world, towel, CAMERA, **wrong)
    with pytest.raises(nuno.InvalidInputError):
        nuno.follow(world, towel, [])
    follower = nuno.follow(world, towel, CAMERA)
    world.detach(towel)
    with pytest.raises(nuno.BodyStateError, match="attach"):
        follower.update(0.1)
    with pytest.raises(nuno.BodyStateError, match="static"):
        nuno.follow(world, towel, CAMERA)
    world.attach(towel)
    with world:
        world.start()
        with pytest.raises(nuno.BodyStateError, match="background"):
            follower.update(10.0)
