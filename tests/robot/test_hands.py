"""Hands: what is between the fingers is held until they open, and all is as before then."""

import numpy as np
import pytest

import nuno
from nuno.dynamics import vertex_shares
from nuno.errors import InvalidInputError, UnknownNameError
from nuno.robot.hands import Hand, hands_of

TOWEL = nuno.Cloth(area_density=0.3, damping=0.02, air_drag=5.0)


def with_towel(robot, size=0.2, cells=8):
    """A world with a robot, a cloth that lies level with a corner in its left hand, and the hand."""
    world = nuno.World(device="cpu")
    links = robot.enter(world)
    place = robot.frame_pose("left_hand").to_world([(0.0, 0.0, 0.02)])[0]
    towel = world.add(nuno.sheet((size, size), cells=(cells, cells), position=place + (0.5 * size, 0.5 * size, 0.0)))
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
    held = hand.grips[0]._spec.vertices[0]
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
    box = world.add(nuno.box((0.3, 0.02, 0.05), position=frame.to_world([(0, 0, 0.03)])[0], quaternion=frame.quaternion))
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
    sheet = world.add(nuno.sheet((0.4, 0.4), cells=(2, 2), position=place + (0.1, 0.1, 0)))
    world.attach(sheet, TOWEL)
    hand = Hand(links, "left_hand")
    assert hand.close() == (sheet,)
    points = hand.grips[0]._spec
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
