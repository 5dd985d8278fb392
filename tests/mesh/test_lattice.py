"""Lattices around closed meshes: what is filled, how much, and where the surface is in them."""

import numpy as np
import pytest
import trimesh

from matching import inner_faces_match
from nuno import MeshError
from nuno.mesh import primitives
from nuno.mesh.lattice import FLOOR, lattice_tetrahedra
from nuno.mesh.tetrahedra import FACES, volumes
from nuno.mesh.voxel_occupancy import filled_fraction

TURN = trimesh.transformations.rotation_matrix(0.7, (1, 2, 3))[:3, :3]


def arrays(mesh):
    """Return the vertices and faces of a trimesh."""
    return np.array(mesh.vertices), np.array(mesh.faces)


def turned_box(size):
    """Return a box that is aligned with nothing."""
    vertices, faces = primitives.box_mesh(size)
    return vertices @ TURN.T, faces


MESHES = {
    "sphere": (primitives.sphere_mesh(0.1), 0.04),
    "cylinder": (primitives.cylinder_mesh(0.1, 0.3), 0.04),
    "turned box": (turned_box((0.1, 0.2, 0.3)), 0.03),
    "turned plate": (turned_box((0.01, 0.2, 0.3)), 0.05),
    "turned needle": (turned_box((0.002, 0.002, 0.3)), 0.05),
    "torus": (arrays(trimesh.creation.torus(0.1, 0.03)), 0.03),
}


@pytest.mark.parametrize("name", MESHES)
def test_elements(name):
    """All are of positive volume, meet face to face, and every vertex belongs to one."""
    (vertices, faces), cell = MESHES[name]
    made = lattice_tetrahedra(vertices, faces, cell)
    assert volumes(made.vertices, made.tets).min() > 0.0
    assert inner_faces_match(made.tets)
    assert len(np.unique(made.tets)) == len(made.vertices)
    assert made.fraction.min() >= FLOOR and made.fraction.max() <= 1.0


@pytest.mark.parametrize("name", MESHES)
def test_filled_volume_is_that_of_the_mesh(name):
    """The floor's surplus is taken from fuller voxels, so that the mass is right; a needle is all floor."""
    (vertices, faces), cell = MESHES[name]
    made = lattice_tetrahedra(vertices, faces, cell)
    filled = volumes(made.vertices, made.tets) @ made.fraction
    volume = trimesh.Trimesh(vertices, faces).volume
    if name == "turned needle":
        assert (made.fraction == FLOOR).all() and filled > volume
    else:
        assert filled == pytest.approx(volume, rel=1e-9)  # a bisection to the last digit


@pytest.mark.parametrize("name", MESHES)
def test_embedding_reproduces_the_surface(name):
    """The embedded points are where the mesh's vertices are, each inside its element, and follow an affine map."""
    (vertices, faces), cell = MESHES[name]
    made = lattice_tetrahedra(vertices, faces, cell)
    np.testing.assert_allclose(made.skin_vertices(made.vertices), vertices, atol=1e-15)
    assert made.skin_weights.min() > -1e-9  # by rounding, of weights from 0 to 1
    np.testing.assert_array_equal(made.faces, faces)
    stretch = np.array([[1.1, 0.2, 0.0], [0.0, 0.9, 0.3], [0.1, 0.0, 1.2]])
    moved = np.stack([made.vertices, made.vertices @ stretch.T + 1.0])  # also along a leading axis
    np.testing.assert_allclose(made.skin_vertices(moved)[1], vertices @ stretch.T + 1.0, atol=1e-14)


def test_fraction_against_the_sphere():
    """Summed, the fractions are the sphere's volume; voxel by voxel, what a fine sampling counts."""
    vertices, faces = primitives.sphere_mesh(1.0, around=512)
    cells = (6, 6, 6)
    fraction, overlaps = filled_fraction((vertices + 1.0) * 3.0, faces, cells)
    assert overlaps == 0
    # 512 segments are 0.005 % short of the volume; 192 lines a voxel, exact along their length, do the rest
    assert fraction.sum() / 27.0 == pytest.approx(4.0 / 3.0 * np.pi, rel=5e-4)
    fine = (np.arange(6 * 40) + 0.5) / 120.0 - 1.0
    inside = (fine[:, None, None] ** 2 + fine[None, :, None] ** 2 + fine[None, None, :] ** 2) < 1.0
    sampled = inside.reshape(6, 40, 6, 40, 6, 40).mean(axis=(1, 3, 5))
    np.testing.assert_allclose(fraction, sampled, atol=0.01)  # of 64 lines through a curved rim
    turned, _ = filled_fraction((vertices[:, [1, 2, 0]] + 1.0) * 3.0, faces, cells)
    np.testing.assert_allclose(turned, fraction.transpose(1, 2, 0), atol=1e-12)  # no axis is special


def test_fraction_is_exact_for_an_aligned_box():
    """A box that ends 0.3 of a voxel into the lattice's last ones fills exactly that much."""
    vertices, faces = primitives.box_mesh((2.3, 2.3, 2.3))
    fraction, _ = filled_fraction(vertices + 1.15, faces, (3, 3, 3))
    # along an axis the part is exact; across, whole lines count: 2 of 8 lie in 0.3
    one = {"along": 0.3, "across": 0.25}
    assert fraction[0, 0, 0] == pytest.approx(1.0)
    assert fraction[2, 0, 0] == pytest.approx((one["along"] + 2 * one["across"]) / 3)
    assert fraction[2, 2, 0] == pytest.approx((2 * one["along"] * one["across"] + one["across"] ** 2) / 3)


def test_a_box_on_the_lattice_is_full():
    """Voxels that the surface only touches are not there; those inside are filled whole."""
    made = lattice_tetrahedra(*primitives.box_mesh((0.2, 0.2, 0.3)), 0.1)
    assert len(made.tets) == 5 * 2 * 2 * 3 and (made.fraction == 1.0).all()


def test_cells_are_no_longer_than_asked():
    """The bounding box is divided evenly: an extent of 0.25 m into 3 voxels of at most 0.1 m."""
    made = lattice_tetrahedra(*primitives.box_mesh((0.25, 0.1, 0.2)), 0.1)
    assert len(np.unique(made.vertices[:, 0].round(9))) == 4
    assert len(np.unique(made.vertices[:, 1].round(9))) == 2


@pytest.mark.parametrize("name", MESHES)
def test_hangs_together_by_faces(name):
    """The voxels are one piece, from face to face: no two parts hang on an edge or vertex alone, as hinges."""
    (vertices, faces), cell = MESHES[name]
    made = lattice_tetrahedra(vertices, faces, cell)
    named = np.sort(made.tets[:, FACES].reshape(-1, 3), axis=1)
    _, face = np.unique(named, axis=0, return_inverse=True)
    face = face.reshape(-1, 4)
    label = np.arange(len(face))
    while True:  # each element takes the lowest label around it, until none changes
        lowest = np.full(face.max() + 1, len(face))
        np.minimum.at(lowest, face.ravel(), np.repeat(label, 4))
        new = lowest[face].min(axis=1)
        if np.array_equal(new, label):
            break
        label = new
    assert len(np.unique(label)) == 1


def test_a_finer_lattice_is_closer_to_the_sphere():
    """The lattice's own volume comes down to that of what it holds, in proportion to the voxel's edge."""
    vertices, faces = primitives.sphere_mesh(0.1)
    excess = []
    for cell in (0.04, 0.02, 0.01):
        made = lattice_tetrahedra(vertices, faces, cell)
        excess.append(volumes(made.vertices, made.tets).sum() / trimesh.Trimesh(vertices, faces).volume - 1.0)
    assert excess[0] > 1.5 * excess[1] > 1.5**2 * excess[2] > 0.0


def test_overlap_that_no_edge_crosses_is_found():
    """Two bars through each other whose faces lie in common planes cross no face properly, but overlap."""
    bars = trimesh.util.concatenate([trimesh.creation.box((1, 0.1, 0.1)), trimesh.creation.box((0.1, 1, 0.1))])
    with pytest.raises(MeshError, match=r"overlaps itself.*trimesh\.boolean\.union"):
        lattice_tetrahedra(*arrays(bars), 0.05)


def test_a_cell_that_is_far_too_small():
    """Millimetres taken for metres would fill the memory; the error says so first."""
    with pytest.raises(MeshError, match="metres"):
        lattice_tetrahedra(*primitives.box_mesh((200.0, 200.0, 200.0)), 0.05)


def test_every_time_the_same():
    """Nothing is drawn at random: two fillings are equal bit for bit."""
    (vertices, faces), cell = MESHES["turned box"]
    first, second = lattice_tetrahedra(vertices, faces, cell), lattice_tetrahedra(vertices.copy(), faces.copy(), cell)
    for a, b in zip(vars(first).values(), vars(second).values(), strict=True):
        np.testing.assert_array_equal(a, b)
