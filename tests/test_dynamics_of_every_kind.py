"""Dynamics that come, go and change in a running world, for cloth, soft and rigid bodies together."""

import numpy as np
import pytest

import nuno

FOAM = nuno.Soft(density=300.0, damping=0.05)


def room(worlds=1):
    """A soft cube and a box falling onto a towel that is held at its corners, and a box welded below another."""
    world = nuno.World(device="cpu")
    world.add(nuno.plane(name="floor"))
    towel = world.add(nuno.sheet((0.2, 0.2), (8, 8), position=(0.0, 0.0, 0.4), name="towel"))
    cube = world.add(nuno.soft_box((0.05, 0.05, 0.05), (2, 2, 2), position=(-0.04, 0.0, 0.44), name="cube"))
    box = world.add(nuno.box((0.04, 0.04, 0.04), position=(0.05, 0.0, 0.43), name="box"))
    low = world.add(nuno.box((0.04, 0.04, 0.04), position=(0.05, 0.0, 0.2), name="low"))
    world.attach(towel, nuno.Cloth(area_density=0.3))
    world.attach(cube, FOAM)
    world.attach(box, nuno.Rigid(mass=0.05))
    world.attach(low, nuno.Rigid(mass=0.05))
    for corner in (0, 8, 72, 80):
        world.grip(towel, [corner], to=towel.vertices[corner])
    world.weld(low, box)
    return world.imagine(worlds) if worlds > 1 else world


def shapes(world, k=None):
    """The vertices of all bodies, of world k of a batch."""
    return {body.name: body.vertices if k is None else body.vertices[k] for body in world.bodies}


def assert_same(one, other):
    """All vertices, bit for bit."""
    assert one.keys() == other.keys()
    for name, vertices in one.items():
        np.testing.assert_array_equal(other[name], vertices, err_msg=name)


def test_the_same_bits_again():
    """Promise: same input, same bits, with contacts, friction and ties between bodies."""
    first, second = room(), room()
    first.run(0.5)
    second.run(0.5)
    assert_same(shapes(first), shapes(second))


def test_saved_and_restored_with_ties(tmp_path):
    """A world restored in memory, and in a new world from a file, goes on bit for bit."""
    world = room()
    world.run(0.2)
    saved = world.save(tmp_path / "state.npz")
    world.run(0.2)
    after = shapes(world)
    world.restore(saved)
    world.run(0.2)
    assert_same(after, shapes(world))
    other = nuno.World(device="cpu")
    other.restore(tmp_path / "state.npz")
    other.run(0.2)
    assert_same(after, shapes(other))


def test_imagined_and_adopted():
    """Every world of a batch goes on as the single one does, bit for bit, and one of them can be adopted."""
    world = room()
    world.run(0.2)
    futures = world.imagine(2)
    futures.run(0.2)
    before = shapes(world)
    saved = world.save()
    world.run(0.2)
    after = shapes(world)
    for k in range(2):
        dynamic = {name: v for name, v in after.items() if name != "floor"}
        assert_same(dynamic, {name: futures.find(name).vertices[k] for name in dynamic})
    world.restore(saved)
    assert_same(before, shapes(world))
    world.adopt(futures, 1)
    assert_same(after, shapes(world))


def test_a_cloth_recognised_first_as_rigid_keeps_its_shape():
    """A deformed cloth is made rigid, falls and lands as it is; then cloth again: pose and shape keep every bit."""
    world = nuno.World(device="cpu")
    world.add(nuno.plane())
    cloth = world.add(nuno.sheet((0.2, 0.2), (8, 8), position=(0.0, 0.0, 0.3)))
    world.attach(cloth)
    grip = world.grip(cloth, [0], to=cloth.vertices[0])
    world.run(0.4)
    grip.release()
    bent = cloth.vertices
    world.detach(cloth)
    np.testing.assert_array_equal(cloth.vertices, bent)
    world.attach(cloth, nuno.Rigid(mass=0.05))
    np.testing.assert_allclose(cloth.vertices, bent, atol=1e-7)  # a pose in float32 about an origin of the scene
    world.run(1.0)
    fallen = cloth.vertices
    own = np.linalg.norm(bent[:, None] - bent[None], axis=-1)
    # distances of a rigid body: float32 quaternions are of length 1 within 1e-7
    np.testing.assert_allclose(np.linalg.norm(fallen[:, None] - fallen[None], axis=-1), own, atol=1e-6)
    assert -2e-3 < fallen[:, 2].min() < 5e-3
    world.detach(cloth)
    np.testing.assert_array_equal(cloth.vertices, fallen)
    world.attach(cloth, nuno.Cloth())
    np.testing.assert_allclose(cloth.vertices, fallen, atol=1e-7)
    world.run(0.5)
    assert np.isfinite(cloth.vertices).all() and cloth.vertices[:, 2].max() < fallen[:, 2].max() + 0.02


def test_a_soft_body_as_rigid_and_back():
    """A soft cube is made rigid and soft again: it lands as either."""
    world = nuno.World(device="cpu")
    world.add(nuno.plane())
    cube = world.add(nuno.soft_box((0.1, 0.1, 0.1), (2, 2, 2), position=(0.0, 0.0, 0.1)))
    for material in (FOAM, nuno.Rigid(mass=0.3), FOAM, nuno.Soft(youngs_modulus=1e5, density=300.0)):
        before = cube.vertices
        world.attach(cube, material)
        np.testing.assert_allclose(cube.vertices, before, atol=1e-7)
        world.run(0.3)
        after = cube.vertices
        world.detach(cube)
        np.testing.assert_array_equal(cube.vertices, after)
    assert cube.vertices[:, 2].min() == pytest.approx(0.0, abs=1e-3)


def test_a_material_changes_in_motion():
    """Shape and velocity stay where a material changes; a body of another kind is refused."""
    world = room()
    world.run(0.2)
    for name, material in (("towel", nuno.Cloth(area_density=0.5)), ("cube", nuno.Soft(density=100.0)),
                           ("box", nuno.Rigid(mass=0.1))):  # fmt: skip
        body = world.find(name)
        x, v = body.vertices, body.velocities
        world.set_material(body, material)
        np.testing.assert_allclose(body.vertices, x, atol=1e-7)
        np.testing.assert_allclose(body.velocities, v, atol=1e-5)
    with pytest.raises(nuno.BodyStateError):
        world.set_material("box", FOAM)
    world.run(0.2)
    assert all(np.isfinite(body.vertices).all() for body in world.bodies)


def test_what_happens_far_away_changes_no_bit():
    """Bodies far from all others go on bit for bit, whatever is attached, tied, detached or removed elsewhere."""

    def far(also):
        world = nuno.World(device="cpu")
        world.add(nuno.plane())
        cloth = world.add(nuno.sheet((0.2, 0.2), (6, 6), position=(5.0, 0.0, 0.1), name="cloth"))
        box = world.add(nuno.box((0.1, 0.1, 0.1), position=(-5.0, 0.0, 0.1), name="box"))
        cube = world.add(nuno.soft_box((0.1, 0.1, 0.1), (2, 2, 2), position=(0.0, 5.0, 0.1), name="cube"))
        world.attach(cloth)
        world.attach(box)
        world.attach(cube)
        if also:
            a = world.add(nuno.sheet((0.1, 0.1), (4, 4), position=(0.0, 0.0, 0.3)))
            b = world.add(nuno.box((0.05, 0.05, 0.05), position=(0.0, 0.0, 0.35)))
        for k in range(12):
            if also and k == 2:
                world.attach(a)
                world.attach(b)
            if also and k == 4:
                world.weld(a, b, [0, 1])
            if also and k == 8:
                world.detach(a)
            if also and k == 10:
                world.remove(b)
            world.run(0.05)
        return {name: world.find(name).vertices for name in ("cloth", "box", "cube")}

    assert_same(far(False), far(True))


@pytest.mark.parametrize("after", [0.1, 0.05])
@pytest.mark.parametrize("kind", ["rigid", "cloth"])
def test_a_timed_push_ends_in_copies(kind, after):
    """1 N for 0.1 s on 1 kg: 0.1 m/s, and x = 0.005 + 0.1 t; it acted for ever after restore or imagine."""
    world = nuno.World(device="cpu", gravity=(0, 0, 0))
    if kind == "rigid":
        body = world.add(nuno.box((0.1, 0.1, 0.1), name="body"))
        world.attach(body, nuno.Rigid(mass=1.0))
    else:
        body = world.add(nuno.sheet((1.0, 1.0), (2, 2), name="body"))
        world.attach(body, nuno.Cloth(area_density=1.0, air_drag=0.0))
    world.push(body, (1.0, 0.0, 0.0), duration=0.1)
    world.run(after)
    saved, futures = world.save(), world.imagine(2)
    for _ in range(2):
        world.run(1.1 - after)
        assert body.vertices[:, 0].mean() == pytest.approx(0.105, abs=5e-4)  # symplectic Euler: 0.1 dt a T / 2 more
        world.restore(saved)
    futures.run(1.1 - after)
    world.run(1.1 - after)
    np.testing.assert_array_equal(futures.find("body").vertices, np.repeat(body.vertices[None], 2, axis=0))


def test_pushes_end_at_instants_that_rounding_alone_keeps_apart():
    """Two pushes that both end at 0.3 s, but for rounding, end together, also where something follows a path."""
    world = nuno.World(device="cpu", gravity=(0, 0, 0))
    boxes = [world.add(nuno.box((0.1, 0.1, 0.1), position=(x, 0, 1.0))) for x in (0.0, 1.0)]
    rail = world.add(nuno.box((0.1, 0.1, 0.1)))
    for box in boxes:
        world.attach(box, nuno.Rigid(mass=1.0))
    world.push(boxes[0], (1.0, 0, 0), duration=0.3)
    world.run(0.1)
    world.push(boxes[1], (1.0, 0, 0), duration=0.2)
    ends = [box._dynamics.pushes[0].end for box in boxes]
    assert 0 < abs(ends[1] - ends[0]) < 1e-15
    world.move(rail, nuno.Path([0.0, 1.0], [(0, 0, 0), (0, 0, -1)]))
    world.attach(world.add(nuno.sheet((0.1, 0.1), cells=(2, 2), position=(3, 0, 0))))
    world.run(0.5)
    np.testing.assert_allclose([box.velocity[0] for box in boxes], [0.3, 0.2], rtol=1e-5)


def test_a_shape_that_differs_by_world_is_not_made_rigid():
    """A rigid body has one shape in all worlds: it is refused, changes nothing, and is taken where the worlds agree."""
    world = nuno.World(device="cpu", substeps=5)
    cloth = world.attach(world.add(nuno.sheet((0.1, 0.1), (3, 3), name="cloth", position=(0.0, 0.0, 1.0))))
    world.grip(cloth, [0], to=(0.0, 0.0, 1.0))
    same, apart = world.imagine(2), world.imagine(2)
    apart.push("cloth", [(0.0, 0.0, 0.0), (0.1, 0.0, 0.0)])
    for batch in (same, apart):
        batch.run(0.1)
        batch.detach("cloth")
    same.attach("cloth", nuno.Rigid(mass=0.1))
    before = apart.find("cloth").vertices
    with pytest.raises(nuno.BodyStateError, match="'cloth' is deformed otherwise in each world"):
        apart.attach("cloth", nuno.Rigid(mass=0.1))
    assert not apart.find("cloth").is_dynamic
    np.testing.assert_array_equal(apart.find("cloth").vertices, before)
    alone = apart.imagine(1, world=1)
    alone.attach("cloth", nuno.Rigid(mass=0.1))
    np.testing.assert_allclose(alone.find("cloth").vertices, before[1], atol=1e-6)  # floats
