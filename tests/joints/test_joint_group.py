"""Joints that are read and driven together: what each of them tells by itself."""

import numpy as np
import pytest

import nuno
from nuno.errors import InvalidInputError
from nuno.joints.joint_group import JointGroup

POSITIONS, EFFORTS = np.array([0.4, -0.3]), np.array([0.5, 2.0])
STIFFNESS, DAMPING, LARGEST = np.array([20.0, 300.0]), np.array([1.0, 10.0]), np.array([5.0, np.inf])


def arm(world):
    """A hinge on a static post and a slider on the arm that it turns."""
    post = world.add(nuno.box((0.1, 0.1, 0.1), position=(0.0, 0.0, 1.0), name="post"))
    turning = world.add(nuno.box((0.4, 0.05, 0.05), position=(0.25, 0.0, 1.0), name="arm"))
    sliding = world.add(nuno.box((0.06, 0.06, 0.06), position=(0.45, 0.1, 1.0), name="tip"))
    for body in (turning, sliding):
        world.attach(body, nuno.Rigid(mass=1.0))
    hinge = nuno.hinge(turning, post, point=(0.05, 0.0, 1.0), axis=(0.0, 1.0, 0.0))
    slider = nuno.slider(sliding, turning, point=(0.45, 0.0, 1.0), axis=(0.0, 1.0, 0.0))
    return hinge, slider


@pytest.mark.parametrize("worlds", [1, 3])
def test_a_group_tells_what_its_joints_tell(worlds):
    """Positions and efforts to the bit, velocities up to rounding, in a world and in a batch."""
    world = nuno.World(device="cpu")
    joints = arm(world)
    if worlds > 1:
        world.run(1 / 60)
        keys = [joint.key for joint in joints]
        world = world.imagine(worlds)
        found = {grip.key: grip for name in ("arm", "tip") for grip in world.find(name)._dynamics.grips}
        joints = [found[key] for key in keys]
    group = JointGroup(joints)
    nothing = np.zeros(2)
    group.drive(POSITIONS, nothing, STIFFNESS, DAMPING, LARGEST, EFFORTS)
    world.run(0.2)
    positions, velocities = group.read()
    efforts = group.efforts()
    assert positions.shape == velocities.shape == efforts.shape == (worlds, 2)
    for n, joint in enumerate(joints):
        assert np.array_equal(positions[:, n], np.broadcast_to(joint.position, worlds))
        assert np.array_equal(efforts[:, n], np.broadcast_to(joint.effort, worlds))
        # the order of a sum of four differs
        np.testing.assert_allclose(velocities[:, n], joint.velocity, rtol=1e-12, atol=1e-12)
    assert np.abs(velocities).min() > 1e-3


def test_it_drives_as_motors_do():
    """The same bits as with a motor given to each joint."""
    found = []
    for together in (True, False):
        world = nuno.World(device="cpu")
        joints = arm(world)
        if together:
            JointGroup(joints).drive(POSITIONS, np.zeros(2), STIFFNESS, DAMPING, LARGEST, EFFORTS)
        else:
            for n, joint in enumerate(joints):
                joint.motor = nuno.Motor(0.0, POSITIONS[n], STIFFNESS[n], DAMPING[n], LARGEST[n], EFFORTS[n])
        world.run(0.3)
        found.append([joint.position for joint in joints])
    assert found[0] == found[1]


def test_bad_calls_are_named():
    """Another kind of joint, values that are not finite, no stiffness."""
    world = nuno.World(device="cpu")
    hinge, slider = arm(world)
    group, nothing, one = JointGroup([hinge, slider]), np.zeros(2), np.ones(2)
    for positions, stiffness, damping in (
        (np.array([0.0, np.nan]), one, one), (nothing, nothing, one), (nothing, one, -one),
    ):  # fmt: skip
        with pytest.raises(InvalidInputError, match="motors need"):
            group.drive(positions, nothing, stiffness, damping, LARGEST, nothing)
    fixed = nuno.ball_joint(hinge.body, None, point=(0.3, 0.0, 1.0))
    with pytest.raises(InvalidInputError, match="hinges and sliders"):
        JointGroup([fixed])


def test_it_knows_when_its_bodies_have_other_dynamics():
    """Detached and attached again, a body has a place of its own among the solver's."""
    world = nuno.World(device="cpu")
    joints = arm(world)
    group = JointGroup(joints)
    assert group.is_current()
    body = joints[1].body
    world.detach(body)
    assert not group.is_current()
