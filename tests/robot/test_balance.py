"""Balance: copies of a robot are balanced together as each would be alone."""

import numpy as np
import pinocchio as pin
import pytest

import nuno
from nuno.robot.balance import Balance
from nuno.robot.capture_step import BEYOND, outside
from nuno.robot.foot_kinematics import WORLD_AXES, FeetAndCentre
from nuno.robot.footing import planned_footings
from nuno.robot.robot_state import RobotState
from nuno.robot.support import convex_outline

SPAN = 1 / 60


@pytest.fixture(scope="module")
def talos():
    """Talos in its posture, with one body for each joint."""
    world = nuno.World(device="cpu")
    robot = nuno.Humanoid("talos")
    return robot, Balance(robot.enter(world, "joints"))


def moving(robot, count, seed, fast):
    """States of copies near the posture, which move; the faster the later."""
    rng, model = np.random.default_rng(seed), robot.model
    found = []
    for k in range(count):
        q = pin.integrate(model, robot.posture_configuration(), 0.01 * rng.normal(size=model.nv))
        v = 0.02 * rng.normal(size=model.nv)
        v[:2] += fast * k * rng.uniform(-1.0, 1.0, 2)
        found.append(RobotState(0.0, q, v, 0.1 * rng.normal(size=model.nv)))
    return found


def test_kinematics_are_pinocchios(talos):
    """Each world's centre of mass and soles are what Pinocchio has for it; the same motion is not worked out anew."""
    robot, _ = talos
    states, data = moving(robot, 3, 0, 0.1), robot.model.createData()
    kinematics = FeetAndCentre(robot)
    motions = [[getattr(own, name) for own in states] for name in ("q", "v", "a")]
    found = kinematics.of(*motions)
    for w, own in enumerate(states):
        pin.centerOfMass(robot.model, data, own.q, own.v, own.a)
        pin.updateFramePlacements(robot.model, data)
        np.testing.assert_array_equal(found.centres[w], [data.com[0], data.vcom[0], data.acom[0]])
        for k, foot in enumerate(robot.frame_index(name) for name in robot.description.feet):
            np.testing.assert_array_equal(found.places[w, k], data.oMf[foot].translation)
            np.testing.assert_array_equal(found.turns[w, k], data.oMf[foot].rotation)
            speed = pin.getFrameVelocity(robot.model, data, foot, WORLD_AXES).vector
            np.testing.assert_array_equal(found.speeds[w, k], speed)
            push = pin.getFrameClassicalAcceleration(robot.model, data, foot, WORLD_AXES).vector
            np.testing.assert_array_equal(found.accelerations[w, k], push)
    assert kinematics.of(*motions) is found
    assert kinematics.of(motions[0], motions[1], [own.copy() for own in motions[2]]) is not found


def test_copies_are_balanced_as_each_alone(talos):
    """Commands and states of twelve copies have the bits of each alone; some step, and one falls."""
    robot, balance = talos
    now, wanted = moving(robot, 12, 1, 0.15), moving(robot, 12, 2, 0.0)
    ends = np.random.default_rng(3).normal(size=(12, robot.model.nv))
    for frame in range(4):
        together = balance.command(now, wanted, SPAN, None)
        alone = [balance.command([a], [b], SPAN, None) for a, b in zip(now, wanted, strict=True)]
        for part, own in zip(together, zip(*alone, strict=True), strict=True):
            np.testing.assert_array_equal(part, np.concatenate(own))
        feet = {"leg_left_6_link": 300.0 + 200.0 * frame, "leg_right_6_link": 450.0}
        pressed = {name: {"floor": np.array([0.0, 0.0, force])} for name, force in feet.items()}
        ended = []
        for k, own in enumerate(now):
            q = pin.integrate(robot.model, own.q, 1e-3 * ends[k])
            q[2] -= 0.6 if k == 11 and frame == 2 else 0.0
            wrenches = np.zeros((len(robot.joint_names), 6))
            ended.append((q, own.v, np.zeros(len(robot.joint_names)), pressed, wrenches, None))
        time = (frame + 1) * SPAN
        together = balance.judge(now, wanted, ended, time)
        for k, state in enumerate(together):
            own = balance.judge(now[k : k + 1], wanted[k : k + 1], ended[k : k + 1], time)[0]
            assert (own.fallen, own.over_torque) == (state.fallen, state.over_torque)
            assert (own.footing is None) == (state.footing is None)
            if own.footing is not None and state.footing is not None:
                assert (own.footing.bears, own.footing.frames) == (state.footing.bears, state.footing.frames)
                assert (own.footing.step is None) == (state.footing.step is None)
                for name in ("offsets", "tilts", "centre"):
                    np.testing.assert_array_equal(getattr(own.footing, name), getattr(state.footing, name))
        now = together
    steps = [own.footing is not None and own.footing.step is not None for own in now]
    assert now[11].fallen is not None and any(steps) and not all(steps)


def test_who_stays_for_sure_is_inside_the_outline(talos):
    """Whoever is found in balance without the soles' outline would be with it; those whose speed is least are found."""
    robot, balance = talos
    stabiliser = balance._stabiliser
    states = moving(robot, 60, 4, 0.02)
    q, v = ([getattr(own, name) for own in states] for name in ("q", "v"))
    rest = [RobotState(0.0, robot.posture_configuration(), 0.0 * states[0].v, 0.0 * states[0].v)] * len(states)
    here, ref = stabiliser.actual(q, v), stabiliser._wanted_of(rest)
    footings = planned_footings(ref.places[:, :, 2])
    stays = stabiliser._surely_stay(here, ref, footings, list(range(len(states))))
    beyond = []
    for own in states:
        pendulum, _ = stabiliser._pendulum(own.q, own.v)
        beyond.append(outside(convex_outline(np.concatenate(pendulum.outlines)), pendulum.point, BEYOND))
    assert not (stays & np.array(beyond)).any()
    assert stays[:10].all() and any(beyond)
