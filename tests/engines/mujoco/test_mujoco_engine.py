"""MuJoCo as an engine: bodies that come and go, copies, batches, files, and grips, beside closed forms."""

import itertools

import numpy as np
import pytest

import nuno

pytest.importorskip("mujoco", minversion="4.0")


def scene(engine="mujoco"):
    """A block on a fixed table and a cloth above both, in a world."""
    world = nuno.World(device="cpu", engine=engine)
    world.add(nuno.plane(name="floor"))
    world.add(nuno.box((0.3, 0.3, 0.05), position=(0.0, 0.0, 0.1), name="table"))
    block = world.attach(world.add(nuno.box((0.05, 0.05, 0.05), position=(0.0, 0.0, 0.15), name="block")))
    cloth = world.attach(world.add(nuno.sheet((0.2, 0.2), cells=(6, 6), position=(0.0, 0.0, 0.2), name="cloth")))
    return world, block, cloth


def test_a_cloth_lies_on_a_block_on_a_table():
    """Each rests where what is below it ends, and the table's contacts bear the weight of what they bear."""
    world, block, cloth = scene()
    world.run(1.0)
    # contacts give way by 0.1 mm at most under such weights
    assert block.position[2] == pytest.approx(0.15, abs=2e-4)
    over = np.abs(cloth.vertices[:, :2]).max(axis=1) < 0.025
    assert (cloth.vertices[over, 2] > 0.175 + 0.5 * cloth.thickness - 2e-4).all()
    assert cloth.vertices[:, 2].min() > 0.125
    found = world.contacts(block)
    below = found.forces[np.array(found.others) == "table"].sum(axis=0)
    above = found.forces[np.array(found.others) == "cloth"].sum(axis=0)
    # the block stands still: what the two others do to it bears its weight
    np.testing.assert_allclose(below + above, (0.0, 0.0, 9.81 * block.mass), rtol=0.02, atol=0.02)
    assert above[2] < 0.0


def test_a_world_of_a_batch_is_the_single_world_to_the_bit():
    """Three copies go as the world does; so does a world whose neighbours are of other materials."""
    world, _, cloth = scene()
    world.run(0.1)
    batch, other = world.imagine(3), world.imagine(3)
    rigidity = np.array([1e-5, 5e-5, 1e-3])
    other.set_material("cloth", nuno.Cloth(bending_rigidity=rigidity, area_density=np.array([0.1, 0.2, 0.3])))
    for each in (world, batch, other):
        each.run(0.2)
    for k in range(3):
        np.testing.assert_array_equal(batch.find("cloth").vertices[k], cloth.vertices)
    np.testing.assert_array_equal(other.find("cloth").vertices[1], cloth.vertices)
    assert np.ptp(other.find("cloth").vertices, axis=0).max() > 1e-4


def test_what_was_saved_goes_on_to_the_bit(tmp_path):
    """From a snapshot, from a file in another world, and in pieces."""
    world, _, cloth = scene()
    world.run(0.1)
    snapshot = world.save(tmp_path / "scene.npz")
    world.run(0.2)
    expected = cloth.vertices
    world.restore(snapshot)
    world.run(0.05)
    world.run(0.15)
    np.testing.assert_array_equal(cloth.vertices, expected)
    again = nuno.World(device="cpu", engine="mujoco")
    again.restore(tmp_path / "scene.npz")
    again.run(0.2)
    np.testing.assert_array_equal(again.find("cloth").vertices, expected)


def test_a_world_of_nuno_goes_on_in_mujoco_and_is_adopted_back():
    """Places, velocities and grips are taken over; what comes back is what was there, to a float."""
    world, block, cloth = scene("nuno")
    world.run(0.05)
    start = cloth.vertices[0]
    end = start + np.array((0.0, 0.0, 0.1))
    grip = world.grip(cloth, [0], to=nuno.Path([world.time, world.time + 0.2], [start, end], None, "minimum_jerk"))
    futures = world.imagine(2, engine="mujoco")
    assert futures.engine.name == "mujoco"
    np.testing.assert_array_equal(futures.find("cloth").vertices[1], cloth.vertices)
    np.testing.assert_array_equal(futures.find("cloth").velocities[1], cloth.velocities)
    np.testing.assert_allclose(futures.find("block").position[0], block.position, atol=1e-12)
    futures.run(0.3)
    there = futures.find("cloth").vertices[1]
    # a stiff equality holds the vertex within 0.1 mm of where its path ended
    np.testing.assert_allclose(there[0], end, atol=1e-4)
    world.adopt(futures, 1)
    assert world.engine.name == "nuno" and grip.active
    np.testing.assert_allclose(cloth.vertices, there, atol=1e-7)
    world.run(0.1)
    np.testing.assert_allclose(cloth.vertices[0], end, atol=1e-6)


def test_bodies_come_and_go_while_others_move():
    """A compilation changes no number of a body; what is detached stands still, what is attached falls."""
    world, block, cloth = scene()
    world.run(0.05)
    moving, velocities = cloth.vertices, cloth.velocities
    world.detach(block)
    ball = world.add(nuno.sphere(0.02, position=(0.5, 0.0, 0.3), name="ball"))
    world.attach(ball, velocity=(0.0, 0.0, 1.0))
    np.testing.assert_array_equal(cloth.vertices, moving)
    np.testing.assert_array_equal(cloth.velocities, velocities)
    place = np.array(block.position)
    world.run(0.1)
    np.testing.assert_array_equal(block.position, place)
    # v t - g t^2 / 2, by semi-implicit steps of h = 1/480 s: half a step's velocity g h t / 2 less
    assert ball.position[2] == pytest.approx(0.3 + 0.1 - 0.5 * 9.81 * 0.1 * (0.1 + 1.0 / 480.0), abs=1e-9)
    world.remove(ball)
    world.attach(block)
    world.run(0.05)
    assert not ball.is_dynamic and len(world.bodies) == 4


def test_a_grip_leads_along_its_path_and_bears_the_weight():
    """A vertex is within 0.05 mm of its path at 1 m/s, and a hanging cloth's grip bears its weight."""
    world = nuno.World(device="cpu", engine="mujoco")
    cloth = world.attach(world.add(nuno.sheet((0.2, 0.1), cells=(6, 3), position=(0.0, 0.0, 1.0))))
    start = cloth.vertices[0]
    grip = world.grip(cloth, [0], to=nuno.Path([0.0, 0.3], [start, start + np.array((0.3, 0.0, 0.0))], None, "linear"))
    world.run(0.2)
    np.testing.assert_allclose(cloth.vertices[0], start + np.array((0.2, 0.0, 0.0)), atol=5e-5)
    world.set_material(cloth, nuno.Cloth(air_drag=8.0))
    world.run(2.5)
    assert np.abs(cloth.velocities).max() < 0.02
    np.testing.assert_allclose(grip.wrench[0], (0.0, 0.0, -9.81 * cloth.mass), atol=0.02 * 9.81 * cloth.mass)
    grip.release()
    world.run(0.1)
    assert cloth.vertices[0, 2] < start[2] - 0.03


def test_points_inside_faces_are_held():
    """A point between vertices stays where it is held, within 0.1 mm."""
    world = nuno.World(device="cpu", engine="mujoco")
    cloth = world.attach(world.add(nuno.sheet((0.2, 0.2), cells=(4, 4), position=(0.0, 0.0, 1.0))))
    point = cloth.at(0.4, 0.55)
    place = point.positions(cloth.vertices, cloth.faces)[0]
    world.grip(cloth, point, to=place)
    world.run(0.3)
    np.testing.assert_allclose(point.positions(cloth.vertices, cloth.faces)[0], place, atol=1e-4)


def test_a_table_on_a_path_carries_what_lies_on_it():
    """Friction takes a cloth and a block along, for the path's acceleration is below mu g: within 1 mm of 0.2 m."""
    world = nuno.World(device="cpu", engine="mujoco")
    table = world.add(nuno.box((0.5, 0.5, 0.02), position=(0.0, 0.0, -0.01), name="table"))
    cloth = world.attach(world.add(nuno.sheet((0.1, 0.1), cells=(4, 4), position=(-0.1, 0.0, 0.002))))
    block = world.attach(world.add(nuno.box((0.05, 0.05, 0.05), position=(0.1, 0.0, 0.025))))
    world.run(0.1)
    before = cloth.vertices.mean(axis=0), np.array(block.position)
    times = [world.time, world.time + 0.8]
    world.move(table, nuno.Path(times, [(0.0, 0.0, -0.01), (0.2, 0.0, -0.01)], None, "minimum_jerk"))
    world.run(0.9)
    assert cloth.vertices.mean(axis=0)[0] - before[0][0] == pytest.approx(0.2, abs=1e-3)
    assert block.position[0] - before[1][0] == pytest.approx(0.2, abs=1e-3)


@pytest.mark.parametrize("degrees", [20.0, 30.0])
def test_a_block_on_an_incline_sticks_or_slides_as_its_friction_says(degrees):
    """Below the friction angle it creeps by less than 0.2 mm/s, beyond it slides by g (sin - mu cos) t^2 / 2."""
    mu, angle = 0.5, np.radians(degrees)
    turn = (np.cos(angle / 2.0), 0.0, np.sin(angle / 2.0), 0.0)
    world = nuno.World(device="cpu", engine="mujoco")
    world.add(nuno.plane(quaternion=turn, friction=0.25))
    place = 0.05 * np.array([np.sin(angle), 0.0, np.cos(angle)])
    block = world.add(nuno.box((0.1, 0.1, 0.1), position=place, quaternion=turn))
    world.attach(block, nuno.Rigid(friction=1.0))  # the pair's coefficient is sqrt(0.25 * 1) = 0.5
    world.run(1.0)
    slid = float(np.linalg.norm(block.position - place))
    expected = 0.5 * 9.81 * max(0.0, np.sin(angle) - mu * np.cos(angle))
    # 2 % for implicit steps, and for contacts that give way as the block is laid down
    assert slid == pytest.approx(expected, rel=0.02, abs=2e-4)


def test_joints_hold_rigid_bodies():
    """A pendulum falls as its energy says and keeps its length, a ball joint and a fixed joint bear the weight."""
    world = nuno.World(device="cpu", engine="mujoco")
    rod = world.attach(world.add(nuno.box((0.2, 0.02, 0.02), position=(0.1, 0.0, 1.0), name="rod")))
    hinge = nuno.hinge(rod, None, point=(0.0, 0.0, 1.0), axis=(0.0, 1.0, 0.0))
    block = world.attach(world.add(nuno.box((0.05, 0.05, 0.05), position=(0.5, 0.0, 1.0), name="block")))
    fixed = nuno.fixed_joint(block, None)
    fastest = 0.0
    for _ in range(24):
        world.step()
        fastest = max(fastest, abs(float(hinge.velocity)))
        assert np.linalg.norm(rod.position - (0.0, 0.0, 1.0)) == pytest.approx(0.1, abs=3e-4)
    # w^2 = 2 m g r / I about the hinge, with I = m (l^2 + h^2) / 12 + m r^2
    inertia = (0.2**2 + 0.02**2) / 12.0 + 0.1**2
    assert fastest == pytest.approx(np.sqrt(2.0 * 9.81 * 0.1 / inertia), rel=0.01)
    np.testing.assert_allclose(fixed.wrench[0], (0.0, 0.0, -9.81 * block.mass), rtol=1e-4, atol=1e-4)
    fixed.release()
    ball = nuno.ball_joint(block, None, point=np.array(block.position) + np.array((0.0, 0.0, 0.1)))
    world.run(0.2)
    np.testing.assert_allclose(ball.wrench[0], (0.0, 0.0, -9.81 * block.mass), rtol=1e-4, atol=1e-4)


def test_a_rigid_body_is_led_and_welded():
    """A hold leads place and turn within 0.1 mm and 1e-4, and a weld carries another body along."""
    world = nuno.World(device="cpu", engine="mujoco")
    a = world.attach(world.add(nuno.box((0.05, 0.05, 0.05), position=(0.0, 0.0, 1.0), name="a")))
    b = world.attach(world.add(nuno.box((0.05, 0.05, 0.05), position=(0.06, 0.0, 1.0), name="b")))
    quarter = (np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5))
    path = nuno.Path([0.0, 0.4], [(0.0, 0.0, 1.0), (0.0, 0.0, 1.2)], [(1.0, 0.0, 0.0, 0.0), quarter], "linear")
    world.grip(a, to=path)
    world.weld(b, a)
    world.run(0.5)
    np.testing.assert_allclose(a.position, (0.0, 0.0, 1.2), atol=1e-4)
    np.testing.assert_allclose(a.pose()[1], quarter, atol=1e-4)
    np.testing.assert_allclose(b.position, (0.0, 0.06, 1.2), atol=1e-3)


def test_cloth_is_tied_to_a_body_that_moves():
    """A cloth's corner that is welded to a block goes where the block goes, within 0.1 mm."""
    world = nuno.World(device="cpu", engine="mujoco")
    block = world.attach(world.add(nuno.box((0.05, 0.05, 0.05), position=(-0.13, -0.1, 1.0), name="block")))
    cloth = world.attach(world.add(nuno.sheet((0.2, 0.2), cells=(4, 4), position=(0.0, 0.0, 1.0))))
    world.weld(cloth, block, [0])
    world.grip(
        block, to=nuno.Path([0.0, 0.3], [block.position, block.position + np.array((0.0, 0.0, 0.1))], None, "linear")
    )
    offset = cloth.vertices[0] - block.position
    world.run(0.4)
    np.testing.assert_allclose(cloth.vertices[0] - block.position, offset, atol=1e-4)


def test_pushes_velocities_and_places_act():
    """A push gives an impulse F t / m; set_velocity, set_vertices and set_pose do as they say; air takes exp(-c t)."""
    world = nuno.World(device="cpu", engine="mujoco", gravity=(0.0, 0.0, 0.0))
    block = world.attach(world.add(nuno.box((0.1, 0.1, 0.1), position=(0.0, 0.0, 1.0), name="block")))
    cloth = world.attach(world.add(nuno.sheet((0.1, 0.1), cells=(2, 2), position=(1.0, 0.0, 1.0))))
    world.push(block, (2.0, 0.0, 0.0), duration=0.1)
    world.set_velocity(cloth, (0.0, 0.5, 0.0))
    world.run(0.2)
    np.testing.assert_allclose(block.velocity, (0.2, 0.0, 0.0), atol=1e-9)
    # implicit steps of h take (1 + c h)^-n in place of exp(-c t): less than c^2 h t / 2 = 2e-4 apart
    np.testing.assert_allclose(cloth.velocity, (0.0, 0.5 * np.exp(-0.2), 0.0), atol=2e-4)
    world.set_pose(block, (0.0, 0.0, 2.0))
    world.set_vertices(cloth, cloth.vertices + np.array((0.0, 0.0, 1.0)))
    assert block.position[2] == pytest.approx(2.0) and cloth.vertices[:, 2].min() == pytest.approx(2.0, abs=1e-9)


def test_recordings_traces_and_masks_see_what_moves():
    """They read the vertices, whichever engine moves them."""
    world, _, cloth = scene()
    found = world.trace(cloth, [0.05, 0.1])
    np.testing.assert_array_equal(found[-1], cloth.vertices.astype(np.float32))
    camera = nuno.Camera.look_at((0.6, 0.0, 0.6), (0.0, 0.0, 0.15), width=64, height=48, fov=0.9)
    assert world.masks(camera, cloth).numpy().any()
    states = world.state(cloth)["positions"].numpy()
    np.testing.assert_allclose(states[0], cloth.vertices, atol=1e-7)


def test_some_worlds_of_a_batch_are_reset():
    """The named ones become what was saved, the others keep every bit."""
    world, _, _ = scene()
    batch = world.imagine(3)
    start = batch.save()
    batch.run(0.1)
    kept = batch.find("cloth").vertices
    batch.reset([1], start)
    now = batch.find("cloth").vertices
    np.testing.assert_array_equal(now[[0, 2]], kept[[0, 2]])
    np.testing.assert_allclose(now[1], world.find("cloth").vertices, atol=0.0)


def test_a_run_that_fails_leaves_the_world_as_it_was():
    """Velocities beyond all bounds end as SimulationDiverged, and the last good state is there again."""
    world, _, cloth = scene()
    world.run(0.05)
    world.set_velocity(cloth, (0.0, 0.0, 1e38))
    before, time = cloth.vertices, world.time
    with pytest.raises(nuno.SimulationDiverged):
        world.run(0.2)
    np.testing.assert_array_equal(cloth.vertices, before)
    assert world.time == time


def test_a_robot_follows_its_paths():
    """Without dynamics its links are moving shapes as any others."""
    pytest.importorskip("pinocchio")
    world = nuno.World(device="cpu", engine="mujoco")
    robot = nuno.SimulatedRobot(nuno.Humanoid("talos"), world)
    ball = world.attach(world.add(nuno.sphere(0.05, position=(2.0, 0.0, 1.0), name="ball")))
    angles = robot.angle_vector()
    angles[robot.actual.joint_names.index("arm_left_4_joint")] -= 0.3
    robot.angle_vector(angles, 0.2)
    world.run(0.2)
    assert ball.position[2] == pytest.approx(1.0 - 0.5 * 9.81 * world.time * (world.time + 1.0 / 480.0), abs=1e-9)
    np.testing.assert_allclose(robot.state().q[7:], angles, atol=1e-2)


def test_a_static_mesh_that_is_not_convex_is_met_as_it_is():
    """A ball falls through a torus's hole onto the floor, where a convex hull would bear it."""
    trimesh = pytest.importorskip("trimesh")
    world = nuno.World(device="cpu", engine="mujoco")
    world.add(nuno.plane())
    world.add(nuno.mesh(trimesh.creation.torus(0.2, 0.05), position=(0.0, 0.0, 0.05), name="torus"))
    inner = world.attach(world.add(nuno.sphere(0.1, position=(0.0, 0.0, 0.3), name="inner")))
    outer = world.attach(world.add(nuno.sphere(0.1, position=(1.0, 0.0, 0.3), name="outer")))
    world.run(0.5)
    assert inner.position[2] == pytest.approx(0.1, abs=1e-3)
    assert outer.position[2] == pytest.approx(0.1, abs=1e-3)


def test_materials_by_warp_weft_and_element_are_taken():
    """A strip that is stiff across hangs down, one that is stiff along itself stands out as one stiff in both does."""
    drops = []
    for rigidity in ((1e-5, 1e-2), (1e-2, 1e-4), np.full(30, 1e-2)):
        world = nuno.World(device="cpu", engine="mujoco")
        strip = world.add(nuno.sheet((0.2, 0.06), cells=(10, 3), position=(0.0, 0.0, 1.0)))
        world.attach(strip, nuno.Cloth(bending_rigidity=rigidity, air_drag=10.0))
        held = np.flatnonzero(strip.vertices[:, 0] < -0.07)
        world.grip(strip, held, to=strip.vertices[held].mean(axis=0))
        world.run(1.0)
        drops.append(1.0 - strip.vertices[strip.vertices[:, 0].argmax(), 2])
    # the stiff ones drop by w L^4 / (8 B) with L = 0.19 m from between the two columns that are held
    expected = 0.2 * 9.81 * 0.19**4 / (8.0 * 1e-2)
    assert drops[0] > 0.1
    assert drops[1] == pytest.approx(expected, rel=0.15)
    assert drops[2] == pytest.approx(expected, rel=0.15)


def test_contacts_are_told_of_a_table_on_a_path_after_a_change():
    """A model that is compiled anew between two steps has the table where its path is: it bears the block's weight."""
    world = nuno.World(device="cpu", engine="mujoco")
    table = world.add(nuno.box((0.5, 0.5, 0.02), position=(0.0, 0.0, 0.99), name="table"))
    block = world.attach(world.add(nuno.box((0.05, 0.05, 0.05), position=(0.0, 0.0, 1.025), name="block")))
    world.move(table, nuno.Path([0.0, 1.0], [(0.0, 0.0, 0.99), (0.1, 0.0, 0.99)], None, "linear"))
    world.run(0.3)
    world.add(nuno.sphere(0.05, position=(2.0, 0.0, 1.0)))
    found = world.contacts(block)
    assert set(found.others) == {"table"}
    assert found.forces.sum(axis=0)[2] == pytest.approx(9.81 * block.mass, rel=0.05)


def test_substeps_and_gravity_may_change_between_runs():
    """The next step has them: a fall by semi-implicit steps says how long they are, and how strong gravity is."""
    world = nuno.World(device="cpu", engine="mujoco", substeps=4)
    ball = world.attach(world.add(nuno.sphere(0.05, position=(0.0, 0.0, 1.0))))
    world.run(0.1)
    # z = 1 - g t (t + h) / 2, with h = 1/240 s
    assert ball.position[2] == pytest.approx(1.0 - 0.5 * 9.81 * 0.1 * (0.1 + 1.0 / 240.0), abs=1e-9)
    start = ball.position[2]
    world.set_velocity(ball)
    world.substeps, world.gravity = 2, (0.0, 0.0, -1.0)
    world.run(0.1)
    assert ball.position[2] == pytest.approx(start - 0.5 * 0.1 * (0.1 + 1.0 / 120.0), abs=1e-9)


def test_more_classes_of_bodies_than_there_are_bits_are_refused_before_anything_moves():
    """A chain of 34 bodies each of which passes through the next: no two touch the same others."""
    world = nuno.World(device="cpu", engine="mujoco")
    balls = [world.attach(world.add(nuno.sphere(0.05, position=(0.3 * k, 0.0, 1.0)))) for k in range(34)]
    for one, other in itertools.pairwise(balls):
        world.ignore_contact(one, other)
    with pytest.raises(nuno.InvalidInputError, match="31 classes of bodies"):
        world.run(0.1)
    assert world.time == 0.0
    for k, one in enumerate(balls):
        np.testing.assert_array_equal(one.position, (0.3 * k, 0.0, 1.0))
        for other in balls[:k]:
            world.ignore_contact(one, other)
    world.run(0.1)
    assert balls[0].position[2] < 0.96
