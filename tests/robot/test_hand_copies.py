"""Hands of robots with dynamics in imagined worlds: they press or grip in each world by itself, as the robot's own."""

import numpy as np
import pytest
from lifter import assert_all_become, assert_same, lifter_in

import nuno
from nuno.errors import BodyStateError
from nuno.robot.goal import GoalStatus
from nuno.robot.hands import width_at

HAND = "right_hand"
BETWEEN, ASIDE = (0.0, 0.0, 0.976), (0.5, 0.0, 0.976)  # [m] where the cube stands between the fingers, or beside
PLACES = np.array([BETWEEN, ASIDE, ASIDE, BETWEEN])
LIFTS = np.array([0.0, 0.0, 0.12, 0.0])
"""[m] The third hand closes above all."""
EFFORTS = (40.0, 25.0, 25.0, 2.0)
"""[N] The last presses too little to lift the cube, by 2 sqrt(0.8 0.5) 2 N = 2.5 N of its 4.9 N."""
MASS = 0.5


@pytest.fixture(scope="module", params=["pressing", "gripping"])
def scene(request, tmp_path_factory):
    """A lifter with dynamics; a cloth hangs at two corners between its fingers, a cube stands there; saved."""
    world = nuno.World(device="cpu", substeps=20)
    folder = tmp_path_factory.mktemp("lifter")
    robot = lifter_in(folder, world, dynamics=True, fingers=request.param == "pressing")
    for name, place in (("pedestal", BETWEEN), ("table", ASIDE)):
        world.add(nuno.box((0.02, 0.02, 0.04), name=name, position=(*place[:2], 0.941)))
    towel = world.add(nuno.sheet((0.08, 0.08), (6, 6), name="towel", position=(0.03, 0.0, 1.045)))
    towel.rotate(np.pi / 2, "x")
    world.attach(towel, nuno.Cloth(area_density=0.3, damping=0.02, air_drag=5.0))
    top = np.argsort(towel.vertices[:, 2])[-7:]
    world.grip(towel, [int(top.min()), int(top.max())], to=towel.vertices[top].mean(axis=0), compliance=1e-3)
    cube = world.add(nuno.box((0.03,) * 3, name="cube", position=BETWEEN))
    world.attach(cube, nuno.Rigid(mass=MASS, friction=0.5))
    world.run(0.2)
    return world, robot, world.save()


def states_of(futures):
    """All that there is to see of each world of a batch: bodies, robot, what its wrist feels, its hand and its goal."""
    wrists, hand = futures.robot.read().wrenches["right_wrist"], futures.robot.hands[HAND]
    found = []
    for k, state in enumerate(futures.robot.state()):
        own = {"q": state.q, "v": state.v, "wrist": wrists[k]}
        for body in futures.bodies:
            own[body.name] = body.vertices if body.vertices.ndim == 2 else body.vertices[k]
        own["held"] = {name for name, worlds in hand.held.items() if worlds[k]}
        goal = futures.robot._grippers[HAND][k].goal
        found.append(own | {"goal": None if goal is None else (goal.status, goal.holds)})
    return found


def alone(world, robot):
    """The same of the robot's own world."""
    state, goal = robot.state(), robot.grippers[HAND].goal
    found = {"q": state.q, "v": state.v, "wrist": np.concatenate(robot.read_wrench("right_wrist"))}
    found |= {body.name: body.vertices for body in world.bodies}
    found["held"] = {body.name for body in robot.hands[HAND].held}
    return found | {"goal": None if goal is None else (goal.status, goal.holds)}


def begin(scene):
    """Return the world as it was saved, its robot, and futures with the cube here and there, and hands at heights."""
    world, robot, saved = scene
    world.restore(saved)
    futures = world.imagine(len(PLACES))
    futures.set_pose("cube", PLACES)
    futures.robot.angle_vector({"lift": LIFTS}, 0.1)
    futures.run(0.2)
    return world, robot, futures


def begin_alone(scene, k):
    """Let the robot and its own world do the same."""
    world, robot, saved = scene
    world.restore(saved)
    world.set_pose("cube", PLACES[k])
    robot.angle_vector({"lift": LIFTS[k]}, 0.1)
    world.run(0.2)


def close(futures):
    """Close hands, each with its effort."""
    for k, effort in enumerate(EFFORTS):
        futures.robot.start_grasp("rarm", effort=effort, worlds=k)
    futures.run(0.4)


def close_alone(world, robot, k):
    """Close the robot's own."""
    robot.start_grasp("rarm", effort=EFFORTS[k], wait=False)
    world.run(0.4)


@pytest.mark.long
def test_each_world_holds_its_own(scene):
    """A cube, a cloth, nothing, a cube too loosely; lifted; let go by command and by a vector: each as the robot's."""
    presses = scene[1].hands[HAND].presses
    world, robot, futures = begin(scene)
    close(futures)
    ends = [states_of(futures)]
    held = [own["held"] for own in ends[0]]
    assert "cube" in held[0] & held[3] and held[1] == {"towel"} and not held[2]
    futures.robot.angle_vector({"lift": LIFTS + 0.04}, 0.2)
    futures.run(0.3)
    ends.append(states_of(futures))
    heights = np.array([own["cube"][:, 2].mean() for own in ends[1]]) - BETWEEN[2]
    assert heights[0] > 0.035 and (heights[3] < 0.01) == presses
    turns = np.array(futures.robot.angle_vector())[:, robot.actual.joint_index("turn")]
    turns[0] = 0.0
    futures.robot.angle_vector({"turn": turns}, 0.1)
    futures.run(0.2)
    ends.append(states_of(futures))
    futures.robot.stop_grasp("rarm", worlds=[1])
    futures.run(0.3)
    ends.append(states_of(futures))
    assert not ends[3][0]["held"] and not ends[3][1]["held"]
    for k, lift in enumerate(LIFTS):
        begin_alone(scene, k)
        close_alone(world, robot, k)
        assert_same(ends[0][k], alone(world, robot))
        robot.angle_vector({"lift": lift + 0.04}, 0.2)
        world.run(0.3)
        assert_same(ends[1][k], alone(world, robot))
        robot.angle_vector({"turn": turns[k]}, 0.1)
        world.run(0.2)
        assert_same(ends[2][k], alone(world, robot))
        if k == 1:
            robot.stop_grasp("rarm", wait=False)
        world.run(0.3)
        assert_same(ends[3][k], alone(world, robot))


@pytest.mark.long
def test_what_is_held_is_saved_imagined_and_adopted(scene):
    """A batch goes back with what its hands hold; copies of a copy and the robot that adopts one go on alike."""
    world, robot, futures = begin(scene)
    between = world.save()
    close(futures)
    kept, copies = futures.save(), [futures.imagine(1, world=k) for k in range(len(LIFTS))]
    was = [own["held"] for own in states_of(futures)]

    def go_on(own, hands):
        hands.angle_vector({"lift": 0.05}, 0.2)
        own.run(0.3)

    go_on(futures, futures.robot)
    ends = states_of(futures)
    for k, again in enumerate(copies):
        go_on(again, again.robot)
        assert_same(states_of(again)[0], ends[k])
        futures.restore(kept)
        world.restore(between)
        robot.stop_grasp("rarm", wait=False)
        told = robot.grippers[HAND].goal
        world.adopt(futures, k)
        assert told.status == GoalStatus.PREEMPTED and robot.grippers[HAND].goal.is_done
        assert {body.name for body in robot.hands[HAND].held} == was[k]
        go_on(world, robot)
        assert_same(alone(world, robot), ends[k])
    go_on(futures, futures.robot)
    for own, expected in zip(states_of(futures), ends, strict=True):
        assert_same(own, expected)


@pytest.mark.long
def test_copies_of_a_copy_go_on_whatever_the_robot_has_become(scene):
    """Copies with dynamics of one whose robot was detached since, and the other way round, hands and all: as that one.

    The robot that adopts one is of its kind again.
    """
    world, robot, futures = begin(scene)
    close(futures)
    robot.detach()
    kinematic = world.imagine(1)
    again = futures.imagine(1, world=0)
    robot.attach()
    others = kinematic.imagine(1)
    kinematic.robot.start_grasp("rarm")
    others.robot.start_grasp("rarm")
    for own in (kinematic, others):
        own.run(0.3)
    for own in (futures, again, kinematic, others):
        own.robot.angle_vector({"lift": 0.05}, 0.2)
        own.run(0.4)
    ends = states_of(futures)
    assert_same(states_of(again)[0], ends[0])
    assert_same(states_of(others)[0], states_of(kinematic)[0])
    world.adopt(kinematic, 0)
    assert not robot.is_dynamic and robot.grippers[HAND].goal.holds
    world.adopt(again, 0)
    assert robot.is_dynamic
    assert_same(alone(world, robot) | {"wrist": ends[0]["wrist"]}, ends[0])


@pytest.mark.long
def test_commands_of_a_future_include_its_hands(scene):
    """Closed after a while and lifted: the robot does so, from a snapshot and imagined, too; a goal since then ends."""
    world, robot, saved = scene
    world.restore(saved)
    futures, spans = world.imagine(2), (0.05, 0.4, 0.3)
    futures.run(spans[0])
    futures.robot.start_grasp("rarm", effort=40.0)
    futures.run(spans[1])
    futures.robot.angle_vector({"lift": [0.05, 0.03]}, 0.2)
    futures.run(spans[2])
    ends = states_of(futures)
    for k in range(2):
        world.restore(saved)
        robot.move_gripper("rarm", 0.9, wait=False)  # in whose place comes what the copy's did
        told = robot.grippers[HAND].goal
        world.adopt(futures, k, only="commands")
        assert told.status == GoalStatus.PREEMPTED
        assert_all_become(world, spans, ends[k], alone, states_of)
        assert "cube" in ends[k]["held"]


@pytest.mark.long
def test_a_goal_since_then_ends_with_commands_adopted_later(scene):
    """The hand was told something since the futures were imagined, and time passed: that ends, as trajectories do."""
    world, robot, saved = scene
    world.restore(saved)
    futures = world.imagine(1)
    robot.start_grasp("rarm", wait=False)
    world.run(0.05)
    told = robot.grippers[HAND].goal
    assert told.status == GoalStatus.ACTIVE
    world.adopt(futures, 0, only="commands")
    assert told.status == GoalStatus.PREEMPTED
    turn = robot.read_reference().positions[robot.actual.joint_index("turn")]
    world.run(0.5)
    assert robot.hands[HAND].width == pytest.approx(width_at(robot.hands[HAND].description, turn), abs=1e-4)


@pytest.mark.long
def test_what_one_copy_carries_loads_no_other():
    """A G1 that balances takes a cube in one world of two, and leans against its weight there alone: as by itself."""
    world = nuno.World(device="cpu")
    world.add(nuno.plane(name="floor"))
    robot = nuno.SimulatedRobot(nuno.Humanoid("g1"), world, dynamics=True)
    place = robot.actual.frame_pose("left_hand").position + np.array([0.0, 0.0, 0.02])
    cube = world.add(nuno.box((0.04,) * 3, name="cube", position=place))
    world.attach(cube, nuno.Rigid(mass=0.3))
    for link in robot.links.bodies:
        world.ignore_contact(link, cube)
    stand = world.grip(cube, to=place)
    world.run(0.1)
    saved, futures = world.save(), world.imagine(2)
    futures.robot.start_grasp("larm", worlds=[1])
    futures.run(0.1)
    copy = next(grip for grip in futures.find("cube")._dynamics.grips if grip.target is None)
    copy.release()
    futures.run(0.3)
    states = futures.robot.state()
    assert futures.robot.hands["left_hand"].holds.tolist() == [False, True]
    assert states[0].loads is None and states[1].loads is not None
    for k in range(2):
        world.restore(saved)
        if k == 1:
            robot.start_grasp("larm", wait=False)
        world.run(0.1)
        stand.release()
        world.run(0.3)
        found, own = robot.state(), states[k]
        assert np.array_equal(found.q, own.q) and np.array_equal(found.v, own.v)
        assert found.loads is own.loads or np.array_equal(found.loads, own.loads)
        assert np.array_equal(cube.vertices, futures.find("cube").vertices[k])


@pytest.mark.long
def test_another_engine_takes_commands_of_hands_that_press(tmp_path, caplog):
    """On MuJoCo: hands that press close by world, as the robot's; of those that grip it is told by name, once."""
    pytest.importorskip("mujoco", minversion="4.0")
    world = nuno.World(device="cpu", engine="mujoco")
    robot = lifter_in(tmp_path, world, dynamics=True)
    cube = world.add(nuno.box((0.05,) * 3, name="cube", position=(0.0, 0.0, 1.0)))
    world.attach(cube, nuno.Rigid(mass=0.5, friction=0.5))
    world.grip(cube, to=cube.position)
    saved, futures = world.save(), world.imagine(2)
    futures.robot.start_grasp("rarm", effort=15.0, worlds=[1])
    futures.run(0.4)
    ends = states_of(futures)
    assert [own["held"] for own in ends] == [set(), {"cube"}]
    for k in range(2):
        world.restore(saved)
        if k == 1:
            robot.start_grasp("rarm", effort=15.0, wait=False)
        world.run(0.4)
        assert_same(ends[k], alone(world, robot))
    robot = lifter_in(tmp_path, nuno.World(device="cpu", engine="mujoco"), dynamics=True, fingers=False)
    futures = robot.world.imagine(2)
    with pytest.raises(BodyStateError, match="another engine than Nuno's own"):
        futures.robot.start_grasp("rarm")
    assert not futures.robot.hands and "closes" not in caplog.text
    robot.start_grasp("rarm", wait=False)
    futures = robot.world.imagine(1)
    assert caplog.text.count("right_hand of 'lifter' closes: its copies' fingers go on, but grip nothing") == 1
    futures.run(0.1)
    robot.world.adopt(futures, 0)  # it goes on closing, and may grip then
    assert robot.grippers[HAND].goal.status == GoalStatus.ACTIVE
    robot.world.run(0.4)
    assert robot.grippers[HAND].goal.succeeded and robot.hands[HAND].width == pytest.approx(0.0, abs=1e-3)
