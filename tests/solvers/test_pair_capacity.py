"""Lists of candidate pairs have room for cloth in many layers, and get more where that does not do."""

import logging

import numpy as np
import pytest

import nuno
from nuno.solvers import pair_capacity

GAP = 0.004
"""[m] Between layers, and the cloth's thickness: each touches the next."""


def folded(device, cells=24, side=0.6, layers=4, worlds=1):
    """Return a world with a square cloth that is folded into layers of equal width."""
    n, width = cells + 1, side / layers
    x = np.linspace(0.0, side, n)
    layer = np.minimum((x / width).astype(int), layers - 1)
    along = np.where(layer % 2 == 0, x - layer * width, (layer + 1) * width - x)
    vertices = np.stack([np.tile(along, n), np.repeat(x, n), np.tile(layer * GAP, n)], axis=1)
    flat = np.stack([np.tile(x, n), np.repeat(x, n)], axis=1)
    k = np.arange(n * n).reshape(n, n)
    a, b, c, d = (part.ravel() for part in (k[:-1, :-1], k[:-1, 1:], k[1:, :-1], k[1:, 1:]))
    faces = np.concatenate([np.stack([a, b, d], axis=1), np.stack([a, d, c], axis=1)])
    world = nuno.World(device=device, gravity=(0.0, 0.0, 0.0), substeps=10)
    cloth = world.add(nuno.cloth_mesh(vertices, faces, rest=flat, name="cloth"))
    futures = world.imagine(worlds) if worlds > 1 else world
    futures.attach(cloth, nuno.Cloth(thickness=GAP))
    return futures


def accordion(*args, **more):
    """Return the solver of such a cloth after one substep."""
    world = folded(*args, **more)
    world.run(1.0 / 600.0)
    return world.find("cloth")._dynamics.solver


DEVICES = pytest.mark.parametrize("device", ["cpu", pytest.param("cuda:0", marks=pytest.mark.cuda)])


@DEVICES
@pytest.mark.parametrize(("layers", "worlds"), [(4, 1), (8, 1), (4, 3)])
def test_layers_fit_the_lists(device, layers, worlds):
    """Four layers have more than twice the candidates of the room for wrinkled cloth, 6 and 16 a vertex."""
    solver = accordion(device, layers=layers, worlds=worlds)
    listed = solver.pair_counts
    least = (6 * solver.particle_count, 16 * solver.particle_count)
    room = (solver._size.vertex_triangle, solver._size.edge_edge)
    assert (listed > least).all(axis=1).all()
    assert (listed < room).all()


def test_many_worlds_have_less_room(monkeypatch):
    """Where memory is short each gets what a wrinkled cloth needs at first."""
    monkeypatch.setattr(pair_capacity, "LISTS", 1.0e6)
    solver = folded("cpu", worlds=3).find("cloth")._dynamics.solver
    n = solver.particle_count
    assert (solver._size.vertex_triangle, solver._size.edge_edge) == (6 * n + 64, 16 * n + 128)


@pytest.fixture
def scarce(monkeypatch):
    """Lists that are too short for any fold: four layers have 9 to 15 vertex-triangle pairs a vertex."""
    monkeypatch.setattr(pair_capacity, "PAIRS", (1, 1))
    monkeypatch.setattr(pair_capacity, "MORE", 1.0)
    monkeypatch.setattr(pair_capacity, "SUSPECTS", 8)


@DEVICES
@pytest.mark.parametrize(("cells", "worlds"), [(24, 1), (24, 3), pytest.param(70, 1, marks=pytest.mark.cuda)])
def test_short_lists_grow_and_change_no_bit(device, cells, worlds, request):
    """What is listed beside what touches changes nothing: the same with lists that had to grow, frame by frame.

    Both are told of every frame once, and of the state that comes of all contacts.
    """

    def fallen(seconds=0.1):
        world = folded(device, cells=cells, worlds=worlds)
        cloth, told = world.find("cloth"), []
        world.push(cloth, np.array([0.0, 0.3, -0.5]), duration=0.05)
        world.run(0.5 * seconds)
        world.run(0.5 * seconds, each_frame=lambda time: told.append((time, cloth.vertices)))
        return cloth, told

    ample, frames = fallen()
    request.getfixturevalue("scarce")
    grown, told = fallen()
    assert grown._dynamics.solver._size.edge_edge > 2 * grown._dynamics.solver.particle_count
    assert (grown._dynamics.solver.pair_counts[:, 1] > grown._dynamics.solver.particle_count + 128).all()
    assert [time for time, _ in told] == [time for time, _ in frames]
    for (_, vertices), (_, own) in zip(told, frames, strict=True):
        np.testing.assert_array_equal(vertices, own)
    np.testing.assert_array_equal(grown.velocities, ample.velocities)
    assert not np.any(grown.missed_contacts)


@DEVICES
def test_traces_are_of_what_all_contacts_come_to(device, request):
    """A trace is taken while the run goes on, and once more from its start where lists were too short."""
    times = np.arange(1, 7) / 60.0
    ample = folded(device).trace("cloth", times)
    request.getfixturevalue("scarce")
    world = folded(device)
    solver = world.find("cloth")._dynamics.solver
    room = solver._size.edge_edge
    np.testing.assert_array_equal(world.trace("cloth", times), ample)
    assert solver._size.edge_edge > room


def test_all_goes_back_where_lists_were_short(request):
    """What touches the cloth, and what leads a grip and was moved before the run, go the same way once more."""

    def held():
        world = folded("cpu")
        cloth = world.find("cloth")
        hand = world.add(nuno.sphere(0.01, position=(0.0, 0.0, 0.3), name="hand"))
        world.ignore_contact(hand, cloth)
        world.grip(cloth, [0, 1], to=hand)
        box = world.add(nuno.box((0.04, 0.04, 0.04), position=(0.08, 0.3, 0.045), name="box"))
        world.attach(box, nuno.Rigid(mass=0.05))
        world.push(box, (0.0, 0.0, -0.5))
        world.run(1.0 / 60.0)
        hand.translate((0.0, 0.0, 0.005))
        world.run(0.1)
        return cloth.vertices, box.position

    vertices, position = held()
    request.getfixturevalue("scarce")
    again, place = held()
    np.testing.assert_array_equal(again, vertices)
    np.testing.assert_array_equal(place, position)
    assert position[2] < 0.045 and vertices[:2, 2].mean() > 0.004  # the box was pushed down, the hand lifted


@pytest.mark.parametrize(
    "plan", ["vector", pytest.param("fused", marks=pytest.mark.long), pytest.param("grid", marks=pytest.mark.long)]
)
def test_every_plan_tells_that_its_lists_were_short(plan, scarce):
    """A list that was too short is told of also where a later one, of a cloth that unfolded, was not."""
    cloth = folded("cpu").find("cloth")
    own = cloth._dynamics.solver
    solver = type(own)(
        own.topology, cloth.material, own.positions(), own.velocities(), gravity=(0.0, 0.0, 0.0), plan=plan
    )
    solver.run(0.0, 0.005)
    apart = own.topology.rest if own.topology.rest.shape[-1] == 3 else np.pad(own.topology.rest, ((0, 0), (0, 1)))
    solver.set_state(apart[None], np.zeros_like(apart)[None])
    solver.run(0.0, 0.005)
    assert (solver.pair_counts < (solver._size.vertex_triangle, solver._size.edge_edge)).all()
    assert solver.make_room()
    assert not solver.make_room()
    assert not solver.missed.any()


def test_contacts_that_find_no_memory_are_told_of(monkeypatch, caplog, scarce):
    """Where lists may not grow the run goes on, with one warning for the body and a flag.

    Of 12 cells, as finer cloth whose contacts are passed over crumples so that looking for them takes half a minute.
    """
    monkeypatch.setattr(pair_capacity, "MAX_LIST_BYTES", 1.0e4)
    world = folded("cpu", cells=12, worlds=3)
    cloth = world.find("cloth")
    assert not np.any(cloth.missed_contacts)
    with caplog.at_level(logging.WARNING, "nuno"):
        world.run(0.1)
        world.run(0.1)
    # what comes of contacts that are passed over is another warning's
    assert [record.levelname for record in caplog.records if record.name == "nuno.dynamics.dynamics"] == ["WARNING"]
    assert "'cloth'" in caplog.text
    assert cloth.missed_contacts.tolist() == [True, True, True]
    assert np.isfinite(cloth.vertices).all()
