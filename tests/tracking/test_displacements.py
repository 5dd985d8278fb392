"""Displacement fields, normals and directions at rims: closed forms."""

import numpy as np

from nuno.tracking.displacements import COHERENCE, REST, DisplacementField, Rim, vertex_normals


def flat(columns=5, rows=4):
    """Return vertices (n, 3) and faces (m, 3) of a flat grid of unit cells."""
    x, y = np.meshgrid(np.arange(columns, dtype=float), np.arange(rows, dtype=float))
    vertices = np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1)
    quads = [(j * columns + i, j * columns + i + 1) for j in range(rows - 1) for i in range(columns - 1)]
    return vertices, np.array([t for a, b in quads for t in ((a, b, b + columns), (a, b + columns, a + columns))])


def test_a_shift_that_all_vertices_tell_of_is_found():
    """With full information everywhere, smoothness costs a shift nothing; the pull to rest costs one part in 1001."""
    vertices, faces = flat()
    shift = np.tile([0.01, -0.02, 0.03], (len(vertices), 1))
    information = np.tile(np.eye(3), (len(vertices), 1, 1))
    found = DisplacementField(len(vertices), faces).solve(information, shift)
    np.testing.assert_allclose(found, shift / 1.001, rtol=1e-9)


def test_what_one_vertex_tells_goes_to_all():
    """One vertex that tells of x alone moves the sheet along x, most where it is, and nothing along y and z."""
    vertices, faces = flat()
    information, residuals = np.zeros((len(vertices), 3, 3)), np.zeros((len(vertices), 3))
    information[0, 0, 0], residuals[0, 0] = 1.0, 0.01
    found = DisplacementField(len(vertices), faces).solve(information, residuals)
    assert (found[:, 1:] == 0.0).all()
    assert found[:, 0].argmax() == 0 and 0.009 < found[-1, 0] < 0.01  # rest weighs 0.001 for each of 20 vertices


def test_the_field_solves_its_equations():
    """Of random information on a grid, each vertex's balance of what it knows, its neighbours and rest is zero."""
    vertices, faces = flat(7, 6)
    n, rng = len(vertices), np.random.default_rng(3)
    roots = rng.normal(size=(n, 3, 3)) * (rng.random((n, 1, 1)) < 0.6)
    information = roots @ roots.transpose(0, 2, 1)
    residuals = (information @ rng.normal(size=(n, 3, 1)))[..., 0]
    found = DisplacementField(n, faces).solve(information, residuals)
    balance = (information @ found[..., None])[..., 0] + REST * found - residuals
    for a, b in {tuple(sorted(side)) for face in faces for side in zip(face, np.roll(face, 1), strict=True)}:
        balance[a] += COHERENCE * (found[a] - found[b])
        balance[b] += COHERENCE * (found[b] - found[a])
    np.testing.assert_allclose(balance, 0.0, atol=1e-12)  # doubles, of residuals of order 1


def test_nothing_told_is_nothing_moved():
    """Without residuals the field is exactly zero."""
    vertices, faces = flat()
    field = DisplacementField(len(vertices), faces)
    assert not field.solve(np.tile(np.eye(3), (len(vertices), 1, 1)), np.zeros_like(vertices)).any()


def test_normals_and_rims_of_a_flat_grid():
    """Normals are z; at sides the way inwards is across the side, at corners between both, within there is none."""
    vertices, faces = flat()
    np.testing.assert_allclose(vertex_normals(vertices, faces), np.tile([0.0, 0, 1], (len(vertices), 1)), atol=1e-12)
    inwards = Rim(faces).inwards(vertices).reshape(4, 5, 3)
    np.testing.assert_allclose(inwards[0, 1:-1], np.tile([0.0, 1, 0], (3, 1)), atol=1e-12)
    np.testing.assert_allclose(inwards[1:-1, -1], np.tile([-1.0, 0, 0], (2, 1)), atol=1e-12)
    np.testing.assert_allclose(inwards[0, 0], np.array([1.0, 1, 0]) / np.sqrt(2.0), atol=1e-12)
    assert not inwards[1:-1, 1:-1].any()
