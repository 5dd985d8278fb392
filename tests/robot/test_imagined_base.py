"""Walks that begin in imagined worlds: each world its own, with the bits of the robot's own walks."""

import logging

import numpy as np
import pytest

import nuno
from nuno.errors import BodyStateError, InvalidInputError
from nuno.robot import walk_plans
from nuno.robot.goal import GoalStatus
from nuno.robot.robot_model import standing_place

ARM = "arm_left_4_joint"
WAYS = np.array([[0.6, 0.0, 0.0], [0.05, 0.05, 0.1], [-0.1, 0.0, 0.0]])
"""To the wall, which is in the way of the first, and to two places in the open."""


@pytest.fixture(
    scope="module", params=[False, pytest.param(True, marks=pytest.mark.long)], ids=["kinematic", "dynamic"]
)
def scene(request):
    """Talos before a wall, with a towel in its left hand and a cube on the floor, saved."""
    world = nuno.World(device="cpu", substeps=8)
    world.add(nuno.plane(name="floor"))
    world.add(nuno.box((0.1, 3.0, 2.0), name="wall", position=(0.62, 0.0, 1.0)))
    robot = nuno.SimulatedRobot(nuno.Humanoid("talos"), world, dynamics=request.param)
    hand = robot.actual.frame_pose("left_hand").position
    towel = world.add(nuno.sheet((0.1, 0.1), (4, 4), name="towel", position=hand))
    world.attach(towel)
    cube = world.add(nuno.box((0.1,) * 3, name="cube", position=(0.0, 0.6, 0.06)))
    world.attach(cube, nuno.Rigid(mass=0.5))
    world.grip(towel, [0, 1, 2, 3, 4], to=robot.hands["left_hand"].body)
    world.run(0.1)
    return world, robot, world.save()


def state_of(world, state, k=None):
    """All that there is to see of a world and its robot, or of world k of a batch."""
    found = {"q": state.q, "v": state.v, "a": state.a, "collision": np.array(str(state.collision))}
    for body in world.bodies:
        found[body.name] = body.vertices if k is None or body.vertices.ndim == 2 else body.vertices[k]
    return found


def states_of(futures):
    """The same of each world of a batch."""
    return [state_of(futures, state, k) for k, state in enumerate(futures.robot.state())]


def assert_same(found, expected):
    """Nothing differs in a bit."""
    assert [name for name, own in expected.items() if not np.array_equal(found[name], own)] == []


@pytest.mark.long
def test_each_world_has_its_own_walk_to_the_bit(scene):
    """Three walks to their ends, one of them stopped before a wall: as alone, towel in hand and cube too."""
    world, robot, saved = scene
    world.restore(saved)
    futures, seconds = world.imagine(3), 0.6 if robot.is_dynamic else 6.0
    assert futures.robot.go_pos(*WAYS.T).all()
    futures.run(seconds)
    ends = states_of(futures)
    if not robot.is_dynamic:
        first, *others = futures.robot.base_goals()
        assert first.status == GoalStatus.ABORTED and "'wall'" in first.text and "before its goal" in first.text
        assert [own.succeeded for own in others] == [True, True]
        assert [state.collision is None for state in futures.robot.state()] == [False, True, True]
    for k, way in enumerate(WAYS):
        world.restore(saved)
        robot.go_pos(*way, wait=False)
        world.run(seconds)
        assert_same(ends[k], state_of(world, robot.state()))
    assert np.abs(ends[0]["towel"] - ends[1]["towel"]).max() > 1e-4 and ends[0]["towel"][:, 2].min() > 0.4


@pytest.mark.long
def test_walks_change_under_way_beside_other_commands(scene):
    """A velocity, another one, an arm while the robot walks, then a stop: in each world as by the driver."""
    world, robot, saved = scene
    world.restore(saved)
    futures = world.imagine(2)
    speeds = np.array([[0.05, 0.0, 0.0], [0.0, 0.03, 0.1]])
    assert futures.robot.go_velocity(*speeds.T, 2.0).all()
    futures.run(0.3)
    futures.robot.angle_vector({ARM: [-1.0, -1.2]}, 0.3)
    futures.run(0.2)
    assert futures.robot.go_velocity(*-speeds.T, 1.0).all()
    futures.run(0.3)
    futures.robot.go_stop()
    futures.run(0.3)
    futures.robot.go_pos(0.1)  # once it has come to rest
    futures.run(0.1 if robot.is_dynamic else 3.0)
    ends = states_of(futures)
    for k, speed in enumerate(speeds):
        world.restore(saved)
        robot.go_velocity(*speed, 2.0)
        world.run(0.3)
        robot.angle_vector({ARM: (-1.0, -1.2)[k]}, 0.3)
        world.run(0.2)
        robot.go_velocity(*-speed, 1.0)
        world.run(0.3)
        robot.go_stop(force_stop=False)
        world.run(0.3)
        robot.go_pos(0.1, wait=False)
        world.run(0.1 if robot.is_dynamic else 3.0)
        assert_same(ends[k], state_of(world, robot.state()))


@pytest.mark.slow
def test_velocities_that_are_sent_again(scene):
    """As from a joystick: one that ends at the wall, one that changes, one not renewed; landings as by the driver."""
    world, robot, saved = scene
    world.restore(saved)
    futures = world.imagine(3)
    speeds = np.array([[0.12, 0.0, 0.0], [0.0, 0.02, 0.05], [0.05, 0.0, 0.0]])
    pieces = [(0.5, 1.0), (0.5, 1.0)] if robot.is_dynamic else [(0.5, 2.5)] * 5

    def driven(send, run):
        for k, (span, hold) in enumerate(pieces):
            send(k, hold)
            run(span)
        run(0.3 if robot.is_dynamic else 4.0)

    def way(w, k):
        return speeds[w] * (1.0 if k < 3 else -1.0)

    def send(k, hold):
        worlds = [0, 1, 2] if k == 0 else [0, 1]  # the third hears of it once
        assert futures.robot.send_velocity(*np.array([way(w, k) for w in worlds]).T, hold, worlds=worlds).all()

    driven(send, futures.run)
    ends = states_of(futures)
    for w in range(3):
        world.restore(saved)

        def send_alone(k, hold, w=w):
            if w < 2 or k == 0:
                robot.send_velocity(*way(w, k), hold)

        driven(send_alone, world.run)
        assert_same(ends[w], state_of(world, robot.state()))
    assert not np.array_equal(ends[0]["q"], ends[1]["q"]) and not np.array_equal(ends[1]["q"], ends[2]["q"])
    world.restore(saved)
    robot.send_velocity(*speeds[1], 3.0)  # and one under way goes on, to a wall or not
    world.run(0.3)
    again = world.imagine(2)
    again.robot.send_velocity(*speeds[0], 3.0, worlds=1)
    world.adopt(again, 1, only="commands")
    for own in (world, again):
        own.run(0.1 if robot.is_dynamic else 4.0)
    assert_same(states_of(again)[1], state_of(world, robot.state()))


def test_velocities_are_looked_at_alike(still_talos):
    """Before a wall that came while the robot stood, it does not set off, nor do copies; with dynamics all do."""
    world = nuno.World(device="cpu")
    robot = nuno.SimulatedRobot(still_talos, world)
    robot.angle_vector({"head_1_joint": 0.1}, 0.1)
    world.run(0.2)
    world.add(nuno.box((0.1, 3.0, 2.0), name="wall", position=(0.3, 0.0, 1.0)))
    futures = world.imagine(1)
    assert not futures.robot.send_velocity(0.1, 0.0, 0.0).any()
    goal = robot.send_velocity(0.1, 0.0, 0.0)
    assert goal.status == GoalStatus.REJECTED and "'wall'" in goal.text
    assert futures.robot.base_goals()[0].text == goal.text
    dynamic = nuno.SimulatedRobot(nuno.Humanoid("talos"), nuno.World(device="cpu"), dynamics=True)
    dynamic.detach()
    dynamic.world.add(nuno.box((0.1, 3.0, 2.0), name="wall", position=(0.3, 0.0, 1.0)))
    dynamic.angle_vector({"head_1_joint": 0.1}, 0.1)
    dynamic.world.run(0.2)
    dynamic.attach()
    futures = dynamic.world.imagine(1)
    assert futures.robot.send_velocity(0.1, 0.0, 0.0).all()
    assert dynamic.send_velocity(0.1, 0.0, 0.0).status == GoalStatus.ACTIVE


@pytest.mark.long
def test_velocities_are_commands_and_are_adopted(scene):
    """A future whose robot was sent velocities is adopted, as a whole and by its commands alone."""
    world, robot, saved = scene
    world.restore(saved)
    futures = world.imagine(2)
    spans = (0.2, 0.2, 0.2) if robot.is_dynamic else (0.3, 0.3, 2.6)
    futures.run(spans[0])
    futures.robot.send_velocity([0.05, 0.08], 0.0, [0.0, 0.1], 2.0)
    futures.run(spans[1])
    kept, again = futures.save(), futures.imagine(1, world=1)
    futures.robot.send_velocity(0.0, [0.03, 0.02], 0.0, 2.0)
    futures.run(spans[2])
    ends = states_of(futures)
    again.robot.send_velocity(0.0, 0.02, 0.0, 2.0)
    again.run(spans[2])
    assert_same(states_of(again)[0], ends[1])
    world.adopt(futures, 0, only="commands")
    before = world.save()
    for _ in range(2):
        for span in spans:
            world.run(span)
        assert_same(state_of(world, robot.state()), ends[0])
        world.restore(before)
    futures.restore(kept)
    world.adopt(futures, 1)
    robot.send_velocity(0.0, 0.02, 0.0, 2.0)
    world.run(spans[2])
    assert_same(state_of(world, robot.state()), ends[1])


def test_velocities_that_cannot_be_kept(scene, caplog):
    """One faster than the stride allows is refused by world, where the robot stands and where it walks."""
    world, _, saved = scene
    world.restore(saved)
    futures = world.imagine(2)
    with caplog.at_level(logging.WARNING, logger="nuno"):
        assert futures.robot.send_velocity([0.05, 1.0], 0.0, 0.0).tolist() == [True, False]
        assert "did not set off in worlds [1]: " in caplog.text and "at most" in caplog.text
        assert futures.robot.send_velocity(1.0, 0.0, 0.0, worlds=0).tolist() == [False]
    assert all(goal.status == GoalStatus.REJECTED for goal in futures.robot.base_goals())
    futures.run(0.1)
    assert [own.gait.is_walking for own in futures.robot._motions] == [True, False]
    for bad in ((0.1, 0.0, np.nan), ([0.1] * 3, 0.0, 0.0), (0.1, 0.0, 0.0, 0.0)):
        with pytest.raises(InvalidInputError):
            futures.robot.send_velocity(*bad)


@pytest.mark.long
def test_walks_are_saved_imagined_and_adopted(scene):
    """A batch goes back with its walks; copies of a copy and the robot that adopts one go on with the same bits."""
    world, robot, saved = scene
    world.restore(saved)
    futures = world.imagine(2)
    futures.robot.go_pos([0.1, -0.1], 0.0, [0.0, 0.2])
    futures.run(0.3)
    kept, again = futures.save(), futures.imagine(1, world=1)
    futures.run(0.3)
    later = states_of(futures)
    futures.restore(kept)
    assert [goal.status for goal in futures.robot.base_goals()] == [GoalStatus.ACTIVE] * 2
    world.adopt(futures, 1)
    assert robot.gait.is_walking
    for own in (futures, again, world):
        own.run(0.3)
    for found, expected in zip(states_of(futures), later, strict=True):
        assert_same(found, expected)
    assert_same(states_of(again)[0], later[1])
    assert_same(state_of(world, robot.state()), later[1])
    robot.go_stop()
    assert not robot.gait.is_walking  # it waited for the walk that it took over


@pytest.mark.long
def test_commands_of_a_future_include_its_walks(scene):
    """A walk after a while, an arm meanwhile, legs and a second walk after it: the robot does so from now on."""
    world, robot, saved = scene
    world.restore(saved)
    futures = world.imagine(2)
    futures.run(0.1)
    futures.robot.go_pos([0.0, 0.05], [0.0, 0.0], [0.2, 0.0])
    futures.run(0.1)
    futures.robot.angle_vector({ARM: [-1.0, -1.2]}, 0.3)
    if not robot.is_dynamic:
        futures.run(5.0)
        knees = {f"leg_{side}_{k}_joint": [v, 0.9 * v] for side in ("left", "right") for k, v in
                 ((3, -0.5), (4, 0.95), (5, -0.45))}  # fmt: skip
        futures.robot.angle_vector(knees, 0.5)
        futures.run(1.0)
        futures.robot.go_pos(0.05)
    futures.run(0.3)
    ends = states_of(futures)
    spans = (0.1, 0.1, 0.3) if robot.is_dynamic else (0.1, 0.1, 5.0, 1.0, 0.3)  # as above: sums of times are rounded
    world.adopt(futures, 1, only="commands")
    kept = world.save()
    for _ in range(2):  # and from a snapshot in which they are to come
        for span in spans:
            world.run(span)
        assert_same(state_of(world, robot.state()), ends[1])
        world.restore(kept)
    copies = world.imagine(1)  # and in copies that were imagined before they began
    for span in spans:
        copies.run(span)
    assert_same(states_of(copies)[0], ends[1])
    robot.go_stop(force_stop=False)  # what the robot is told is told in place of what was to come
    assert not robot.gait.awaits


@pytest.mark.long
def test_commands_begin_later_too(scene):
    """Some time after, the robot goes as far as in the future, from where it is then."""
    world, robot, saved = scene
    world.restore(saved)
    futures = world.imagine(1)
    futures.run(0.1)
    futures.robot.go_pos(0.0, 0.0, 0.2)
    futures.run(0.1)
    world.run(0.5)
    world.adopt(futures, 0, only="commands")
    before = standing_place(robot.wanted)
    world.run(0.05)
    assert not robot.gait.is_walking
    robot.wait_until(lambda: robot.gait.is_walking, timeout=0.1)
    robot.wait_until(lambda: not robot.gait.is_walking)
    np.testing.assert_allclose(np.subtract(standing_place(robot.wanted), before), (0.0, 0.0, 0.2), atol=2e-3)


def test_worlds_are_named(scene, caplog):
    """Some copies go, by indices or by a mask; who cannot is told with the reason, and the others go."""
    world, robot, saved = scene
    world.restore(saved)
    futures = world.imagine(4)
    with caplog.at_level(logging.WARNING, logger="nuno"):
        went = futures.robot.go_pos([0.1, 50.0], worlds=[3, 1])
    assert went.tolist() == [True, False]
    assert "did not set off in worlds [1]: a walk has at most 100 steps" in caplog.text
    assert [goal is None for goal in futures.robot.base_goals()] == [True, False, True, False]
    assert "100 steps" in futures.robot.base_goals()[1].text
    futures.robot.go_velocity(0.0, 0.02, worlds=np.array([True, False, False, False]))
    futures.run(0.3)
    moved = [state.v.any() for state in futures.robot.state()]
    assert moved == [True, robot.is_dynamic, robot.is_dynamic, True]
    futures.robot.go_stop(worlds=0)
    goals = futures.robot.base_goals()
    assert goals[0].status == GoalStatus.PREEMPTING and goals[3].status == GoalStatus.ACTIVE


def test_legs_are_the_walks(scene, caplog):
    """What is asked of the legs of a copy that walks is told once, by world; its head and those that stand go."""
    world, _, saved = scene
    world.restore(saved)
    futures = world.imagine(2)
    futures.robot.go_pos(0.1, worlds=1)
    futures.run(0.05)
    with caplog.at_level(logging.WARNING, logger="nuno"):
        futures.robot.angle_vector({"head_1_joint": 0.1}, 0.3)
        assert "legs" not in caplog.text
        futures.robot.angle_vector({"head_1_joint": 0.1, "leg_left_4_joint": 0.9}, 0.3)
    assert "walks in worlds [1]: its legs are the walk's" in caplog.text
    controllers = [own.joints.controllers["lleg_controller"] for own in futures.robot._motions]
    assert [own.is_busy for own in controllers] == [True, False]


def test_equal_walks_are_planned_once(scene, monkeypatch):
    """Of six copies that are to go to two places two walks are planned, and two by which they come to rest."""
    world, _, saved = scene
    world.restore(saved)
    calls = []
    for name in ("plan_walk", "stop_walk"):
        real = getattr(walk_plans, name)
        monkeypatch.setattr(walk_plans, name, lambda *a, real=real, name=name, **b: calls.append(name) or real(*a, **b))
    futures = world.imagine(6)
    futures.robot.go_pos([0.07, 0.08] * 3)
    assert calls == ["plan_walk"] * 2
    futures.run(0.1)
    futures.robot.go_stop()
    assert calls == ["plan_walk"] * 2 + ["stop_walk"] * 2


def test_bad_walks_are_named(scene):
    """Another number of places, worlds that there are not, no numbers, no time: nothing has set off."""
    world, _, saved = scene
    world.restore(saved)
    futures = world.imagine(2)
    own = futures.robot
    for call, named in (
        (lambda: own.go_pos([0.1, 0.1, 0.1]), "x"),
        (lambda: own.go_pos(0.1, [0.1, np.nan]), "y"),
        (lambda: own.go_pos(0.1, worlds=2), "worlds"),
        (lambda: own.go_pos(0.1, worlds=[True]), "worlds"),
        (lambda: own.go_pos([0.1, 0.2], worlds=[1]), "x"),
        (lambda: own.go_velocity(0.1, sec=0.0), "sec"),
        (lambda: own.go_stop(worlds=[0, 0]), "worlds"),
    ):
        with pytest.raises(InvalidInputError, match=named):
            call()
    assert own.base_goals() == (None, None)
    futures.remove(futures.find(own.original.links.bodies[3].name))
    with pytest.raises(BodyStateError, match="lack links"):
        own.go_pos(0.1)
