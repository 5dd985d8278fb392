"""Meshes that bound no volume: each is told from the others, with what could mend it, and trimesh does mend it."""

import numpy as np
import pytest
import trimesh

from nuno import MeshError
from nuno.mesh.closed import check_closed, enclosed_volume
from nuno.mesh.crossings import crossing_faces


def ball():
    """Return the vertices and faces of a sphere."""
    mesh = trimesh.creation.icosphere(1, 0.1)
    return np.array(mesh.vertices), np.array(mesh.faces)


def two(shift, second=None):
    """Return a box and another, moved, as one mesh."""
    other = (second or trimesh.creation.box((1, 1, 1))).apply_translation(shift)
    mesh = trimesh.util.concatenate([trimesh.creation.box((1, 1, 1)), other])
    return np.array(mesh.vertices), np.array(mesh.faces)


def brute_crossings(vertices, faces):
    """Return the pairs of faces of which an edge passes through the other: every edge against every face."""
    found = set()
    for i, one in enumerate(faces):
        for p, q in ((one[0], one[1]), (one[1], one[2]), (one[2], one[0])):
            for j, other in enumerate(faces):
                if {p, q} & set(other.tolist()):
                    continue
                a, b, c = vertices[other]
                matrix = np.stack([b - a, c - a, vertices[p] - vertices[q]], axis=1)
                if abs(np.linalg.det(matrix)) < 1e-12:
                    continue
                u, v, t = np.linalg.solve(matrix, vertices[p] - a)
                if u > 0 and v > 0 and u + v < 1 and 0 < t < 1:
                    found.add((min(i, j), max(i, j)))
    return found


def test_a_closed_mesh_passes():
    """A sphere does, and so do two boxes apart, one inside a hollow, and two that touch."""
    check_closed(*ball())
    check_closed(*two((3, 0, 0)))
    check_closed(*two((1, 0, 0)))
    shell = trimesh.creation.box((0.5, 0.5, 0.5))
    shell.invert()
    check_closed(*two((0, 0, 0), shell))


def test_open():
    """One missing face leaves three edges; trimesh fills the hole."""
    vertices, faces = ball()
    with pytest.raises(MeshError, match=r"open: 3 edges.*fill_holes"):
        check_closed(vertices, faces[1:])
    pytest.importorskip("networkx")  # trimesh's repairs need it
    mesh = trimesh.Trimesh(vertices, faces[1:], process=False)
    trimesh.repair.fill_holes(mesh)
    check_closed(np.array(mesh.vertices), np.array(mesh.faces))


def test_loose_faces():
    """Every face with vertices of its own is open everywhere; merging closes it."""
    vertices, faces = ball()
    with pytest.raises(MeshError, match=rf"{3 * len(faces)} edges.*merge_vertices"):
        check_closed(vertices[faces].reshape(-1, 3), np.arange(3 * len(faces)).reshape(-1, 3))


def test_inside_out():
    """Faces turned around enclose a negative volume; ``invert`` turns them back."""
    vertices, faces = ball()
    with pytest.raises(MeshError, match=r"inside out.*invert"):
        check_closed(vertices, faces[:, ::-1])
    mesh = trimesh.Trimesh(vertices, faces[:, ::-1], process=False)
    mesh.invert()
    check_closed(np.array(mesh.vertices), np.array(mesh.faces))


def test_one_face_turned():
    """One face that looks inwards disagrees with its three neighbours; ``fix_normals`` turns it."""
    vertices, faces = ball()
    faces[5] = faces[5][::-1]
    with pytest.raises(MeshError, match=r"3 edges.*trimesh\.repair\.fix_normals"):
        check_closed(vertices, faces)
    pytest.importorskip("networkx")
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    trimesh.repair.fix_normals(mesh)
    check_closed(np.array(mesh.vertices), np.array(mesh.faces))


def test_a_face_twice():
    """An edge of more than two faces is no surface's."""
    vertices, faces = ball()
    with pytest.raises(MeshError, match="3 edges belong to more than two faces"):
        check_closed(vertices, np.concatenate([faces, faces[:1]]))


def test_intersecting():
    """Boxes that overlap are found, with the pairs that testing everything against everything finds."""
    vertices, faces = two((0.53, 0.31, 0.17))
    with pytest.raises(MeshError, match=r"intersects itself: \d+ pairs.*union"):
        check_closed(vertices, faces)
    found = crossing_faces(vertices, faces)
    assert {tuple(pair) for pair in found.tolist()} == brute_crossings(vertices, faces)


def test_a_surface_through_itself():
    """One vertex pulled through the far side crosses there, in the pairs that brute force finds."""
    vertices, faces = ball()
    vertices[10] *= -1.5
    found = crossing_faces(vertices, faces)
    assert len(found) > 0
    assert {tuple(pair) for pair in found.tolist()} == brute_crossings(vertices, faces)
    with pytest.raises(MeshError, match="intersects itself"):
        check_closed(vertices, faces)


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_faces_of_one_plane_are_no_crossing(dtype):
    """A ring's flat ends, turned, are flat to rounding only; that is no intersection, nor after a file's float32."""
    ring = trimesh.creation.annulus(0.05, 0.1, 0.07)
    for angle in np.linspace(0.1, 3.0, 12):
        turn = trimesh.transformations.rotation_matrix(angle, (1.0, angle, 2.0))[:3, :3]
        check_closed((ring.vertices @ turn.T).astype(dtype).astype(float), np.array(ring.faces))


def test_volume_far_from_the_origin():
    """A volume is summed about a point of the mesh: 1 km away it keeps 9 digits."""
    vertices, faces = ball()
    assert enclosed_volume(vertices + 1000.0, faces) == pytest.approx(enclosed_volume(vertices, faces), rel=1e-9)


def test_union():
    """What is said to unite overlapping parts does."""
    pytest.importorskip("manifold3d")
    pytest.importorskip("networkx")
    vertices, faces = two((0.53, 0.31, 0.17))
    mesh = trimesh.boolean.union(trimesh.Trimesh(vertices, faces, process=False).split())
    check_closed(np.array(mesh.vertices), np.array(mesh.faces))
    assert mesh.volume == pytest.approx(2.0 - 0.47 * 0.69 * 0.83)
