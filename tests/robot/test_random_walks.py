"""Robots that walk, under random operations: what begins in imagined worlds has the bits of the robot's own walks."""

import numpy as np
import pytest

import nuno

OPERATIONS = 6
"""Of a sequence: enough that walks begin, change and end among other things."""
AHEAD = 0.4
"""[s] In which copies are compared: a walk is in its first step then."""
ARM = "arm_left_4_joint"
JOYSTICK = "joystick"
"""In place of a time for which to go at a velocity: it is sent again, and changed, while the robot walks."""


def walk(robot, random):
    """Set off to a place nearby."""
    robot.go_pos(*random.uniform(-0.15, 0.15, 3), wait=False)


def go(robot, random):
    """Go at a velocity, or go on so."""
    robot.go_velocity(*random.uniform(-0.03, 0.03, 3), sec=1.5, wait=False)


def drive(robot, random):
    """Send a velocity as a joystick does; perhaps none."""
    velocity = random.uniform(-0.04, 0.04, 3) * (random.random() < 0.8)
    robot.send_velocity(*velocity, hold=random.choice([0.3, 1.5]))


def stay(robot, random):
    """Come to rest."""
    robot.go_stop(force_stop=False)


def wave(robot, random):
    """Send an arm elsewhere."""
    robot.angle_vector({ARM: random.uniform(-1.5, -0.5)}, random.uniform(0.2, 0.6))


def close(robot, random):
    """Let a hand close on the towel's corner, perhaps on nothing."""
    robot.start_grasp("larm", wait=False)


def open_hand(robot, random):
    """Let it open again."""
    robot.stop_grasp("larm", wait=False)


def wall(robot, random):
    """Put the wall nearer, or far away."""
    robot.world.find("wall").locate((float(random.choice([0.5, 0.7, 5.0])), 0.0, 1.0))


def push(robot, random):
    """Push the cube."""
    robot.world.push("cube", random.uniform(-2.0, 2.0, 3), duration=0.05)


def change(robot, random):
    """Give the robot dynamics, or take them."""
    if robot.links.are_joints:
        robot.detach() if robot.is_dynamic else robot.attach()


def run(robot, random):
    """A few frames, or parts of one."""
    robot.world.run(random.choice([1.0 / 60.0, 0.05, 0.013, 0.4, 0.8]))


def go_back(robot, random):
    """Save, go on, and restore."""
    saved = robot.world.save()
    robot.world.run(0.05)
    robot.world.restore(saved)


def adopt(robot, random):
    """Become one of two futures in which the robot set off to different places."""
    futures = robot.world.imagine(2)
    futures.robot.go_pos(random.uniform(-0.1, 0.1, 2), 0.0, 0.1)
    futures.run(0.05)
    robot.world.adopt(futures, int(random.integers(2)))


def adopt_commands(robot, random):
    """Do what the robot did in a future that it set off in, after a while."""
    futures = robot.world.imagine(2)
    futures.run(0.05)
    futures.robot.go_pos(random.uniform(-0.1, 0.1, 2), 0.0, 0.1)
    futures.run(0.05)
    robot.world.adopt(futures, int(random.integers(2)), only="commands")


CHOICES = (
    walk, walk, go, stay, wave, close, open_hand, wall, push, change, run, run, run, go_back, adopt, adopt_commands
)  # fmt: skip
JOYSTICKS = (*CHOICES, drive, drive)
"""Of a robot that begins without dynamics."""


def room(dynamics):
    """Talos on a floor, with a towel at its left hand, a cube beside it and a wall."""
    world = nuno.World(device="cpu", substeps=8)
    world.add(nuno.plane(name="floor"))
    world.add(nuno.box((0.1, 3.0, 2.0), name="wall", position=(5.0, 0.0, 1.0)))
    robot = nuno.SimulatedRobot(nuno.Humanoid("talos"), world, dynamics=dynamics)
    hand = robot.actual.frame_pose("left_hand").position
    towel = world.add(nuno.sheet((0.2, 0.2), (4, 4), name="towel", position=hand + np.array([0.09, 0.0, 0.0])))
    world.attach(towel)
    cube = world.add(nuno.box((0.1,) * 3, name="cube", position=(0.0, 0.6, 0.06)))
    world.attach(cube, nuno.Rigid(mass=0.5))
    return robot


def state_of(world, robot, k=None):
    """All that there is to see of a world and its robot, or of world k of a batch."""
    state, hands = robot.state() if k is None else robot.state()[k], robot.hands
    found = {"q": state.q, "v": state.v, "a": state.a, "collision": np.array(str(state.collision))}
    for name, hand in hands.items():
        held = {body.name for body in hand.held} if k is None else {body for body, own in hand.held.items() if own[k]}
        gripper = robot.grippers[name] if k is None else robot._grippers[name][k]
        found[name] = str((sorted(held), None if gripper.goal is None else (gripper.goal.status, gripper.goal.holds)))
    for body in world.bodies:
        found[body.name] = body.vertices if k is None or body.vertices.ndim == 2 else body.vertices[k]
    return found


def differing(found, expected):
    """Names of what is not equal to the bit."""
    return [name for name, own in expected.items() if not np.array_equal(found[name], own)]


def states_of(futures):
    """The same of each world of a batch."""
    return [state_of(futures, futures.robot, k) for k in range(futures.world_count)]


def imagined(futures, ways, sec, seconds, grasps):
    """Let copies go their ways, open or close a hand and move an arm on the way; return what they came to."""
    if sec == JOYSTICK:
        futures.robot.send_velocity(*ways.T)
    else:
        futures.robot.go_pos(*ways.T) if sec is None else futures.robot.go_velocity(*ways.T, sec)
    futures.robot.move_gripper("larm", grasps)
    futures.run(seconds)
    futures.robot.angle_vector({ARM: -1.0}, 0.3)
    if sec == JOYSTICK:
        futures.robot.send_velocity(*-ways.T, 3.0)
    futures.run(seconds)
    return states_of(futures)


def alone(robot, way, sec, seconds, grasp):
    """Let the robot do the same in its own world."""
    if sec == JOYSTICK:
        robot.send_velocity(*way)
    else:
        robot.go_pos(*way, wait=False) if sec is None else robot.go_velocity(*way, sec, wait=False)
    robot.move_gripper("larm", float(grasp), wait=False)
    robot.world.run(seconds)
    robot.angle_vector({ARM: -1.0}, 0.3)
    if sec == JOYSTICK:
        robot.send_velocity(*-way, 3.0)
    robot.world.run(seconds)
    return state_of(robot.world, robot)


def check(seed, dynamics):
    """Let random operations happen, then compare walks that begin in copies with the robot's own; name what differs."""
    random = np.random.default_rng(seed)
    robot = room(dynamics)
    world, log = robot.world, []
    for _ in range(OPERATIONS):
        choices = CHOICES if dynamics else JOYSTICKS
        operation = choices[random.integers(len(choices))]
        log.append(operation.__name__)
        try:
            operation(robot, random)
        except nuno.NunoError as error:
            log[-1] += f" ({type(error).__name__})"
    robot.world.run(random.choice([0.05, 1.0, 4.0]))
    kinds = (None, 1.0) if dynamics else (None, 1.0, JOYSTICK)
    saved, sec = world.save(), kinds[random.integers(len(kinds))]
    ways = random.uniform(-0.2, 0.2, (3, 3)) * (1.0 if sec is None else 0.15)  # strides are as long as they are
    grasps = random.integers(0, 2, 3)
    ways[2], grasps[2] = ways[0], grasps[0]
    wrong, futures = [], world.imagine(3)
    ends = imagined(futures, ways, sec, AHEAD, grasps)
    for k in range(2):
        world.restore(saved)
        expected = alone(robot, ways[k], sec, AHEAD, grasps[k])
        wrong += [f"walk {k}: {name}" for name in differing(ends[k], expected)]
    wrong += [f"the same walk: {name}" for name in differing(ends[2], ends[0])]

    # a batch that goes back, copies of a copy, and the robot itself go on with it
    world.restore(saved)
    kept, again = futures.save(), futures.imagine(1, world=1)
    futures.run(AHEAD)
    again.run(AHEAD)
    later = states_of(futures)
    wrong += [f"copy of a copy: {name}" for name in differing(states_of(again)[0], later[1])]
    futures.restore(kept)
    world.adopt(futures, 1)
    futures.run(AHEAD)
    world.run(AHEAD)
    for k, own in enumerate(states_of(futures)):
        wrong += [f"restored batch, {k}: {name}" for name in differing(own, later[k])]
    wrong += [f"adopted: {name}" for name in differing(state_of(world, robot), later[1])]

    # commands alone, from the same moment
    world.restore(saved)
    world.adopt(futures, 0, only="commands")
    world.run(AHEAD)
    world.run(AHEAD)  # in the same steps, as sums of times are rounded
    wrong += [f"commanded: {name}" for name in differing(state_of(world, robot), ends[0])]
    return [f"seed {seed} after {', '.join(log)}: {each}" for each in wrong[:5]]


@pytest.mark.long
def test_fingers_that_are_opened_let_go_in_copies_too():
    """Promise: a vector that opens fingers with dynamics lets go in copies as alone, now and in copies of these."""
    robot = room(True)
    world = robot.world
    robot.start_grasp("larm", wait=False)
    world.run(0.35)
    closed = robot.balance.dynamics.fingers.closed
    futures, saved = world.imagine(2), world.save()
    for own in (futures.robot, robot):
        own.angle_vector({"gripper_left_joint": -0.3}, 0.2)
    robot.world.run(0.4)
    assert not closed["left_hand"]  # the towel was between its fingers
    robot.angle_vector({ARM: -1.0}, 0.2)
    world.run(0.2)
    alone = state_of(world, robot)

    futures.run(0.4)
    again, kept = futures.imagine(1, world=1), futures.save()
    for _ in range(2):  # the second time from where the batch went back to
        futures.robot.angle_vector({ARM: -1.0}, 0.2)
        futures.run(0.2)
        for own in states_of(futures):
            assert differing(own, alone) == []
        futures.restore(kept)
    again.robot.angle_vector({ARM: -1.0}, 0.2)
    again.run(0.2)
    assert differing(states_of(again)[0], alone) == []
    world.restore(saved)
    world.adopt(futures, 1)
    robot.angle_vector({ARM: -1.0}, 0.2)
    world.run(0.2)
    assert differing(state_of(world, robot), alone) == []


@pytest.mark.long
@pytest.mark.parametrize("seeds", [(0, 17), pytest.param(range(1, 22), marks=pytest.mark.slow)], ids=str)
@pytest.mark.parametrize("dynamics", [False, True], ids=["kinematic", "dynamic"])
def test_walks_in_copies_of_random_robots(dynamics, seeds):
    """Twenty sequences each: walks that begin in copies, changed, saved, imagined and adopted, equal now and later."""
    assert [each for seed in seeds for each in check(seed, dynamics)] == []
