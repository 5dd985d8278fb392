"""Which lines of a rigid body's parts may stand through between the vertices of another."""

import numpy as np
import pytest
import trimesh

import nuno
from nuno.rigid.convex_parts import convex_part, rigid_shape
from nuno.rigid.ridges import Ridges, ridges_of


def part_of(body):
    """Return the only part of a body's shape."""
    (part,) = rigid_shape(body.shape)
    return part


def test_a_box_has_twelve():
    """Geometry: each is a whole side, between the faces whose normals are its."""
    found = ridges_of(part_of(nuno.box((0.2, 0.4, 0.6))), 16)
    lengths = np.linalg.norm(found.end - found.start, axis=1)
    np.testing.assert_allclose(np.sort(lengths), np.repeat([0.2, 0.4, 0.6], 4))
    half = [0.1, 0.2, 0.3]
    for n in (found.left, found.right):
        for x in (found.start, found.end):
            np.testing.assert_allclose(np.einsum("kx,kx->k", x, n), np.abs(n) @ half)
    np.testing.assert_allclose(np.einsum("kx,kx->k", found.left, found.right), 0.0)
    np.testing.assert_allclose(found.depth, 0.1)


def test_inner_edges_of_a_hulls_faces_are_none():
    """Geometry: a hull of a box's corners has the box's edges, however its faces are cut into triangles."""
    box = trimesh.creation.box((0.2, 0.4, 0.6)).subdivide()
    found = ridges_of(convex_part(np.asarray(box.vertices)), 16)
    lengths = np.linalg.norm(found.end - found.start, axis=1)
    # the middles of the edges lie on them, and may stay corners
    assert lengths.sum() == pytest.approx(4 * (0.2 + 0.4 + 0.6))
    np.testing.assert_allclose(np.einsum("kx,kx->k", found.left, found.right), 0.0, atol=1e-9)
    ball = ridges_of(convex_part(np.asarray(trimesh.creation.icosphere(2, 0.1).vertices)), 16)
    assert len(ball.start) == 480  # all of a ball of 320 triangles, which meet at 10 degrees and more


def test_a_cylinder_has_rims_and_an_axis():
    """Geometry: the rims' sides touch the circle at their ends; the axis is as thick as the cylinder."""
    found = ridges_of(part_of(nuno.cylinder(0.1, 0.3)), 24)
    assert len(found.start) == 2 * 24 + 1
    np.testing.assert_allclose(np.hypot(*found.start[:-1, :2].T), 0.1)
    np.testing.assert_allclose(np.abs(found.start[:, 2]), 0.15)
    np.testing.assert_allclose(found.radius, [*[0.0] * 48, 0.1])


def test_round_ones_have_none_and_parts_are_placed():
    """Balls and rods meet triangles as balls; a compound's parts have theirs where they stand."""
    none = ridges_of(part_of(nuno.sphere(0.1)), 16)
    assert len(none.start) == len(ridges_of(part_of(nuno.capsule(0.1, 0.2)), 16).start) == 0
    box = ridges_of(part_of(nuno.box((0.2, 0.2, 0.2))), 16)
    half = np.sqrt(0.5)
    moved = box.placed(np.array([1.0, 0.0, 0.0]), np.array([half, 0.0, 0.0, half]))
    np.testing.assert_allclose(moved.start.mean(axis=0) + moved.end.mean(axis=0), [2.0, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(moved.left[:, 0], -box.left[:, 1], atol=1e-12)
    assert len(Ridges.joined([none, box, moved]).radius) == 24
