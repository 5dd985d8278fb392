"""The nearest points on triangles and segments, against dense samples and closed forms."""

import numpy as np
import pytest
import trimesh

from nuno.mesh.nearest import NearestOn, nearest_on_segment, nearest_on_triangle


def test_nearest_on_a_triangle():
    """Faces, edges and corners: the foot where it is inside, otherwise the nearest point of the border."""
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    points = np.array([[0.2, 0.3, 5.0], [0.5, -2.0, 1.0], [-1.0, -1.0, 0.0], [2.0, 2.0, 0.0], [3.0, -1.0, 0.0]])
    expected = np.array([[0.2, 0.3, 0], [0.5, 0, 0], [0, 0, 0], [0.5, 0.5, 0], [1, 0, 0]])
    found = nearest_on_triangle(points, np.repeat(corners[None], len(points), axis=0))
    np.testing.assert_allclose(found, expected, atol=1e-15)


def test_nearest_on_a_segment():
    """Inside it, and beyond either end."""
    ends = np.repeat(np.array([[[0.0, 0, 0], [2, 0, 0]]]), 3, axis=0)
    found = nearest_on_segment(np.array([[0.5, 1, 1], [-1.0, 1, 0], [5.0, 0, 1]]), ends)
    np.testing.assert_allclose(found, [[0.5, 0, 0], [0, 0, 0], [2, 0, 0]], atol=1e-15)


@pytest.mark.parametrize("longest", [0.05, 10.0])
def test_nearest_on_a_mesh(longest):
    """Every triangle looked at one by one gives the same, whether long ones are divided or not."""
    mesh = trimesh.util.concatenate(
        [trimesh.creation.box((1, 0.5, 0.2)), trimesh.creation.icosphere(3, 0.1).apply_translation((0.8, 0, 0))]
    )  # triangles of 1 m beside some of 1 cm
    corners = np.array(mesh.vertices[mesh.faces])
    points = np.random.default_rng(0).uniform(-1.0, 1.0, (60, 3))
    found = NearestOn(corners, longest).nearest(points)
    for point, on in zip(points, found, strict=True):
        every = nearest_on_triangle(np.repeat(point[None], len(corners), axis=0), corners)
        assert np.linalg.norm(on - point) == pytest.approx(np.linalg.norm(every - point, axis=1).min(), rel=1e-12)


def test_no_points():
    """Nothing is asked, nothing comes back."""
    assert NearestOn(np.eye(3)[None], 1.0).nearest(np.zeros((0, 3))).shape == (0, 3)
