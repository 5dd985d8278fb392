"""Colours of vertices are those of strains, layers and contact forces."""

import numpy as np
import pytest
from feed import Feed, unpack

import nuno
from nuno.viewer import Viewer
from nuno.viewer.vertex_values import colours_of, vertex_contacts, vertex_layers, vertex_strains


def test_strains_of_a_stretched_sheet():
    """Drawn out by 2 % along x: the largest change of an edge at each vertex is 2 %."""
    sheet = nuno.sheet((0.3, 0.2), cells=(6, 4))
    vertices = sheet.vertices * (1.02, 1.0, 1.0)
    np.testing.assert_allclose(vertex_strains(sheet, vertices), 0.02, rtol=1e-6)


def test_strains_of_a_pressed_cube():
    """Pressed to 90 % along z: Green's strain there is (0.9^2 - 1) / 2."""
    cube = nuno.soft_box((0.1, 0.1, 0.1), cells=(2, 2, 2))
    vertices = cube.vertices * (1.0, 1.0, 0.9)
    np.testing.assert_allclose(vertex_strains(cube, vertices), 0.095, rtol=1e-5)


def test_layers_of_a_folded_sheet():
    """Folded in three along x like a letter: the parts lie on 0, 1 and 2 others."""
    sheet = nuno.sheet((0.3, 0.2), cells=(30, 8))
    flat = sheet.vertices
    along = flat[:, 0] + 0.15
    part = np.minimum((along / 0.1 - 1e-9).astype(int), 2)
    x = np.where(part == 1, 0.2 - along, np.where(part == 2, along - 0.2, along))
    folded = np.column_stack([0.97 * x + 0.001, flat[:, 1], 0.01 * part])
    layers = vertex_layers(sheet.faces, folded)
    inside = (np.abs(flat[:, 1]) < 0.09) & (x > 0.015) & (x < 0.085)  # the folds themselves are steep
    assert inside.sum() > 100
    np.testing.assert_array_equal(layers[inside], part[inside])


def test_contact_forces_of_a_towel_at_rest():
    """They are those of the contacts, and add up to the towel's weight."""
    world = nuno.World(device="cpu")
    world.add(nuno.plane())
    towel = world.add(nuno.sheet((0.2, 0.2), cells=(6, 6), position=(0, 0, 0.003)))
    world.attach(towel, nuno.Cloth.preset("towel"))
    world.run(1.5)
    with world.lock:
        found = vertex_contacts(world, towel)
    assert found.shape == (1, 49)
    contacts = world.contacts(towel)
    # the same numbers, in another order
    assert found.sum() == pytest.approx(np.linalg.norm(contacts.forces, axis=1).sum(), rel=1e-6)
    # contacts are what the next substep makes of them: their sum is the weight within what a resting cloth wobbles
    assert contacts.forces[:, 2].sum() == pytest.approx(towel.mass * 9.81, rel=0.05)


def test_colours_go_from_the_first_to_the_last():
    """viridis: dark violet for the low end and below, yellow for the high end and above."""
    ends = colours_of(np.array([-1.0, 0.0, 2.0, 9.0]), 0.0, 2.0)
    np.testing.assert_array_equal(ends, [(68, 1, 84), (68, 1, 84), (253, 231, 37), (253, 231, 37)])


def test_colours_follow_in_the_page_and_in_films():
    """They are sent when they change, beside the points, in every world of a batch, and are kept in a film."""
    world = nuno.World(device="cpu")
    towel = world.add(nuno.sheet((0.2, 0.2), cells=(6, 6), name="towel", position=(0, 0, 0.5)))
    world.attach(towel, nuno.Cloth.preset("towel"))
    world.grip(towel, [0, 6], to=towel.vertices[[0, 6]].mean(axis=0))
    futures = world.imagine(2)
    with Viewer(futures, frame_rate=1e-3) as viewer:
        viewer.draw("towel", color_by="strain", color_range=(0.0, 0.01))
        viewer.update()
        feed = Feed(viewer)
        first = feed.named("world 1", "towel")["colors"].copy()
        assert first.shape == (3 * 49,)
        film = viewer.record()
        futures.run(0.3)
        film.stop()
        viewer.update()
        feed.wait_for(lambda: "tint" in feed.latest)
        feed.wait_for(lambda: not np.array_equal(feed.named("world 1", "towel")["colors"], first))
        expected = colours_of(vertex_strains(towel, futures.find("towel").vertices[1]), 0.0, 0.01)
        np.testing.assert_array_equal(feed.named("world 1", "towel")["colors"].reshape(-1, 3), expected)
        (kept,) = (track for track in unpack(film.message())[1]["tracks"] if track["path"] == ["world 1", "towel"])
        np.testing.assert_array_equal(kept["tints"]["colors"][-1].reshape(-1, 3), expected)
        assert kept["tints"]["frames"][0] == 0
        feed.say("pick", id=feed.named("world 0", "towel")["id"])
        feed.say("color", by=None)
        feed.wait_for(lambda: feed.named("world 1", "towel")["colors"] is None)


def test_what_has_no_such_value_is_named():
    """And keeps its colour."""
    world = nuno.World(device="cpu")
    world.add(nuno.box((0.1, 0.1, 0.1), name="box"))
    world.add(nuno.sheet((0.1, 0.1), cells=(2, 2), name="towel"))
    with Viewer(world) as viewer:
        for quantity, body in (("strain", "box"), ("layer", "box"), ("beauty", "towel")):
            with pytest.raises(nuno.InvalidInputError, match=r"strain|layers"):
                viewer.draw(body, color_by=quantity)
        with pytest.raises(nuno.InvalidInputError, match="color_range"):
            viewer.draw("towel", color_by="strain", color_range=(1.0, 1.0))
        viewer.draw("box", color_by="contact")
        assert list(viewer._styles.own) == [world.find("box").key]
