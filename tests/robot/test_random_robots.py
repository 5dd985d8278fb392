"""Robots under random operations: imagined, restored and adopted ones go on with the same bits, their hands too."""

import numpy as np
import pytest
from lifter import lifter_in

import nuno
from nuno.world.grips_of_worlds import grips_by_key

OPERATIONS = 8
"""Of a sequence: enough that a hand that closes is told something else on the way."""
AHEAD = 0.25
"""[s] In which copies are compared: a hand closes within 0.2 s."""


def send(copies, robot, heights):
    """Send the palms of copies elsewhere, unless a servo law moves them."""
    if robot._servo is None:
        copies.angle_vector({"lift": heights}, 0.2)


def servo(robot, random):
    """Put the slide under a servo law, soft enough that it feels what it bears, or give it back."""
    command = nuno.ServoCommand(("lift",), random.uniform(0.0, 0.1), kp=random.uniform(100.0, 1000.0), kd=20.0)
    robot.servo(command if random.integers(4) else None)


def drop(robot, random):
    """Let the cube or the towel fall on the palm."""
    place = robot.actual.frame_pose("right_hand").position + np.append(random.uniform(-0.01, 0.01, 2), 0.15)
    robot.world.find(("cube", "towel")[random.integers(2)]).locate(place)


def hang(robot, random):
    """Let the program grip the towel or the cube to the palm, or let go what it gripped so."""
    bodies, name = robot.links.bodies, ("cube", "towel")[random.integers(2)]
    grips = [grip for grip in grips_by_key(robot.world).values() if grip.body.name == name]
    if grips:
        grips[0].release()
    else:
        palm = next(own for own in bodies if "palm" in own.name)
        robot.world.grip(name, [0, 4] if name == "towel" else None, to=palm)


def lift(robot, random):
    """Send the palm elsewhere."""
    robot.angle_vector({"lift": random.uniform(0.0, 0.1)}, random.uniform(0.05, 0.3))


def sequence(robot, random):
    """Send the palm through three places."""
    robot.angle_vector_sequence([{"lift": height} for height in random.uniform(0.0, 0.1, 3)], 0.1)


def close(robot, random):
    """Let the hand close, as hard as it draws."""
    robot.start_grasp("rarm", effort=random.uniform(2.0, 40.0), wait=False)


def open_hand(robot, random):
    """Let the hand open, perhaps not wholly."""
    robot.move_gripper("rarm", random.uniform(0.5, 1.0), wait=False)


def opened(robot, random):
    """Open or close the hand by a vector of joints."""
    robot.angle_vector({"turn": random.uniform(-0.5, 0.0)}, 0.1)


def stop(robot, random):
    """Stop the joints."""
    robot.cancel_angle_vector()


def push(robot, random):
    """Push what may be between the fingers."""
    robot.world.push("cube", random.uniform(-0.5, 0.5, 3), duration=0.05)


def put(robot, random):
    """Put the cube between the fingers, or the towel."""
    place = robot.actual.frame_pose("right_hand").position + random.uniform(-0.002, 0.002, 3)
    robot.world.find(("cube", "towel")[random.integers(2)]).locate(place)


def change(robot, random):
    """Give the robot dynamics, or take them."""
    if robot.links.are_joints:
        robot.detach() if robot.is_dynamic else robot.attach()


def run(robot, random):
    """A few frames, or parts of one."""
    robot.world.run(random.choice([1.0 / 60.0, 0.05, 0.013, 0.1]))


def go_back(robot, random):
    """Save, go on, and restore."""
    saved = robot.world.save()
    robot.world.run(0.05)
    robot.world.restore(saved)


def adopt(robot, random):
    """Become one of two futures, whose palms go to different places, and whose hands may close or open there."""
    futures = robot.world.imagine(2)
    send(futures.robot, robot, random.uniform(0.0, 0.1, 2))
    futures.robot.move_gripper("rarm", random.integers(0, 2, 2), effort=random.uniform(2.0, 40.0))
    futures.run(random.choice([0.0, 0.35]))
    futures.run(0.05)
    robot.world.adopt(futures, int(random.integers(2)))


def adopt_commands(robot, random):
    """Do what the robot's hand was told in a future, after a while."""
    futures = robot.world.imagine(2)
    futures.run(0.05)
    futures.robot.move_gripper("rarm", random.integers(0, 2, 2))
    send(futures.robot, robot, random.uniform(0.0, 0.1, 2))
    futures.run(0.05)
    robot.world.adopt(futures, int(random.integers(2)), only="commands")


CHOICES = (
    lift, sequence, close, close, open_hand, stop, push, put, change, run, run, go_back, adopt, adopt_commands, opened,
    servo, servo, drop, hang,
)  # fmt: skip


def room(folder, kind):
    """A lifter with a cube between its fingers and a towel beside it."""
    world = nuno.World(device="cpu", substeps=8)
    robot = lifter_in(folder, world, dynamics=kind != "kinematic", fingers=kind != "gripping")
    cube = world.add(nuno.box((0.05,) * 3, name="cube", position=(0.0, 0.0, 1.0)))
    world.attach(cube, nuno.Rigid(mass=0.1, friction=0.5))
    towel = world.add(nuno.sheet((0.1, 0.1), (4, 4), name="towel", position=(0.2, 0.0, 1.0)))
    world.attach(towel)
    return robot


def state_of(world, robot, k=None):
    """All that there is to see of a world and its robot, or of world k of a batch."""
    state, hand = robot.state() if k is None else robot.state()[k], robot.hands["right_hand"]
    gripper = robot.grippers["right_hand"] if k is None else robot._grippers["right_hand"][k]
    held = {body.name for body in hand.held} if k is None else {name for name, own in hand.held.items() if own[k]}
    status = None if gripper.goal is None else (gripper.goal.status, gripper.goal.holds)
    found = {"q": state.q, "v": state.v, "a": state.a, "held": sorted(held), "goal": str(status)}
    for body in world.bodies:
        found[body.name] = body.vertices if k is None else body.vertices[k]
    return found


def states_of(futures):
    """The same of each world of a batch."""
    return [state_of(futures, futures.robot, k) for k in range(futures.world_count)]


def differing(found, expected):
    """Names of what is not equal to the bit."""
    return [name for name, own in expected.items() if not np.array_equal(found[name], own)]


def check(seed, folder, kind):
    """Let random operations happen, then compare copies of every kind; return what differs, by name."""
    random = np.random.default_rng(seed)
    robot = room(folder, kind)
    world, log = robot.world, []
    for _ in range(OPERATIONS):
        operation = CHOICES[random.integers(len(CHOICES))]
        log.append(operation.__name__)
        try:
            operation(robot, random)
        except nuno.NunoError as error:
            log[-1] += f" ({type(error).__name__})"
    saved, futures = world.save(), world.imagine(3)
    world.run(AHEAD)
    futures.run(AHEAD)
    later, wrong = state_of(world, robot), []
    for k, own in enumerate(states_of(futures)):
        wrong += [f"imagined {k}: {name}" for name in differing(own, later)]
    world.restore(saved)
    world.run(AHEAD)
    wrong += [f"restored: {name}" for name in differing(state_of(world, robot), later)]

    # commands by world: each as its own driver carries it out; one is adopted
    world.restore(saved)
    futures = world.imagine(2)
    heights, grasps, effort = random.uniform(0.0, 0.1, 2), random.integers(0, 2, 2), random.uniform(2.0, 40.0)
    send(futures.robot, robot, heights)
    futures.run(AHEAD)
    futures.robot.move_gripper("rarm", grasps, effort)
    futures.run(AHEAD)
    ends = states_of(futures)
    world.adopt(futures, 1)
    wrong += [f"adopted: {name}" for name in differing(state_of(world, robot), ends[1])]
    world.run(0.05)
    futures.run(0.05)
    ends[1] = states_of(futures)[1]
    wrong += [f"adopted, later: {name}" for name in differing(state_of(world, robot), ends[1])]

    # the same as by its driver: what it is told, and what it grips
    world.restore(saved)
    send(robot, robot, heights[0])
    world.run(AHEAD)
    robot.move_gripper("rarm", float(grasps[0]), effort, wait=False)
    world.run(AHEAD)
    wrong += [f"driven: {name}" for name in differing(state_of(world, robot), ends[0])]

    # commands alone: the robot does from the same moment what its copy did
    world.restore(saved)
    world.adopt(futures, 0, only="commands")
    world.run(AHEAD)
    world.run(AHEAD)  # in the same steps, as sums of times are rounded
    wrong += [f"commanded: {name}" for name in differing(state_of(world, robot), ends[0])]
    return [f"seed {seed} after {', '.join(log)}: {each}" for each in wrong]


@pytest.mark.long
@pytest.mark.parametrize("seeds", [range(2), range(2, 5), pytest.param(range(5, 22), marks=pytest.mark.slow)], ids=str)
@pytest.mark.parametrize("kind", ["kinematic", "pressing", "gripping"])
def test_copies_of_random_robots(tmp_path, kind, seeds):
    """Twenty sequences each: imagined, restored, commanded by world and adopted robots, equal now and later.

    Hands of robots that begin with dynamics press with their fingers, or have none and grip.
    """
    assert [each for seed in seeds for each in check(seed, tmp_path, kind)] == []
