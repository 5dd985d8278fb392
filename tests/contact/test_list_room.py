"""Lists of candidate pairs have room for cloth in many layers: what did not fit would be passed over."""

import numpy as np
import pytest

import nuno
from nuno.solver import cloth_solver

GAP = 0.004
"""[m] Between layers, and the cloth's thickness: each touches the next."""


def accordion(device, cells=24, side=0.6, layers=4, worlds=1):
    """Return the solver of a square cloth that is folded into layers of equal width, after one substep."""
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
    futures.run(1.0 / 600.0)
    return futures.find("cloth")._dynamics.solver


@pytest.mark.parametrize("device", ["cpu", pytest.param("cuda:0", marks=pytest.mark.cuda)])
@pytest.mark.parametrize(("layers", "worlds"), [(4, 1), (8, 1), (4, 3)])
def test_layers_fit_the_lists(device, layers, worlds):
    """Four layers have more than twice the candidates of the room for crumpled cloth, 6 and 16 a vertex."""
    solver = accordion(device, layers=layers, worlds=worlds)
    listed = solver.pair_counts
    least = (6 * solver.particle_count, 16 * solver.particle_count)
    room = (solver._size.vertex_triangle, solver._size.edge_edge)
    assert (listed > least).all(axis=1).all()
    assert (listed < room).all()


def test_many_worlds_have_less_room(monkeypatch):
    """Where memory is short each gets what a crumpled cloth needs."""
    monkeypatch.setattr(cloth_solver, "LISTS", 1.0e6)
    solver = accordion("cpu", worlds=3)
    n = solver.particle_count
    assert (solver._size.vertex_triangle, solver._size.edge_edge) == (6 * n + 64, 16 * n + 128)
