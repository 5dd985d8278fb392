"""Clusters of tetrahedra: all elements in one each, and none of a colour in another's way."""

import numpy as np
import pytest

from nuno.mesh.tetrahedra import box_tetrahedra, volumes
from nuno.solvers.soft_solver import rest_shapes
from nuno.topology.soft_topology import SoftTopology


def lattice():
    """A box of 4 x 3 x 5 voxels."""
    return SoftTopology.of(*box_tetrahedra((0.4, 0.3, 0.5), (4, 3, 5)))


def irregular():
    """A lattice that lost every third element, its vertices displaced."""
    vertices, tets = box_tetrahedra((0.4, 0.3, 0.5), (4, 3, 5))
    random = np.random.default_rng(0)
    tets = tets[random.random(len(tets)) < 0.67]
    used, corners = np.unique(tets, return_inverse=True)
    return SoftTopology.of(vertices[used] + random.uniform(-0.02, 0.02, (len(used), 3)), corners.reshape(tets.shape))


@pytest.mark.parametrize("body", [lattice(), irregular()], ids=["lattice", "irregular"])
def test_every_element_is_in_one_cluster_the_right_way_round(body):
    """Invariant: an element's corners in its cluster are its own, of positive volume."""
    found = body.clusters
    there = found.elements >= 0
    assert sorted(found.elements[there]) == list(range(body.element_count))
    corners = found.corners[there]
    np.testing.assert_array_equal(np.sort(corners, axis=1), np.sort(body.tets[found.elements[there]], axis=1))
    assert (volumes(body.rest, corners) > 0.0).all()
    # those that are there come first
    assert (np.diff(there.astype(int), axis=1) <= 0).all()


@pytest.mark.parametrize("body", [lattice(), irregular()], ids=["lattice", "irregular"])
def test_clusters_of_a_colour_share_no_vertex(body):
    """Promise: a colour's clusters may be solved at once."""
    for first, last in zip(body.clusters.offsets, body.clusters.offsets[1:], strict=False):
        own = [set(cluster) for cluster in body.clusters.vertices[first:last].tolist()]
        assert len(set().union(*own)) == sum(map(len, own))


def test_voxels_are_full_clusters_of_eight_colours_and_one_shape():
    """A lattice: five elements a cluster, and as few colours as voxels about a vertex."""
    body = lattice()
    assert (body.clusters.elements >= 0).all()
    assert len(body.clusters.elements) == 60
    assert len(body.clusters.offsets) == 9
    # mirror images have the same numbers, however their coordinates were rounded
    assert len(rest_shapes(body)[0]) == 1


def test_rest_shapes_are_those_of_the_elements():
    """Closed form: of corners 1, 2 and 3, v |grad N|^2; no element, no number."""
    body = irregular()
    shapes, which = rest_shapes(body)
    numbers, found = shapes[which], body.clusters
    there = found.elements >= 0
    assert not numbers[~there].any()
    edges = body.rest[found.corners[there][:, 1:]] - body.rest[found.corners[there][:, :1]]
    gradients = np.linalg.inv(edges)  # columns
    volume = body.volume[found.elements[there]]
    np.testing.assert_allclose(numbers[there][:, :3], (gradients**2).sum(axis=1) * volume[:, None], rtol=1e-6)
    np.testing.assert_allclose(numbers[there][:, 6], 1.0 / (6.0 * volume), rtol=1e-6)  # merged to float32's digits
    assert {size for size in there.sum(axis=1)} == {1, 2, 3, 4, 5}
