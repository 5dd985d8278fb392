"""What contacts gave bodies of MuJoCo in a frame, beside what it did to their momentum."""

import numpy as np
import pytest

import nuno

pytest.importorskip("mujoco", minversion="4.0")

FRAME = 1.0 / 60.0


def test_impulses_are_what_momentum_lacks():
    """A box lands on two others: of each, in every frame, m dv - m g dt is what the others gave it, to 1e-6 N s."""
    world = nuno.World(device="cpu", engine="mujoco")
    world.add(nuno.plane(name="floor"))
    low = [
        world.attach(world.add(nuno.box((0.1, 0.1, 0.1), position=(x, 0.0, 0.05), name=f"low {x}")))
        for x in (-0.07, 0.07)
    ]
    top = world.attach(world.add(nuno.box((0.3, 0.1, 0.05), position=(0.01, 0.0, 0.16), name="top")))
    bodies, unasked = [*low, top], world.imagine(1)
    for _ in range(20):
        before = [body.velocity for body in bodies]
        world.step()
        unasked.step()
        for body, velocity in zip(bodies, before, strict=True):
            given = world.contacts(body).impulses
            gained = body.mass * (body.velocity - velocity - FRAME * np.array((0.0, 0.0, -9.81)))
            np.testing.assert_allclose(sum(given.values(), np.zeros(3)), gained, atol=1e-6)
    found = world.contacts(top).impulses
    assert set(found) == {"low -0.07", "low 0.07"}
    np.testing.assert_allclose(found["low 0.07"], -world.contacts(low[1]).impulses["top"], atol=0.0)
    # a frame is gone through once more to tell of it, which changes nothing
    np.testing.assert_array_equal(unasked.find("top").position, top.position)
    world.add(nuno.sphere(0.05, position=(1.0, 0.0, 1.0)))
    np.testing.assert_array_equal(world.contacts(top).impulses["low 0.07"], found["low 0.07"])


def test_impulses_of_a_cloth_on_a_floor_are_its_weight():
    """Asked for by sum_impulses, at rest: m g dt of all frames, within 1 %; of each world of a batch its own."""
    world = nuno.World(device="cpu", engine="mujoco")
    world.add(nuno.plane(name="floor"))
    world.attach(world.add(nuno.sheet((0.1, 0.1), cells=(3, 3), position=(0.0, 0.0, 0.002), name="cloth")))
    batch = world.imagine(2)
    batch.set_material("cloth", nuno.Cloth(area_density=np.array([0.1, 0.3]), air_drag=3.0))
    batch.run(0.2)
    assert batch.contacts("cloth").impulses == {}
    batch.sum_impulses("cloth")
    batch.run(0.3)
    found = batch.contacts("cloth").impulses["floor"]
    np.testing.assert_allclose(found[:, 2], 9.81 * FRAME * 0.01 * np.array([0.1, 0.3]), rtol=0.01)


def test_nothing_is_known_before_the_first_frame():
    """Neither of a new world nor of one that was restored."""
    world = nuno.World(device="cpu", engine="mujoco")
    world.add(nuno.plane(name="floor"))
    box = world.attach(world.add(nuno.box((0.1, 0.1, 0.1), position=(0.0, 0.0, 0.05))))
    hinge = nuno.hinge(box, None, point=(0.0, 0.0, 0.05), axis=(0.0, 0.0, 1.0))
    assert world.contacts(box).impulses == {}
    np.testing.assert_array_equal(hinge.wrench, np.zeros((2, 3)))
    world.step()
    assert world.contacts(box).impulses or np.any(hinge.wrench)
    world.restore(world.save())
    assert world.contacts(box).impulses == {} and hinge.effort == 0.0
