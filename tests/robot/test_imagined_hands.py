"""Hands in imagined worlds: they close, hold and let go in each world by itself, with the bits of the robot alone."""

import numpy as np
import pytest
from lifter import assert_all_become, assert_same, lifter_in

import nuno
from nuno.errors import InvalidInputError, UnknownNameError
from nuno.joints.held_points import held_points
from nuno.robot.goal import GoalStatus
from nuno.robot.hand_copies import _together
from nuno.shapes.surface import SurfacePoints

LIFTS = np.array([0.0, 0.005, 0.06, -0.012, 0.15])
"""[m] From where the hand closes in each world: on other vertices, on one of two bodies, or on nothing."""
HAND = "right_hand"


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    """A lifter before a cloth that hangs aslant at its corners through its fingers, and a cube there; saved."""
    world = nuno.World(device="cpu", substeps=20)
    robot = lifter_in(tmp_path_factory.mktemp("lifter"), world)
    world.add(nuno.box((1.0, 1.0, 0.1), name="table", position=(0.0, 0.0, 0.85)))
    world.add(nuno.box((0.03, 0.05, 0.08), name="pedestal", position=(0.0, 0.0, 0.94)))
    towel = world.add(nuno.sheet((0.1, 0.1), (8, 8), name="towel", position=(0.055, 0.0, 1.03)))
    towel.rotate(0.35, "x")
    world.attach(towel, nuno.Cloth(area_density=0.3, damping=0.02, air_drag=5.0))
    corners = [0, 8, 72, 80]
    world.grip(towel, corners, to=towel.vertices[corners].mean(axis=0), compliance=1e-3)
    for link in robot.links.bodies:
        world.ignore_contact(link, towel)
    cube = world.add(nuno.box((0.03, 0.05, 0.03), name="cube", position=(0.0, 0.0, 0.996)))
    world.attach(cube, nuno.Rigid(mass=0.1, friction=0.5))
    world.run(0.3)
    return world, robot, world.save()


def state_of(world, state, k=None):
    """All that there is to see of a world and its robot, or of world k of a batch."""
    found = {"q": state.q, "v": state.v}
    for body in world.bodies:
        found[body.name] = body.vertices if k is None or body.vertices.ndim == 2 else body.vertices[k]
        if body.is_dynamic:
            speeds = body.velocities
            found[f"{body.name} moves"] = speeds if k is None or speeds.ndim == 2 else speeds[k]
    return found


def states_of(futures):
    """The same of each world of a batch, and what the wrist feels there."""
    wrenches = futures.robot.read().wrenches["right_wrist"]
    found = [state_of(futures, state, k) for k, state in enumerate(futures.robot.state())]
    return [own | {"wrist": wrench} for own, wrench in zip(found, wrenches, strict=True)]


def alone(world, robot):
    """The same of the robot's own world."""
    return state_of(world, robot.state()) | {"wrist": np.concatenate(robot.read_wrench("right_wrist"))}


def names_of(held, k):
    """The bodies that are held in world k."""
    return {name for name, worlds in held.items() if worlds[k]}


def test_each_world_holds_its_own(scene):
    """Hands close at five heights, lift, and open in three: each as the robot's, what its wrist feels too."""
    world, robot, saved = scene
    world.restore(saved)
    futures = world.imagine(len(LIFTS))
    futures.robot.angle_vector({"lift": LIFTS}, 0.1)
    futures.run(0.2)
    assert futures.robot.start_grasp("rarm") == []
    futures.run(0.4)
    hand, ends = futures.robot.hands[HAND], [states_of(futures)]
    assert hand.holds.tolist() == [True, True, True, True, False]
    assert {name: own.tolist() for name, own in hand.held.items()} == {
        "towel": [True, True, True, False, False], "cube": [True, True, False, True, False]
    }  # fmt: skip
    points = [held_points(hand.copies[k].grips[0], k) for k in range(3)]
    assert len({own[:, 0].tobytes() for own in points}) == 3  # others in each
    held = [names_of(hand.held, k) for k in range(len(LIFTS))]
    futures.robot.angle_vector({"lift": LIFTS + 0.1}, 0.3)
    futures.run(0.4)
    ends.append(states_of(futures))
    assert len(futures.robot.stop_grasp("rarm", worlds=[0, 2, 3])) == 0
    futures.run(0.1)
    ends.append(states_of(futures))
    futures.run(0.3)
    ends.append(states_of(futures))
    assert hand.holds.tolist() == [False, True, False, False, False]
    for k, lift in enumerate(LIFTS):
        world.restore(saved)
        robot.angle_vector({"lift": lift}, 0.1)
        world.run(0.2)
        robot.start_grasp("rarm", wait=False)
        world.run(0.4)
        assert {body.name for body in robot.hands[HAND].held} == held[k]
        found = [alone(world, robot)]
        robot.angle_vector({"lift": lift + 0.1}, 0.3)
        world.run(0.4)
        found.append(alone(world, robot))
        if k in (0, 2, 3):
            robot.stop_grasp("rarm", wait=False)
        world.run(0.1)
        found.append(alone(world, robot))
        world.run(0.3)
        found.append(alone(world, robot))
        for own, expected in zip(ends, found, strict=True):
            assert_same(own[k], expected)
    assert ends[2][1]["cube"][:, 2].min() > 1.05 and ends[2][2]["cube"][:, 2].max() < 1.02  # lifted, and left there


def test_a_hand_that_closes_goes_on_closing(scene):
    """Under way when it is imagined, told otherwise in one world, opened by a vector of joints in another."""
    world, robot, saved = scene
    world.restore(saved)
    robot.start_grasp("rarm", wait=False)
    world.run(0.05)
    goal, futures, between = robot.grippers[HAND].goal, world.imagine(3), world.save()
    futures.robot.stop_grasp("rarm", worlds=1)
    futures.run(0.35)
    assert goal.status == GoalStatus.ACTIVE  # copies have their own
    assert futures.robot.hands[HAND].holds.tolist() == [True, False, True]
    open_wide = np.array(futures.robot.angle_vector())
    open_wide[2, robot.actual.joint_index("turn")] = 0.0
    futures.robot.angle_vector(open_wide, 0.2)
    futures.run(0.5)
    ends = states_of(futures)
    assert futures.robot.hands[HAND].holds.tolist() == [True, False, False]
    for k in range(3):
        world.restore(between)
        if k == 1:
            robot.stop_grasp("rarm", wait=False)
        world.run(0.35)
        robot.angle_vector(open_wide[k], 0.2)
        world.run(0.5)
        assert_same(ends[k], alone(world, robot))


def test_hands_close_at_other_times(scene):
    """One hand closes while another holds and a third opens again: what comes of one changes no other."""
    world, robot, saved = scene
    world.restore(saved)
    futures = world.imagine(3)
    order = [0, 2, 1, 0]  # which closes; the last time it opens
    for k, w in enumerate(order):
        futures.robot.move_gripper("rarm", float(k == 3), worlds=w)
        futures.run(0.1)
        futures.robot.angle_vector({"lift": [0.02, 0.05, 0.03]}, 0.1)
        futures.run(0.1)
    ends = states_of(futures)
    for w in range(3):
        world.restore(saved)
        for k, other in enumerate(order):
            if other == w:
                robot.move_gripper("rarm", float(k == 3), wait=False)
            world.run(0.1)
            robot.angle_vector({"lift": (0.02, 0.05, 0.03)[w]}, 0.1)
            world.run(0.1)
        assert_same(ends[w], alone(world, robot))


def test_what_is_held_is_saved_imagined_and_adopted(scene):
    """A batch goes back with what its hands hold; copies of a copy and the robot that adopts one go on alike."""
    world, robot, saved = scene
    world.restore(saved)
    futures = world.imagine(3)
    futures.robot.angle_vector({"lift": LIFTS[[1, 4, 3]]}, 0.1)
    futures.run(0.1)
    told = futures.robot.start_grasp("rarm", wait=True)
    assert [own.tolist() for own in told] == [[True, False, True]]
    kept, again = futures.save(), futures.imagine(2, world=2)

    def go_on(own, copies):
        (copies or robot).angle_vector({"lift": 0.1}, 0.3)
        own.run(0.2)
        robot.stop_grasp("rarm", wait=False) if copies is None else copies.stop_grasp("rarm")
        own.run(0.3)

    go_on(futures, futures.robot)
    ends = states_of(futures)
    assert not futures.robot.hands[HAND].held
    go_on(again, again.robot)
    for own in states_of(again):
        assert_same(own, ends[2])
    for k in range(3):
        futures.restore(kept)
        assert futures.robot.hands[HAND].holds.tolist() == [True, False, True]
        world.restore(saved)
        before = robot.grippers[HAND].goal
        world.adopt(futures, k)
        assert before is None or before.is_done
        assert {body.name for body in robot.hands[HAND].held} == names_of(futures.robot.hands[HAND].held, k)
        assert robot.grippers[HAND].goal.holds is (k != 1)
        assert all(grip.active for body in ("towel", "cube") for grip in world.find(body)._dynamics.grips)
        assert len(world.find("cube")._dynamics.grips) == (k != 1)
        go_on(world, None)
        assert_same(alone(world, robot), ends[k])
        assert not robot.hands[HAND].held


def test_commands_of_a_future_include_its_hands(scene):
    """Closed after a while, lifted, and opened again: the robot does so, from a snapshot and imagined, too."""
    world, robot, saved = scene
    world.restore(saved)
    futures, spans = world.imagine(2), (0.05, 0.4, 0.3, 0.3)
    futures.run(spans[0])
    futures.robot.start_grasp("rarm")
    futures.run(spans[1])
    futures.robot.angle_vector({"lift": [0.1, 0.05]}, 0.2)
    futures.run(spans[2])
    futures.robot.stop_grasp("rarm", worlds=[0])
    futures.run(spans[3])
    ends = states_of(futures)
    for k in range(2):
        world.restore(saved)
        world.adopt(futures, k, only="commands")
        assert_all_become(world, spans, ends[k], alone, states_of)
        assert [body.name for body in robot.hands[HAND].held] == [[], ["towel", "cube"]][k]
    world.restore(saved)
    world.adopt(futures, 0, only="commands")
    robot.stop_grasp("rarm", wait=False)  # told in place of what was to come
    world.run(0.6)
    assert not robot.hands[HAND].held and robot.hands[HAND].width == 0.08


def test_hands_go_on_with_commands_later(scene):
    """Some time after, and where the hand has been told otherwise since: it closes as far after now as it did there."""
    world, robot, saved = scene
    world.restore(saved)
    robot.start_grasp("rarm", wait=False)
    world.run(0.05)
    futures = world.imagine(1)
    futures.run(0.2)
    robot.stop_grasp("rarm", wait=True)
    world.adopt(futures, 0, only="commands")
    world.run(0.5)
    assert robot.hands[HAND].held and robot.grippers[HAND].goal.holds


def test_points_of_faces_and_vertices_are_apart():
    """Few grips take what many worlds hold: one of all vertices, one of points on faces, one of those at vertices."""
    face = np.array([0.2, 0.3, 0.5])
    taken = {
        0: np.array([3, 4]), 2: np.array([7]), 1: SurfacePoints(np.array([5]), face[None]),
        4: SurfacePoints(np.array([6]), np.array([[1.0, 0.0, 0.0]])),
    }  # fmt: skip
    (vertices, of_vertices), (points, of_points), (corner, of_corner) = _together(taken, 5)
    assert vertices.tolist() == [[3, 4], [-1, -1], [7, -1], [-1, -1], [-1, -1]]
    assert of_vertices.tolist() == [True, False, True, False, False]
    assert points.faces.tolist() == [[-1], [5], [-1], [-1], [-1]] and of_points.tolist() == [False, True, *[False] * 3]
    assert not (points.barycentric[:, 0, 0] == 1.0).any()  # held as points in all worlds
    assert corner.faces[4, 0] == 6 and (corner.barycentric[:, 0, 0] == 1.0).all() and of_corner.tolist()[4]
    ((where, worlds),) = _together({1: None}, 2)
    assert where is None and worlds.tolist() == [False, True]


@pytest.mark.parametrize("cells", [1, 6])
def test_coarse_cloth_and_soft_bodies_are_held_alike(tmp_path, cells):
    """Points of faces, where no vertex is between the fingers, and vertices of a soft cube: as alone."""
    world = nuno.World(device="cpu", substeps=10, gravity=(0.0, 0.0, 0.0))
    robot = lifter_in(tmp_path, world)
    if cells == 1:
        body = world.add(nuno.sheet((0.3, 0.3), (2, 2), name="own", position=(0.05, 0.06, 1.0)))
        world.attach(body, nuno.Cloth(area_density=0.3, damping=0.02, air_drag=5.0))
    else:
        body = world.add(nuno.soft_box((0.06, 0.06, 0.03), (3, 3, 2), name="own", position=(0.03, 0.0, 1.0)))
        world.attach(body, nuno.Soft(youngs_modulus=2e5))
    for link in robot.links.bodies:
        world.ignore_contact(link, body)
    for _ in range(2):
        saved, futures = world.save(), world.imagine(3)
        futures.robot.angle_vector({"lift": [0.0, 0.002, 0.08]}, 0.02)
        futures.robot.start_grasp("rarm", worlds=[0, 1, 2])
        futures.run(0.4)
        ends = states_of(futures)
        for k, lift in enumerate((0.0, 0.002, 0.08)):
            world.restore(saved)
            robot.angle_vector({"lift": lift}, 0.02)
            robot.start_grasp("rarm", wait=False)
            world.run(0.4)
            assert_same(ends[k], alone(world, robot))
        world.restore(saved)
        world.run(0.01)
    assert futures.robot.hands[HAND].holds.any()


def test_bad_grasps_are_named(scene):
    """Another arm, a hand that there is not, positions and worlds beyond: nothing was told to any hand."""
    world, _, saved = scene
    world.restore(saved)
    futures = world.imagine(2)
    own = futures.robot
    for call, error in (
        (lambda: own.start_grasp("leg"), UnknownNameError),
        (lambda: own.start_grasp("larm"), UnknownNameError),
        (lambda: own.move_gripper("rarm", 1.5), InvalidInputError),
        (lambda: own.move_gripper("rarm", [0.0, 0.5, 1.0]), InvalidInputError),
        (lambda: own.start_grasp("rarm", worlds=2), InvalidInputError),
        (lambda: own.start_grasp("rarm", effort=0.0), InvalidInputError),
    ):
        with pytest.raises(error):
            call()
    assert all(gripper.goal is None for gripper in own._grippers[HAND])
    assert own.start_grasp(worlds=[1]) == [] and "holds something in 0" in repr(own.hands[HAND])
