"""Robots with dynamics on MuJoCo: standing, moving, imagined, and beside Nuno's own engine."""

import numpy as np
import pytest

import nuno

pytest.importorskip("mujoco", minversion="4.0")
pytest.importorskip("pinocchio")

WAYS = {"arm_left_2_joint": 0.4, "arm_right_4_joint": -0.5, "torso_1_joint": 0.3, "leg_left_4_joint": 0.4}
"""[rad] How far joints are sent."""


def response(engine, seconds):
    """Angles (frames, n) of a Talos afloat without weight, whose motors are sent elsewhere, and the joints' ranges."""
    from nuno.robot.link_dynamics import LinkDynamics

    robot = nuno.Humanoid("talos")
    robot.angle_vector({"gripper_left_joint": -0.5, "gripper_right_joint": -0.5})
    world = nuno.World(device="cpu", gravity=(0.0, 0.0, 0.0), substeps=10, engine=engine)
    dynamics = LinkDynamics(robot.enter(world, "joints"))
    dynamics.efforts = np.full(len(robot.joint_names), 1e4)
    dynamics.attach()
    wanted = robot.angle_vector()
    for name, way in WAYS.items():
        wanted[robot.joint_index(name)] += way
    still = np.zeros(len(wanted))
    # a critically damped motion of 10 rad/s for joints that carry 0.5 kg m2
    dynamics.drive(wanted, still, still + 50.0, still + 10.0, still)
    found = []
    for _ in range(round(60 * seconds)):
        world.step()
        found.append(robot.angles_of(dynamics.read()[0][0]))
    return np.array(found), np.subtract(*robot.joint_limits[::-1])


@pytest.mark.long
def test_a_step_response_is_that_of_the_built_in_engine():
    """The same links, gains and friction, 0.5 s afloat: within 0.5 % of the joints' ranges."""
    own, ranges = response("nuno", 0.5)
    other, _ = response("mujoco", 0.5)
    assert np.abs(own - own[0]).max() > 0.2
    assert (np.abs(own - other) / ranges).max() < 0.005


@pytest.mark.long
def test_talos_stands_moves_an_arm_and_is_imagined():
    """Under its controllers and balance: its feet bear its weight, and an arm goes where it is sent."""
    world = nuno.World(device="cpu", engine="mujoco")
    world.add(nuno.plane(name="floor"))
    robot = nuno.SimulatedRobot(nuno.Humanoid("talos"), world, dynamics=True)
    world.run(0.5)
    state = robot.state()
    assert state.fallen is None
    borne = sum(force[2] for link in state.contacts.values() for force in link.values())
    mass = sum(float(body.mass) for body in robot.links.bodies)
    assert borne == pytest.approx(9.81 * mass, rel=0.01)
    compilations = world.engine.scene.compilations
    angles = robot.angle_vector()
    angles[robot.actual.joint_names.index("arm_left_4_joint")] -= 0.3
    robot.angle_vector(angles, 0.5)
    world.run(1.0)
    state = robot.state()
    assert state.fallen is None and world.engine.scene.compilations == compilations
    # what the balance's soft motors leave, as with Nuno's own engine
    np.testing.assert_allclose(robot.actual.angles_of(state.q), angles, atol=5e-3)
    assert np.abs(state.q[:2]).max() < 0.02
    futures = world.imagine(2)
    futures.run(0.1)
    world.run(0.1)
    link = robot.links.bodies[-1].name
    np.testing.assert_allclose(futures.find(link).position[1], world.find(link).position, atol=1e-3)
