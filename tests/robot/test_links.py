"""Links in a world: where they are, what they carry, and that they leave as they came."""

import numpy as np
import pytest

import nuno
from nuno.errors import BodyStateError, InvalidInputError
from nuno.robot.hands import Hand
from nuno.robot.sensors import Sensors


@pytest.fixture
def room(talos):
    """Return a world with Talos in it, the robot, and its links."""
    world = nuno.World(device="cpu")
    return world, talos, talos.enter(world)


def test_bodies_are_where_the_links_are(room):
    """Every vertex as the link's pose and the shape's place in it put it; the soles stand on the floor."""
    world, talos, links = room
    assert {body.name for body in world.bodies} >= {"talos/head_2_link", "talos/gripper_right_fingertip_1_link"}
    lowest = min(body.vertices[:, 2].min() for body in links.bodies)
    assert abs(lowest) < 2e-3  # [m] Talos' posture tilts its soles by 3 mrad over 0.1 m, and the mesh is 0.4 mm deep
    head = world.find("talos/head_2_link")
    before = talos.frame_pose("head_2_link").to_local(head.vertices)
    talos.angle_vector({"head_1_joint": 0.3, "torso_1_joint": -0.5})
    links.follow(0.0)
    np.testing.assert_allclose(talos.frame_pose("head_2_link").to_local(head.vertices), before, atol=1e-12)


def test_bodies_get_there_in_time(room):
    """Halfway after half the time, there after all of it, and they stay until they are asked again."""
    world, talos, links = room
    hand = world.find("talos/gripper_left_fingertip_1_link")
    start = hand.position
    talos.translate((0.1, 0, 0), wrt="world")
    links.follow(0.2)
    np.testing.assert_array_equal(hand.position, start)
    world.run(0.1)
    np.testing.assert_allclose(hand.position, start + np.array((0.05, 0, 0)), atol=1e-9)
    world.run(0.3)
    np.testing.assert_allclose(hand.position, start + np.array((0.1, 0, 0)), atol=1e-9)
    positions, quaternions = links.poses()
    np.testing.assert_allclose([body.position for body in links.bodies], positions, atol=1e-9)
    turns = np.abs(np.sum(quaternions * [body.quaternion for body in links.bodies], axis=1))
    np.testing.assert_allclose(turns, 1.0, atol=1e-12)


def test_a_cloth_is_carried_by_a_moving_robot(room):
    """A cloth that lies over a forearm goes where that goes: friction holds it while it moves gently."""
    world, talos, links = room
    talos.angle_vector({"arm_left_4_joint": -1.5, "arm_left_1_joint": 0.0})
    links.follow(0.0)
    arm = talos.frame_pose("arm_left_5_link").position
    top = max(b.vertices[:, 2].max() for b in links.bodies if "arm_left_5" in b.name)
    cloth = world.add(nuno.sheet((0.3, 0.3), cells=(8, 8), position=(arm[0], arm[1], top + 0.01)))
    world.attach(cloth, nuno.Cloth(area_density=0.2, bending_rigidity=1e-3, friction=1.0))
    for body in links.bodies:
        body.friction = 1.0
    world.run(0.7)
    before = cloth.vertices.mean(axis=0)
    distance = 0.1  # [m] in a second, by minimum jerk: at most 0.6 m/s2, a fifteenth of what friction holds
    for k in range(1, 61):
        s = k / 60
        talos.stand((distance * (10 * s**3 - 15 * s**4 + 6 * s**5), 0, 0))
        talos.angle_vector({"arm_left_4_joint": -1.5, "arm_left_1_joint": 0.0})
        links.follow(1 / 60)
        world.step()
    moved = cloth.vertices.mean(axis=0) - before
    assert abs(moved[0] - distance) < 0.01, moved  # what hangs down still sways


def test_visual_links_are_touched_by_nothing(talos):
    """They are to be looked at: a cloth falls through them as if they were not there."""
    falls = []
    for with_robot in (False, True):
        world = nuno.World(device="cpu")
        if with_robot:
            talos.enter(world, meshes="visual")
        cloth = world.add(nuno.sheet((0.3, 0.3), cells=(4, 4), position=(0, 0, 1.8)))
        world.attach(cloth)
        world.run(0.5)
        falls.append(cloth.vertices)
    np.testing.assert_array_equal(*falls)


@pytest.mark.parametrize("meshes", ["visual", "collision"])
@pytest.mark.parametrize("name", ["talos", "g1"])
def test_the_head_camera_sees_the_hands_and_not_its_own_head(name, meshes, request):
    """Both hands, each on its side of the image, and nothing of the robot within a hand's breadth of the lens."""
    robot = request.getfixturevalue(name)
    height = {"talos": 1.0, "g1": 0.75}[name]
    assert robot.reach({"left_hand": (0.45, 0.15, height), "right_hand": (0.45, -0.15, height)})
    if name == "talos":
        robot.angle_vector({"head_1_joint": 0.75})  # G1's camera looks down as it is
    world = nuno.World(device="cpu")
    links = robot.enter(world, meshes=meshes)
    camera = robot.camera().scaled(0.125)
    depth, ids = world.depth(camera).numpy(), world.ids(camera).numpy()
    assert depth[ids >= 0].min() > 0.1
    parts = ("arm", "wrist", "gripper", "elbow")
    arms = {side: [k for k, body in enumerate(links.bodies) if side in body.name and any(p in body.name for p in parts)]
            for side in ("left", "right")}  # fmt: skip
    columns = {side: np.nonzero(np.isin(ids, bodies))[1] for side, bodies in arms.items()}
    assert all(len(seen) > 20 for seen in columns.values())  # pixels, of 4,800
    assert columns["left"].mean() < 0.5 * camera.width < columns["right"].mean()


def test_links_are_imagined_saved_and_restored_with_the_world(room):
    """They are bodies as all others: a copy goes on along the same paths."""
    world, talos, links = room
    talos.translate((0.1, 0, 0), wrt="world")
    links.follow(0.2)
    saved, futures = world.save(), world.imagine(2)
    futures.run(0.2)
    hand = world.find("talos/arm_left_7_link")
    start = hand.position
    np.testing.assert_allclose(futures.find(hand.name).position, start + np.array((0.1, 0, 0)), atol=1e-9)
    world.run(0.2)
    world.restore(saved)
    np.testing.assert_allclose(hand.position, start, atol=1e-12)
    world.adopt(futures, 1)
    np.testing.assert_allclose(hand.position, start + np.array((0.1, 0, 0)), atol=1e-9)
    talos.translate((0.1, 0, 0), wrt="world")
    links.follow(0.1)
    world.run(0.1)
    np.testing.assert_allclose(hand.position, start + np.array((0.2, 0, 0)), atol=1e-9)


def test_links_leave_the_world_as_it_was(room):
    """The inverse of ``enter``; after it they say so. The robot may enter again."""
    world, talos, links = room
    other = world.add(nuno.sphere(0.1))
    links.leave()
    assert world.bodies == (other,)
    with pytest.raises(BodyStateError, match="left the world"):
        links.follow(0.1)
    with pytest.raises(BodyStateError, match="left the world"):
        links.leave()
    assert len(talos.enter(world).bodies) == len(world.bodies) - 1


def test_bad_entries_raise_and_change_nothing(talos):
    """Named errors, and an empty world stays empty."""
    world = nuno.World(device="cpu")
    with pytest.raises(InvalidInputError, match="meshes must be one of"):
        talos.enter(world, meshes="pretty")
    with pytest.raises(InvalidInputError, match="batch of 3"):
        talos.enter(world.imagine(3))
    assert world.bodies == ()
    links = talos.enter(world)
    with pytest.raises(InvalidInputError, match="seconds"):
        links.follow(-1.0)
    world.remove("talos/head_1_link")
    with pytest.raises(BodyStateError, match="no longer in the world, the first is 'talos/head_1_link'"):
        links.follow(0.1)


def test_two_robots_of_one_name(still_talos):
    """Bodies of the second get numbers; its hands and wrists are its own all the same."""
    world = nuno.World(device="cpu")
    first, second = still_talos.copy().enter(world), still_talos.copy().enter(world)
    assert first.names == second.names
    index = second.names.index("gripper_left_base_link")
    assert Hand(second, "left_hand").body is second.bodies[index]
    sensors = Sensors(second.robot, second)
    assert sensors._feels == Sensors(first.robot, first)._feels
    assert sensors._feels["left_wrist"][index]


def test_only_what_has_moved_is_worked_out_anew(room):
    """With the same bits as all of it: a few joints, many, fingers, the base, one after the other, and none."""
    (_, talos, links), rng = room, np.random.default_rng(4)
    lower, upper = (np.clip(limit, -1.0, 1.0) for limit in talos.joint_limits)
    fingers = [talos.joint_index(f"gripper_{side}_joint") for side in ("left", "right")]
    for k in range(30):
        angles = talos.angle_vector()
        some = [fingers, [], range(len(angles)), rng.integers(0, len(angles), 3)][k % 4]
        angles[list(some)] = rng.uniform(lower, upper)[list(some)]
        talos.angle_vector(angles)
        if k % 5 == 4:
            talos.rotate(0.3, "z").translate((0.1, 0.0, 0.0))
        links.follow(0.0)
        for part, name in zip(links.poses(), ("position", "quaternion"), strict=True):
            assert np.array([getattr(body, name) for body in links.bodies]).tobytes() == part.tobytes()
