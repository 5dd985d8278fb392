"""Body-fitted lattices: their boundary on the surface, their elements' shapes, and what cannot be followed."""

import numpy as np
import pytest
import trimesh
from test_lattice import arrays, turned_box

from matching import inner_faces_match
from nuno.mesh import primitives
from nuno.mesh.fitted import UnresolvedMeshError, fitted_tetrahedra
from nuno.mesh.lattice import lattice_tetrahedra
from nuno.mesh.nearest import NearestOn
from nuno.mesh.relaxed import MIN_HEIGHT, heights
from nuno.mesh.tetrahedra import boundary_faces, volumes
from nuno.mesh.voxel_occupancy import inside_nodes


def wavy_ball():
    """Return a ball with hills and hollows of a quarter of its radius."""
    vertices, faces = arrays(trimesh.creation.icosphere(subdivisions=5, radius=0.1))
    x, y = vertices[:, :1] / 0.1, vertices[:, 1:2] / 0.1
    return vertices * (1.0 + 0.25 * np.sin(5.0 * x) * np.cos(4.0 * y)), faces


# with the cell, the share of the volume that flat faces cut off: by the square of the cell over the radius
MESHES = {
    "sphere": (primitives.sphere_mesh(0.1, around=128), 0.2 / 12, 0.02),
    "odd sphere": (primitives.sphere_mesh(0.1, around=128), 0.2 / 13, 0.02),
    "coarse sphere": (primitives.sphere_mesh(0.1, around=128), 0.05, 0.16),
    "cylinder": (primitives.cylinder_mesh(0.1, 0.3, around=64), 0.2 / 12, 0.01),
    "turned box": (turned_box((0.1, 0.2, 0.3)), 0.015, 0.01),
    "torus": (arrays(trimesh.creation.torus(0.1, 0.03)), 0.015, 0.06),
    "cone": (arrays(trimesh.creation.cone(0.1, 0.2)), 0.02, 0.05),
    "ring": (arrays(trimesh.creation.annulus(0.05, 0.1, 0.1)), 0.02, 0.02),
    "wavy ball": (wavy_ball(), 0.02, 0.03),
}


LONG = ("torus", "cone", "cylinder", "turned box", "odd sphere", "wavy ball")


@pytest.fixture(
    scope="module", params=[pytest.param(name, marks=pytest.mark.long if name in LONG else ()) for name in MESHES]
)
def case(request):
    """A mesh's vertices and faces, the cell, the volume that may be cut off, and its tetrahedra."""
    (vertices, faces), cell, cut = MESHES[request.param]
    return vertices, faces, cell, cut, fitted_tetrahedra(vertices, faces, cell)


def test_elements(case):
    """All meet face to face, belong to a vertex, and are no flatter than what is aimed at: substeps go by that."""
    _, _, cell, _, made = case
    assert inner_faces_match(made.tets)
    assert len(np.unique(made.tets)) == len(made.vertices)
    # voxels are a little smaller than the cell where the box is no multiple of it: 0.8 at the least here
    assert heights(made.vertices, made.tets).min() > 0.8 * MIN_HEIGHT * cell


def test_boundary_is_on_the_surface(case):
    """Boundary vertices are on the mesh, but for a few near flat elements, which are within a fifth of a cell of it."""
    vertices, faces, cell, _, made = case
    points = made.vertices[np.unique(boundary_faces(made.tets))]
    away = np.linalg.norm(NearestOn(vertices[faces], cell).nearest(points) - points, axis=1)
    assert (away < 1e-12).mean() > 0.9 and away.max() < 0.2 * cell


def test_mass_is_the_mesh_s(case):
    """The fraction makes up for what flat faces cut off, which falls with the cell."""
    vertices, faces, _, cut, made = case
    volume, own = trimesh.Trimesh(vertices, faces).volume, volumes(made.vertices, made.tets)
    assert own @ made.fraction == pytest.approx(volume, rel=1e-12)
    assert own.sum() == pytest.approx(volume, rel=cut)


def test_skin_is_the_mesh(case):
    """The embedded points are where the mesh's vertices are, and follow an affine map."""
    vertices, faces, _, _, made = case
    np.testing.assert_allclose(made.skin_vertices(made.vertices), vertices, atol=1e-14)
    np.testing.assert_array_equal(made.faces, faces)
    stretch = np.array([[1.1, 0.2, 0.0], [0.0, 0.9, 0.3], [0.1, 0.0, 1.2]])
    np.testing.assert_allclose(made.skin_vertices(made.vertices @ stretch.T), vertices @ stretch.T, atol=1e-14)


def test_an_aligned_box_is_its_lattice():
    """Where voxels end on the surface nothing moves, and no corner is cut."""
    box = primitives.box_mesh((0.2, 0.3, 0.05))
    fitted, lattice = fitted_tetrahedra(*box, 0.05), lattice_tetrahedra(*box, 0.05)
    np.testing.assert_allclose(np.sort(fitted.vertices, axis=0), np.sort(lattice.vertices, axis=0), atol=1e-15)
    assert len(fitted.tets) == len(lattice.tets)


def test_corners_are_kept():
    """A turned box has a vertex at its corners; where that would make elements flat, one within a cell."""
    vertices, faces = turned_box((0.1, 0.2, 0.3))
    made = fitted_tetrahedra(vertices, faces, 0.015)
    away = np.linalg.norm(vertices[:, None] - made.vertices[None], axis=2).min(axis=1)
    assert np.sort(away)[:6].max() < 1e-12 and away.max() < 0.015


@pytest.mark.parametrize("size", [(0.01, 0.2, 0.3), (0.002, 0.002, 0.3)])
def test_what_is_thinner_than_a_cell(size):
    """A turned plate and needle have no node inside; that is said, and not half of them returned."""
    with pytest.raises(UnresolvedMeshError):
        fitted_tetrahedra(*turned_box(size), 0.05)


def test_a_fin_is_not_lost():
    """A thin fin on a thick block is told as missing, though it is a small part of the volume."""
    parts = [trimesh.creation.box((0.1, 0.1, 0.1)), trimesh.creation.box((0.004, 0.1, 0.2))]
    parts[1].apply_translation((0.013, 0.0, 0.15))  # stands on the block, its foot shared by neither
    fin = trimesh.util.concatenate(parts)
    with pytest.raises(UnresolvedMeshError, match="cells away"):
        fitted_tetrahedra(*arrays(fin), 0.02)


def test_every_time_the_same():
    """Two fillings are equal bit for bit."""
    vertices, faces = wavy_ball()
    first, second = (fitted_tetrahedra(vertices.copy(), faces.copy(), 0.03) for _ in range(2))
    for a, b in zip(vars(first).values(), vars(second).values(), strict=True):
        np.testing.assert_array_equal(a, b)


def test_nodes_inside():
    """Of a sphere, those nearer to its centre than the radius."""
    vertices, faces = primitives.sphere_mesh(1.0, around=256)
    inside = inside_nodes((vertices + 1.0) * 3.5, faces, (7, 7, 7))
    index = np.stack(np.meshgrid(*[np.arange(8)] * 3, indexing="ij"), axis=-1) / 3.5 - 1.0
    radius = np.linalg.norm(index, axis=-1)
    clear = np.abs(radius - 1.0) > 1e-3  # 256 segments are off by 1e-4
    np.testing.assert_array_equal(inside[clear], radius[clear] < 1.0)
