"""World: bodies and dynamics that come and go, grips, pushes, contact rules, errors that change nothing."""

import numpy as np
import pytest

import nuno
from free_fall import Colliders, free_fall  # noqa: F401
from nuno import BodyStateError, Cloth, InvalidInputError, Path, SimulationDiverged, UnknownNameError

pytestmark = pytest.mark.usefixtures("free_fall")
NEAR = 1e-6  # float32 at lengths below 10 m


def room():
    """A world with a table and a towel above it."""
    world = nuno.World(device="cpu")
    world.add(nuno.box((1, 1, 0.02), name="table"))
    towel = world.add(nuno.sheet((0.6, 0.4), cells=(3, 2), name="towel", position=(0, 0, 1)))
    return world, towel


def test_names_are_numbered_and_found():
    """A name that is taken gets a number; find lists the names there are."""
    world = nuno.World(device="cpu")
    names = [world.add(nuno.box((1, 1, 1))).name for _ in range(3)]
    assert names == ["box", "box_1", "box_2"]
    assert world.find("box_1") is world.bodies[1]
    with pytest.raises(UnknownNameError, match="box_2"):
        world.find("sphere")


def test_static_bodies_do_not_move_and_time_passes():
    """Nothing attached: time advances by whole frames and a shorter one, and shapes stay."""
    world, towel = room()
    before = towel.vertices
    world.run(1.01)
    world.step()
    assert world.time == pytest.approx(1.01 + 1 / 60, abs=1e-12)
    np.testing.assert_array_equal(towel.vertices, before)


def test_attach_moves_and_detach_keeps_the_shape():
    """An attached body falls; detached, it keeps its shape exactly; attached again, it starts from there."""
    world, towel = room()
    before = towel.vertices
    world.attach(towel)
    np.testing.assert_array_equal(towel.vertices, before.astype(np.float32))
    world.run(0.5)
    fallen = towel.vertices
    assert towel.is_dynamic and fallen[:, 2].max() < 1.0
    world.detach(towel)
    assert not towel.is_dynamic and towel.material is None
    np.testing.assert_array_equal(towel.vertices, fallen)
    np.testing.assert_array_equal(towel.position, fallen.mean(axis=0))
    world.run(1.0)
    np.testing.assert_array_equal(towel.vertices, fallen)
    world.attach(towel)
    np.testing.assert_array_equal(towel.vertices, fallen)


def test_attach_and_detach_leave_the_others_bit_for_bit():
    """Positions, velocities, grips and later motion of one body do not depend on what is done to others."""
    states = []
    for disturbed in (False, True):
        world, towel = room()
        other = world.add(nuno.sheet((0.2, 0.2), cells=(2, 2), position=(3, 0, 1)))
        world.attach(towel)
        grip = world.grip(towel, [0], to=Path([0.0, 1.0], [(0, 0, 1), (0, 0, 2)]))
        world.run(0.1)
        if disturbed:
            solver = towel._dynamics.solver
            world.attach(other)
            world.detach(other)
            world.attach(other, Cloth.preset("denim"))
            assert towel._dynamics.solver is solver and grip.active
        world.run(0.1)
        states.append((towel.vertices, towel.velocities, world.time))
    for a, b in zip(*states, strict=True):
        np.testing.assert_array_equal(a, b)


def test_a_detached_shape_moves_rigidly():
    """A static deformed body is located and turned as it is."""
    world, towel = room()
    world.attach(towel)
    world.grip(towel, [0], to=(0, 0, 3))
    world.run(0.2)
    world.detach(towel)
    shape, centre = towel.vertices, towel.position
    towel.locate((1, 2, 3)).rotate(np.pi, "z", wrt="world")
    expected = (shape - centre) * (-1, -1, 1) + (1, 2, 3)
    np.testing.assert_allclose(towel.vertices, expected, atol=1e-12)  # float64 throughout
    towel.rotate(-np.pi, "z", wrt="world").locate(centre)
    np.testing.assert_allclose(towel.vertices, shape, atol=1e-12)


def test_a_dynamic_body_is_put_elsewhere_as_a_whole():
    """Locating an attached body moves its vertices rigidly and keeps its velocities."""
    world, towel = room()
    world.attach(towel)
    world.run(0.1)
    shape, velocities, centre = towel.vertices, towel.velocities, towel.position
    towel.locate((0, 0, 5))
    np.testing.assert_allclose(towel.vertices, shape - centre + (0, 0, 5), atol=NEAR)
    np.testing.assert_array_equal(towel.velocities, velocities)


def test_colliders_are_the_other_static_bodies_and_made_only_when_they_change():
    """Adding, moving and removing rebuilds them before the next frame; a frame alone does not."""
    world, towel = room()
    world.attach(towel)
    world.step()
    solver = towel._dynamics.solver
    assert solver.colliders.names == ["table"]
    made = Colliders.made
    world.run(1.0)
    assert Colliders.made == made
    ball = world.add(nuno.sphere(0.1))
    ball.locate((1, 0, 0))
    world.step()
    assert solver.colliders.names == ["table", "sphere"] and Colliders.made == made + 1
    world.remove(ball)
    world.detach(world.attach(world.add(nuno.sheet((1, 1), cells=(1, 1), name="rag"))))
    world.step()
    assert solver.colliders.names == ["table", "rag"]


def test_children_of_static_and_of_dynamic_bodies_move_the_colliders():
    """A body that follows another is a collider where it has been brought to."""
    world, towel = room()
    table = world.find("table")
    cup = world.add(nuno.cylinder(0.04, 0.1, position=(0, 0, 0.1)))
    table.assoc(cup)
    world.attach(towel)
    world.step()
    made = Colliders.made
    table.translate((0, 0, 0.5))
    world.step()
    assert Colliders.made == made + 1
    np.testing.assert_allclose(cup.position, (0, 0, 0.6), atol=1e-12)
    with pytest.raises(BodyStateError, match="follows"):
        child = world.add(nuno.sheet((1, 1), cells=(1, 1)))
        table.assoc(child)
        world.attach(child)


def test_bodies_that_follow_a_removed_one_stand_still():
    """They are where they were to a double's rounding, whatever becomes of it; what is no body of the world follows."""
    world = nuno.World(device="cpu")
    table = world.add(nuno.box((1, 1, 0.1), name="table", position=(0.2, 0.3, 0.4)).rotate(0.5, "z"))
    cup, spoon = (world.add(nuno.cylinder(0.04, 0.1, position=(x, 0, 0.5))) for x in (0.0, 0.1))
    frame, loose = nuno.Coordinates((0, 0, 1)), nuno.cylinder(0.04, 0.1, position=(0.2, 0, 0.5))
    table.assoc(cup)
    table.assoc(frame)
    frame.assoc(spoon)
    table.assoc(loose)
    poses = [np.concatenate(body.pose()) for body in (cup, spoon)]
    saved = world.save()
    world.remove(table)
    table.locate((5.0, 0.0, 0.0)).rotate(1.0, "x")
    world.run(0.1)
    for body, pose in zip((cup, spoon), poses, strict=True):
        assert body.parent is None
        np.testing.assert_allclose(np.concatenate(body.pose()), pose, atol=1e-15)
    assert frame.parent is table and loose.parent is table
    assert np.linalg.norm(frame.position - table.position) < 2.0 and loose.position[0] > 4.0
    world.restore(saved)
    assert cup.parent is table
    np.testing.assert_allclose(np.concatenate(cup.pose()), poses[0], atol=1e-15)


def test_groups_and_ignored_pairs_filter_the_colliders():
    """Both masks must agree, and ignored pairs never touch."""
    world, towel = room()
    wall = world.add(nuno.box((1, 1, 1), name="wall", group=2))
    world.attach(towel)
    world.step()
    solver = towel._dynamics.solver
    assert solver.colliders.names == ["table", "wall"]
    towel.collides_with = 1
    world.step()
    assert solver.colliders.names == ["table"]
    world.ignore_contact(towel, "table")
    towel.collides_with = 3
    world.step()
    assert solver.colliders.names == ["wall"]
    world.ignore_contact(towel, "table", ignore=False)
    wall.collides_with = 4
    world.step()
    assert solver.colliders.names == ["table"]


def test_friction_of_a_pair():
    """A pair's own coefficient reaches the colliders by name; a body's own reaches a new solver."""
    world, towel = room()
    world.attach(towel, Cloth(friction=0.3))
    world.set_friction("table", towel, 0.8)
    world.run(0.1)
    before = towel.vertices
    assert towel._dynamics.solver.colliders.pairs == {"table": 0.8}
    towel.friction = 0.0
    assert towel._dynamics.solver.friction == 0.0
    np.testing.assert_array_equal(towel.vertices, before)
    world.set_friction("table", towel, None)
    world.step()
    assert towel._dynamics.solver.colliders.pairs == {}


def test_friction_and_thickness_of_the_material_stay_after_detach():
    """A cloth keeps its last material's friction and thickness as a static body."""
    world, towel = room()
    world.attach(towel, Cloth(friction=0.9, thickness=0.002))
    world.detach(towel)
    assert towel.friction == 0.9 and towel.thickness == 0.002 and world.find("table").thickness == 0.0


def test_grip_follows_a_path_with_its_offsets():
    """The mean of the points goes where the path goes; offsets stay, and turn with its quaternions."""
    world, towel = room()
    world.attach(towel)
    shape = towel.vertices
    turned = (np.sqrt(0.5), 0, 0, np.sqrt(0.5))
    path = Path([0.0, 1.0], [(0, 0, 2), (0, 0, 3)], [(1, 0, 0, 0), turned])
    grip = world.grip(towel, [0, 3], to=path, compliance=1e-4)
    world.run(1.0)
    offset = 0.5 * (shape[0] - shape[3])
    quarter = np.array((-offset[1], offset[0], 0))
    np.testing.assert_allclose(towel.vertices[[0, 3]], quarter * [[1], [-1]] + [[0, 0, 3]], atol=NEAR)
    assert grip.active and grip.compliance == 1e-4
    grip.release()
    grip.release()
    assert not grip.active
    world.step()
    assert towel._dynamics.solver.grips == []


def test_grip_keeps_the_paths_keys_where_nothing_turns():
    """A minimum-jerk path reaches the solver as its own keys."""
    world, towel = room()
    world.attach(towel)
    path = Path([0.0, 1.0], [(0, 0, 2), (0, 0, 3)], interpolation="minimum_jerk")
    world.grip(towel, towel.at([0.25, 0.75], 0.5), to=path)
    world.step()
    spec = towel._dynamics.solver.grips[0]
    assert spec.interpolation == "minimum_jerk" and spec.positions.shape == (1, 2, 2, 3)
    assert spec.vertices is None and spec.corners.shape == spec.barycentric.shape == (1, 2, 3)
    np.testing.assert_allclose(spec.positions[0, :, 1], [(-0.15, 0, 3), (0.15, 0, 3)], atol=NEAR)


def test_grip_to_a_body_follows_it_within_a_frame():
    """The points keep their places in the leading body's frame; its move takes one frame."""
    world, towel = room()
    hand = world.add(nuno.sphere(0.05, position=(0, 0, 1.5)))
    world.attach(towel)
    start = towel.vertices[0]
    world.grip(towel, 0, to=hand)
    world.run(0.1)
    np.testing.assert_allclose(towel.vertices[0], start, atol=NEAR)
    hand.locate((0, 0, 1.7))
    world.step()
    spec = towel._dynamics.solver.grips[0]
    assert spec.times[1] - spec.times[0] == pytest.approx(1 / 60)
    np.testing.assert_allclose(towel.vertices[0], start + np.array((0, 0, 0.2)), atol=NEAR)
    world.remove(hand)
    assert towel._dynamics.grips == []


def test_pushes_last_as_long_as_they_should():
    """A lasting push is replaced by the next one; one with a duration ends within a run."""
    world, towel = room()
    world.gravity = (0.0, 0.0, 0.0)
    world.attach(towel)
    world.push(towel, np.tile((1.0, 0, 0), (12, 1)), duration=0.25)
    world.run(1.0)
    np.testing.assert_allclose(towel.velocities[:, 0], 0.25, atol=NEAR)  # unit masses
    assert towel._dynamics.pushes == []
    world.push(towel, (12.0, 0, 0))
    world.push(towel, (0, 24.0, 0))
    world.run(0.5)
    assert towel.velocities[:, 1].sum() == pytest.approx(12.0, rel=1e-5)  # 24 N for 0.5 s
    world.push(towel, (0, 0, 0))
    world.run(0.5)
    assert towel.velocities[:, 1].sum() == pytest.approx(12.0, rel=1e-5)


def test_a_diverged_run_keeps_the_last_good_state():
    """A state that is not finite raises with body and time, and nothing has changed."""
    world, towel = room()
    other = world.add(nuno.sheet((1, 1), cells=(1, 1)))
    world.attach(other)
    world.attach(towel)
    world.run(0.5)
    good, rest = towel.vertices, other.vertices
    type(towel._dynamics.solver).diverging = True
    with pytest.raises(SimulationDiverged) as caught:
        world.run(0.5)
    assert caught.value.time == world.time == pytest.approx(0.5)
    np.testing.assert_array_equal(towel.vertices, good)
    np.testing.assert_array_equal(other.vertices, rest)


BAD = {
    "add no body": (lambda w, t: w.add("box"), InvalidInputError),
    "add twice": (lambda w, t: w.add(t), BodyStateError),
    "add a body of another world": (lambda w, t: nuno.World(device="cpu").add(t), BodyStateError),
    "add a pose for two worlds": (
        lambda w, t: w.add(nuno.sphere(1, position=np.zeros((2, 3)))),
        InvalidInputError,
    ),
    "a stranger": (lambda w, t: w.attach(nuno.sheet((1, 1), cells=(1, 1))), BodyStateError),
    "a number for a body": (lambda w, t: w.attach(3), InvalidInputError),
    "attach twice": (lambda w, t: w.attach(t), BodyStateError),
    "a box of cloth": (lambda w, t: w.attach("table", Cloth()), InvalidInputError),
    "attach no material": (lambda w, t: w.attach("rag", "denim"), InvalidInputError),
    "a material that does not fit": (
        lambda w, t: w.attach("rag", Cloth(shear_stiffness=[1, 2, 3])),
        InvalidInputError,
    ),
    "detach a static body": (lambda w, t: w.detach("table"), BodyStateError),
    "grip a static body": (lambda w, t: w.grip("table", 0, to=(0, 0, 0)), BodyStateError),
    "a vertex out of range": (lambda w, t: w.grip(t, [0, 12], to=(0, 0, 0)), InvalidInputError),
    "a vertex below range": (lambda w, t: w.grip(t, -2, to=(0, 0, 0)), InvalidInputError),
    "a vertex that is no index": (lambda w, t: w.grip(t, 0.5, to=(0, 0, 0)), InvalidInputError),
    "no vertex": (lambda w, t: w.grip(t, [], to=(0, 0, 0)), InvalidInputError),
    "a face out of range": (
        lambda w, t: w.grip(t, nuno.SurfacePoints([12], [(1, 0, 0)]), to=(0, 0, 0)),
        InvalidInputError,
    ),
    "a target of nan": (lambda w, t: w.grip(t, 0, to=(0, np.nan, 0)), InvalidInputError),
    "a target that is itself": (lambda w, t: w.grip(t, 0, to=t), InvalidInputError),
    "a path for two worlds": (
        lambda w, t: w.grip(t, 0, to=Path([0.0], np.zeros((2, 1, 3)))),
        InvalidInputError,
    ),
    "negative compliance": (lambda w, t: w.grip(t, 0, to=(0, 0, 0), compliance=-1), InvalidInputError),
    "push a static body": (lambda w, t: w.push("table", (0, 0, 1)), BodyStateError),
    "push by nan": (lambda w, t: w.push(t, (0, 0, np.nan)), InvalidInputError),
    "push five vertices": (lambda w, t: w.push(t, np.zeros((5, 3))), InvalidInputError),
    "push for no time": (lambda w, t: w.push(t, (0, 0, 1), duration=0), InvalidInputError),
    "friction with itself": (lambda w, t: w.set_friction(t, t, 0.5), InvalidInputError),
    "negative friction": (lambda w, t: w.set_friction(t, "table", -0.5), InvalidInputError),
    "friction by body": (lambda w, t: setattr(t, "friction", np.nan), InvalidInputError),
    "friction of two worlds": (lambda w, t: setattr(t, "friction", [0.1, 0.2]), InvalidInputError),
    "locate by nan": (lambda w, t: t.locate((0, 0, np.nan)), InvalidInputError),
    "locate for two worlds": (lambda w, t: w.find("table").locate(np.zeros((2, 3))), InvalidInputError),
    "run backwards": (lambda w, t: w.run(-1.0), InvalidInputError),
    "run for ever": (lambda w, t: w.run(np.inf), InvalidInputError),
    "start at no speed": (lambda w, t: w.start(0.0), InvalidInputError),
    "imagine nothing": (lambda w, t: w.imagine(0), InvalidInputError),
    "adopt a stranger": (lambda w, t: w.adopt(nuno.World(device="cpu"), 0), InvalidInputError),
    "adopt out of range": (lambda w, t: w.adopt(w.imagine(2), 2), InvalidInputError),
    "restore a number": (lambda w, t: w.restore(3), InvalidInputError),
    "a static state": (lambda w, t: w.state("table"), BodyStateError),
    "no such device": (lambda w, t: nuno.World(device="gpu"), InvalidInputError),
    "gravity of nan": (lambda w, t: nuno.World(gravity=(0, 0, np.nan)), InvalidInputError),
    "no frames": (lambda w, t: nuno.World(frame_rate=0), InvalidInputError),
    "no substeps": (lambda w, t: nuno.World(substeps=0), InvalidInputError),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_inputs_change_nothing(name):
    """Every bad input raises its named error, and the world stays as it was."""
    act, error = BAD[name]
    world, towel = room()
    world.add(nuno.sheet((1, 1), cells=(2, 1), name="rag"))
    world.attach(towel)
    world.run(0.1)
    vertices, bodies, time = towel.vertices, world.bodies, world.time
    with pytest.raises(error):
        act(world, towel)
    np.testing.assert_array_equal(towel.vertices, vertices)
    assert world.bodies == bodies and world.time == time and not world.is_running
    assert towel._dynamics.grips == [] and towel._dynamics.pushes == []
    assert towel.friction == 0.5 and not world.find("rag").is_dynamic


def test_cloth_mesh_with_its_own_rest_shape():
    """A garment's pattern reaches the solver as its rest shape; per-face materials have its faces."""
    world = nuno.World(device="cpu")
    vertices = [(0, 0, 1.0), (1, 0, 1), (0, 1, 1), (1, 1, 1.5)]
    faces, rest = [(0, 1, 2), (1, 3, 2)], [(0, 0), (1, 0), (0, 1), (1, 1.0)]
    body = world.add(nuno.cloth_mesh(vertices, faces, rest))
    world.attach(body, Cloth(shear_stiffness=[100.0, 200.0]))
    np.testing.assert_array_equal(body.vertices, np.float32(vertices))
    np.testing.assert_array_equal(body.shape.rest, rest)
    world.run(0.1)
    world.detach(body)


class Mill:
    """A driver that does nothing."""

    def __repr__(self):
        return "<mill>"

    def begin_frame(self, start, end):
        """Nothing."""

    end_frame = cancel_frame = load = lambda self, *_: None

    def save(self):
        """Nothing."""


def test_imagined_worlds_are_without_drivers_and_say_so(caplog):
    """Once of each driver, by name, and what becomes of what it moves; never of a world that has none."""
    world = nuno.World(device="cpu")
    world.imagine(2)
    assert not caplog.messages
    world.drivers.append(Mill())
    for _ in range(2):
        assert not world.imagine(2).drivers
    assert len(caplog.messages) == 1
    assert "<mill>" in caplog.messages[0] and "stands still" in caplog.messages[0]


def test_body_added_twice_in_its_place_is_told_of(caplog):
    """A cell that runs again doubles what it adds; the warning names both, and what lies elsewhere is left alone."""
    world = nuno.World(device="cpu")
    with caplog.at_level("WARNING", logger="nuno"):
        for _ in range(2):
            world.add(nuno.box((0.1, 0.1, 0.1), name="cup", position=(0, 0, 0.05)))
        assert [record.getMessage() for record in caplog.records if "'cup_1'" in record.getMessage()]
        assert "nuno.World()" in caplog.text
        caplog.clear()
        world.add(nuno.box((0.1, 0.1, 0.1), name="cup", position=(0, 0, 0.3)))
        world.add(nuno.sphere(0.05, name="cup", position=(0, 0, 0.05)))
    assert not caplog.records
