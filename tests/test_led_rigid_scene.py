"""Static bodies in the rigid solver: those that followed a path stand, and what hangs on one does not move it."""

import numpy as np
import pytest
import warp as wp

import nuno
from nuno.rigid.rigid_body import RigidState, apply_rigid_correction


def scene():
    """A rod hinged to a post that is aslant and a cup that the post holds; a cube on a tray that follows a path."""
    world = nuno.World(device="cpu")
    post = world.add(nuno.box((0.1, 0.1, 0.1), name="post", position=(0.0, 0.0, 1.0)).rotate(0.7, (1, 2, 3)))
    rod = world.add(nuno.box((0.3, 0.02, 0.02), name="rod", position=(0.3, 0.0, 1.0)))
    tray = world.add(nuno.box((0.3, 0.3, 0.02), name="tray", position=(0.0, 1.0, 0.0)).rotate(0.3, (3, 1, 2)))
    cube = world.add(nuno.box((0.05, 0.05, 0.05), name="cube", position=(0.0, 1.0, 0.06)))
    world.attach(rod, nuno.Rigid(mass=0.2))
    world.attach(cube, nuno.Rigid(mass=0.2))
    nuno.hinge(rod, post, point=(0.1, 0.0, 1.0), axis=(0, 1, 0))
    cup = world.add(nuno.box((0.05, 0.05, 0.05), name="cup", position=(-0.1, 0.0, 1.0)))
    world.attach(cup, nuno.Rigid(mass=0.2))
    world.grip(cup, to=post)
    end = (tray.position + np.array([0.02, 0.01, 0.013]))[None]
    world.move(tray, nuno.Path([0.0, 0.2], [tray.position, *end]))
    return world


def pose_of(world, name):
    """Where the rigid solver has a static body."""
    scene, slot = world._rigid, world._rigid.static[world.find(name).key].slot
    state = scene.solver.state
    return np.concatenate([array.numpy()[slot] for array in (state.position, state.rotation, state.velocity)])


def spin_of(world, name):
    """How the rigid solver has a static body turn."""
    scene = world._rigid
    return scene.solver.velocity(scene.static[world.find(name).key].slot)[1]


def test_a_static_body_that_holds_something_keeps_every_bit():
    """Invariant: no correction moves it, and rounding does not either."""
    for k in range(10):
        world = scene()
        post = world.find("post")
        post.rotate(0.1 * k, (3, 1, 2))
        world.run(0.1)
        told = np.roll(post.quaternion / np.linalg.norm(post.quaternion), -1).astype(np.float32)
        np.testing.assert_array_equal(pose_of(world, "post")[3:7], told)


def test_a_body_that_arrived_stands_in_a_world_and_in_its_copy():
    """Promise: the end of a path is where a body is told to be, at rest, in the world as in a copy made then."""
    world = scene()
    world.run(0.2)
    assert world.find("tray")._dynamics is None
    copy = nuno.World(device="cpu")
    copy.restore(world.save())
    for each in (world, copy):
        each.run(0.1)
    np.testing.assert_array_equal(pose_of(copy, "tray"), pose_of(world, "tray"))
    np.testing.assert_array_equal(pose_of(world, "tray")[-3:], 0.0)
    for name in ("rod", "cup", "cube"):
        np.testing.assert_array_equal(copy.find(name).vertices, world.find(name).vertices)
        np.testing.assert_array_equal(copy.find(name).velocities, world.find(name).velocities)


@wp.kernel(enable_backward=False, module="tests.correct_fixed_body")
def correct(state: RigidState):
    """Corrections of a body without a weight, as passes over contacts and ties make them."""
    for _pass in range(20):
        apply_rigid_correction(state, 0, wp.vec3(0.1, 0.2, 0.3), wp.vec3(0.3, 0.1, 0.2))


@pytest.mark.long
def test_corrections_round_nothing_of_a_body_that_they_do_not_move():
    """Invariant: a quaternion whose length is 1 but for rounding stays as it is."""
    state = RigidState()
    turn = np.array([[0.9245358, -0.2159297, 0.0805764, -0.303505]], dtype=np.float32)
    for name, values, kind in (
        ("position", np.ones((1, 3)), wp.vec3), ("lost", np.zeros((1, 3)), wp.vec3), ("rotation", turn, wp.quat),
        ("weight", np.zeros(1), float), ("give", np.zeros((1, 3, 3)), wp.mat33),
    ):  # fmt: skip
        setattr(state, name, wp.array(values.astype(np.float32), dtype=kind, device="cpu"))
    wp.launch(correct, dim=1, inputs=[state], device="cpu")
    np.testing.assert_array_equal(state.rotation.numpy(), turn)


def test_what_is_led_nowhere_stands():
    """Invariant: a body on a path that stays where it is has no spin, not that of a rounded turn."""
    for k in range(10):
        world = scene()
        tray = world.find("tray")
        world.move(tray, None)
        tray.rotate(0.1 * k, (1, 2, 3))
        world.move(tray, nuno.Path([0.0, 1.0], [tray.position, tray.position]))
        world.run(0.02)
        np.testing.assert_array_equal(spin_of(world, "tray"), 0.0)
