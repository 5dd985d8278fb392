"""Hands: what is between the fingers is held until they open, and all is as before then."""

import numpy as np
import pytest

import nuno
from nuno.bodies.shape_topology import vertex_shares
from nuno.errors import InvalidInputError, UnknownNameError
from nuno.robot.hands import Hand, hands_of
from nuno.robot.sensors import Sensors

TOWEL = nuno.Cloth(area_density=0.3, damping=0.02, air_drag=5.0)


def with_towel(robot, size=0.2, cells=8):
    """A world with a robot, a cloth that lies level with a corner in its left hand, and the hand."""
    world = nuno.World(device="cpu")
    links = robot.enter(world)
    place = robot.frame_pose("left_hand").to_world([(0.0, 0.0, 0.02)])[0]
    towel = world.add(
        nuno.sheet((size, size), cells=(cells, cells), position=np.add(place, (0.5 * size, 0.5 * size, 0.0)))
    )
    world.attach(towel, TOWEL)
    return world, links, towel, Hand(links, "left_hand")


def test_a_closing_hand_holds_the_vertices_in_its_volume_and_no_others(talos):
    """Those that lie in the box in the hand's frame stay where they are; the rest of the towel falls and swings."""
    world, _, towel, hand = with_towel(talos)
    local = talos.frame_pose("left_hand").to_local(towel.vertices)
    low, high = hand.volume()
    inside = ((local >= low) & (local <= high)).all(axis=1)
    assert 0 < inside.sum() < len(inside)
    before = towel.vertices
    assert hand.close() == (towel,) == hand.held
    world.run(0.2)
    moved = np.linalg.norm(towel.vertices - before, axis=1)
    assert moved[inside].max() < 1e-6  # [m], rounding: a stiff grip
    assert moved[~inside].max() > 0.02  # free fall would make 0.2


def test_what_is_held_goes_where_the_hand_goes(talos):
    """The vertices keep their places in the hand's frame while the robot moves and turns its arm."""
    world, links, towel, hand = with_towel(talos)
    hand.close()
    held = hand.grips[0].spec.vertices[0]
    before = talos.frame_pose("left_hand").to_local(towel.vertices[held])
    for k in range(10):
        talos.angle_vector({"arm_left_4_joint": -1.2 + 0.02 * k, "torso_1_joint": 0.02 * k})
        links.follow(1 / 60)
        world.step()
    after = talos.frame_pose("left_hand").to_local(towel.vertices[held])
    np.testing.assert_allclose(after, before, atol=1e-5)  # [m], float32 at 1 m from the towel's origin


def test_release_restores_everything(talos):
    """After closing and opening at once the towel falls, bit for bit, as if no hand had been there."""
    ways = []
    for closes in (False, True):
        world, _, towel, hand = with_towel(talos)
        if closes:
            hand.close()
            assert len(world.find("sheet")._dynamics.grips) == 1
            hand.open()
            assert hand.held == () and towel._dynamics.grips == []
        world.run(0.2)
        ways.append((towel.vertices, towel.velocities))
    np.testing.assert_array_equal(ways[0][0], ways[1][0])
    np.testing.assert_array_equal(ways[0][1], ways[1][1])


def test_release_after_motion_gives_the_mass_back(talos):
    """Free fall of all vertices once the hand is open: those that were held have their mass again."""
    world, links, towel, hand = with_towel(talos)
    hand.close()
    world.run(0.3)
    links.leave()
    assert hand.held == ()  # what led the grips is gone, and they with it
    world.step()
    share = vertex_shares(towel.shape)
    before = np.average(towel.velocities, axis=0, weights=share)
    world.set_material(towel, nuno.Cloth(area_density=0.3, air_drag=0.0))
    world.run(0.1)
    after = np.average(towel.velocities, axis=0, weights=share)
    # 9.81 m/s2 for 0.1 s; half a percent is float32 velocities of a swinging cloth
    np.testing.assert_allclose(after - before, (0, 0, -0.981), atol=5e-3)


def test_a_rigid_box_is_held_as_a_whole(talos):
    """A box that is larger than the volume, none of its corners in it, is found by its surface and carried."""
    world = nuno.World(device="cpu")
    links = talos.enter(world)
    frame = talos.frame_pose("left_hand")
    box = world.add(
        nuno.box((0.3, 0.02, 0.05), position=frame.to_world([(0, 0, 0.03)])[0], quaternion=frame.quaternion)
    )
    world.attach(box, nuno.Rigid(mass=0.2))
    hand = Hand(links, "left_hand")
    assert hand.close() == (box,)
    before = box.position
    world.run(0.3)
    np.testing.assert_allclose(box.position, before, atol=1e-4)
    hand.open()
    world.run(0.1)
    assert before[2] - box.position[2] > 0.02  # 0.049 in free fall


def test_a_coarse_cloth_is_held_by_its_surface(talos):
    """Cells of 0.2 m, and no vertex in the volume: points of the faces are held, three of them, and stay."""
    world = nuno.World(device="cpu")
    links = talos.enter(world)
    place = talos.frame_pose("left_hand").to_world([(0, 0, 0.02)])[0]
    sheet = world.add(nuno.sheet((0.4, 0.4), cells=(2, 2), position=np.add(place, (0.1, 0.1, 0))))
    world.attach(sheet, TOWEL)
    hand = Hand(links, "left_hand")
    assert hand.close() == (sheet,)
    points = hand.grips[0].spec
    assert points.vertices is None and points.corners.shape == (1, 3, 3)
    start = np.einsum("kc,kcx->kx", points.barycentric[0], sheet.vertices[points.corners[0]])
    world.run(0.3)
    now = np.einsum("kc,kcx->kx", points.barycentric[0], sheet.vertices[points.corners[0]])
    np.testing.assert_allclose(now, start, atol=1e-3)  # [m], what one pass a substep leaves of such points


def test_an_empty_hand_closes_on_nothing_and_only_chosen_bodies_are_taken(talos):
    """A towel elsewhere, or one that is not among the bodies to be taken, stays free."""
    world, _, towel, hand = with_towel(talos)
    other = world.add(nuno.sheet((0.1, 0.1), cells=(2, 2), position=(2, 0, 1)))
    world.attach(other, TOWEL)
    assert hand.close(bodies=[other]) == ()
    assert hand.close(bodies=[towel]) == (towel,)
    assert Hand(hand.links, "right_hand").close() == ()
    assert hand.close(bodies=[]) == () == hand.held


def test_the_width_is_the_joints(talos):
    """Open at 0 rad, shut at -0.61 rad where the linkage brings the pads together; wider lets go."""
    world, _, towel, hand = with_towel(talos)
    assert hand.width == pytest.approx(0.092)
    assert hand.joint_angles(0.0) == {"gripper_left_joint": pytest.approx(-0.61)}
    hand.move(0.0)
    assert hand.width == pytest.approx(0.0)
    hand.close()
    hand.move(0.0)
    assert hand.held == (towel,)
    hand.move(0.02)
    assert hand.held == () and hand.width == pytest.approx(0.02)
    assert world.time == 0.0


def test_a_palm_without_fingers_holds(g1):
    """G1's hands have no joint and no shape of their own: the wrist's link bears what they hold."""
    world, links, towel, hand = with_towel(g1)
    assert hand.body is world.find("g1/left_wrist_yaw_link")
    assert hand.joint_angles(0.0) == {} == hand.move(0.0)
    hand.close()
    assert hand.held == (towel,)
    assert sorted(hands_of(links)) == ["left_hand", "right_hand"]


def test_bad_input(talos):
    """Named errors that say what is valid."""
    world = nuno.World(device="cpu")
    links = talos.enter(world)
    with pytest.raises(UnknownNameError, match="left_hand"):
        Hand(links, "tail")
    with pytest.raises(InvalidInputError, match=r"at most 0\.092 m apart, got 0\.2"):
        Hand(links, "left_hand").move(0.2)


INERTIAL = """<inertial><mass value="0.2"/>
    <inertia ixx="1e-3" iyy="1e-3" izz="1e-3" ixy="0" ixz="0" iyz="0"/></inertial>"""
CLAMP = f"""<robot name="clamp">
  <link name="body">{INERTIAL}</link>
  <link name="palm">{INERTIAL}
    <collision><origin xyz="0 -0.05 0"/><geometry><box size="0.06 0.02 0.06"/></geometry></collision></link>
  <link name="thumb">{INERTIAL}
    <collision><origin xyz="0 0.01 0"/><geometry><box size="0.06 0.02 0.06"/></geometry></collision></link>
  <joint name="wrist" type="revolute"><parent link="body"/><child link="palm"/><axis xyz="0 0 1"/>
    <limit lower="-1" upper="1" effort="10" velocity="1"/></joint>
  <joint name="slide" type="prismatic"><parent link="palm"/><child link="thumb"/><axis xyz="0 1 0"/>
    <origin xyz="0 -0.04 0"/><limit lower="0" upper="0.08" effort="100" velocity="1"/></joint>
</robot>"""

TABLE = """[clamp]
urdf = "clamp.urdf"
[clamp.posture]
slide = 0.08
[clamp.frames]
left_hand = { link = "palm" }
left_wrist = { link = "palm" }
[clamp.hands.left_hand]
low = [-0.03, -0.04, -0.03]
high = [0.03, 0.04, 0.03]
joint = "slide"
open = 0.08
closed = 0.0
width = 0.08
"""


def test_contact_alone_holds_where_friction_suffices(tmp_path):
    """A clamp whose jaw slides shut on a sponge lifts it without a grip; its wrist bears the weight; open, it falls.

    Squeezed by a tenth, 2e4 Pa over 0.04 x 0.04 m press with 3 N: friction holds 25 times the weight, 0.19 N.
    """
    (tmp_path / "clamp.urdf").write_text(CLAMP)
    (tmp_path / "robots.toml").write_text(TABLE)
    robot = nuno.Humanoid("clamp", robots=tmp_path / "robots.toml")
    robot.translate((0, 0, 0.5))
    world = nuno.World(device="cpu")
    table = world.add(nuno.box((0.3, 0.3, 0.1), position=(0, 0, 0.43)))
    sponge = world.add(nuno.soft_box((0.04, 0.04, 0.04), cells=(3, 3, 3), position=(0, -0.0195, 0.5005)))
    world.attach(sponge, nuno.Soft(youngs_modulus=2e4, poisson_ratio=0.3, density=300.0, friction=0.8, damping=0.05))
    links = robot.enter(world)
    for body in links.bodies:
        body.friction = 0.8
    hand = Hand(links, "left_hand")
    sensors = Sensors(robot, links)
    empty = sensors.read()
    assert hand.move(0.036) == {"slide": pytest.approx(0.036)}
    links.follow(0.4)
    world.run(0.5)
    before = sponge.vertices.mean(axis=0)
    robot.translate((0, 0, 0.1))
    links.follow(0.8)
    world.run(1.0)
    assert hand.held == ()
    rise = sponge.vertices.mean(axis=0) - before
    np.testing.assert_allclose(rise, (0, 0, 0.1), atol=2e-3)  # [m], a straight path starts and stops at once
    bottom = sponge.vertices[:, 2].min()
    assert bottom > table.vertices[:, 2].max() + 0.09
    world.run(0.5)
    weights = []
    for _ in range(20):
        world.step()
        weights.append(sensors.read().wrenches["left_wrist"][2] - empty.wrenches["left_wrist"][2])
    weight = 300.0 * 0.04**3 * 9.81
    assert np.mean(weights) == pytest.approx(-weight, rel=0.02)
    creep = sponge.vertices[:, 2].min() - bottom
    assert abs(creep) < 5e-4  # [m] in most of a second
    hand.move(0.08)
    links.follow(0.2)
    world.run(0.5)
    assert sponge.vertices[:, 2].max() < before[2] + 0.03  # it lies on the table again
