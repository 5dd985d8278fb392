"""Flexes: cloth and soft bodies in MuJoCo, of the same vertices and the same material.

A cloth is a flex of triangles. Its membrane is that of Saint Venant and Kirchhoff on the Green strain e: Nuno's
stiffness along warp and weft and against shear, C = diag(stretch_warp, stretch_weft, shear), is written into each
triangle's stiffness matrix, without a Poisson's ratio. Its bending is MuJoCo's hinge at each inner edge with the plate
energy B kappa^2 / 2; an edge takes B = (sqrt(B_warp) n_u^2 + sqrt(B_weft) n_v^2)^2 of its normal n, and a sheet's are
corrected by `nuno.engines.mujoco.mujoco_bending`. A soft body is a flex of tetrahedra with MuJoCo's stable neo-Hookean
law and the material's two numbers.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.bodies.shape_topology import element_count
from nuno.engines.mujoco.mujoco_bending import BEND, bending_factors
from nuno.engines.mujoco.mujoco_package import mujoco_package
from nuno.engines.mujoco.sheet_triangles import sheet_triangles
from nuno.shapes.shape import ClothMesh, Sheet

if TYPE_CHECKING:
    from nuno.engines.array_dynamics import ArrayParticles

PAIRS = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))
"""Entries of a triangle's symmetric stiffness, in MuJoCo's order."""
ROW = 21
"""Numbers of a triangle in ``flex_stiffness``."""
SOLID_ROW = 24
"""Numbers of a tetrahedron in ``flex_stiffness``: 22 in proportion to the shear modulus mu, one to lambda + 2 mu, and
one of its shape."""
STRETCH, BENDING = 1000.0, 1e-4
"""[N/m], [N m] What a cloth is compiled with; the numbers of its material are written afterwards."""
YOUNG, POISSON = 1e4, 0.3
"""[Pa] and a ratio, what a soft body is compiled with, likewise."""


class FlexMesh:
    """The elements of a flex.

    Args:
        dynamics: Of the body.

    Attributes:
        rest: (n, 3) float [m], the vertices at rest.
        elements: (m, 3 or 4) int, triangles or tetrahedra.
        owner: (m,) int, the material's element that each is part of.
        axes: (m, 2, 3) float, warp and weft of each triangle in the frame of ``rest``; None of tetrahedra.
        factors: What the bending along warp and weft is multiplied by.
    """

    def __init__(self, dynamics: ArrayParticles) -> None:
        shape: Any = dynamics.shape
        self.axes: np.ndarray | None = None
        self.factors = (1.0, 1.0)
        if shape.is_soft:
            made = shape.tetrahedra()
            self.rest, self.elements = np.asarray(made.vertices), np.asarray(made.tets)
            self.owner = np.arange(len(self.elements))
            return
        vertices, faces = shape.mesh()
        if isinstance(shape, Sheet):
            self.rest = np.asarray(vertices)
            self.elements, self.owner = sheet_triangles(*shape.cells)
            self.axes = np.broadcast_to(np.eye(3)[:2], (len(self.elements), 2, 3))
            length, width = (size / cells for size, cells in zip(shape.size, shape.cells, strict=True))
            warp, weft = _first_bending(dynamics)
            self.factors = bending_factors(1.0, round(width / length, 6), float(f"{weft / warp:.2g}"))
            return
        assert isinstance(shape, ClothMesh)
        rest: Any = shape.rest
        self.rest = np.pad(rest, ((0, 0), (0, 3 - rest.shape[1])))
        self.elements, self.owner = np.asarray(faces), np.arange(len(faces))
        triangles = dynamics.topology.triangles
        order = _same_faces(triangles.vertices, self.elements)
        corners = self.rest[triangles.vertices[order]]
        self.axes = np.stack(
            [np.einsum("mc,mcx->mx", triangles.extra[name][order], corners) for name in ("u", "v")], axis=1
        )


def _first_bending(dynamics: ArrayParticles) -> tuple[float, float]:
    """Return the mean rigidities along warp and weft in the first world [N m], their ratio 1,000 at most."""
    values = dynamics.material.resolved(dynamics.world_count, element_count(dynamics.shape))
    warp, weft = (max(float(values[f"bending_rigidity_{way}"][0].mean()), 1e-12) for way in ("warp", "weft"))
    return max(warp, 1e-3 * weft), max(weft, 1e-3 * warp)


def add_flex(spec: Any, name: str, mesh: FlexMesh, dynamics: ArrayParticles) -> tuple[Any, list[Any]]:
    """Add a flex and its vertices' bodies to a spec; return both."""
    mujoco = mujoco_package()
    slide, axes = mujoco.mjtJoint.mjJNT_SLIDE, np.eye(3)
    material: Any = dynamics.material
    bodies = []
    for k, (place, mass) in enumerate(zip(mesh.rest, dynamics.mass[0], strict=True)):
        body = spec.worldbody.add_body(
            name=f"{name}.{k}", pos=place, mass=float(mass), inertia=[float(mass) * 1e-6] * 3, explicitinertial=True
        )
        for axis, letter in zip(axes, "xyz", strict=True):
            body.add_joint(name=f"{name}.{k}.{letter}", type=slide, axis=axis)
        bodies.append(body)
    flex = spec.add_flex(name=name, dim=mesh.elements.shape[1] - 1)
    flex.vertbody = [f"{name}.{k}" for k in range(len(bodies))]
    flex.elem = mesh.elements.ravel().tolist()
    flex.damping = float(np.max(material.damping))  # without one there is no room for any
    if mesh.axes is None:
        flex.young, flex.poisson = YOUNG, POISSON
        flex.elastic3d, flex.radius = 1, 0.0
        return flex, bodies
    thickness = float(np.sqrt(12.0 * BENDING / STRETCH))
    flex.young, flex.poisson, flex.thickness = STRETCH / thickness, 0.0, thickness
    flex.elastic2d, flex.radius = 3, 0.5 * float(np.max(material.thickness))
    return flex, bodies


def write_flex(model: Any, batch: Any, flex: int, mesh: FlexMesh, dynamics: ArrayParticles) -> None:
    """Write the numbers of a flex's material into a batch, one world's after the other's."""
    values = dynamics.material.resolved(dynamics.world_count, element_count(dynamics.shape))
    batch.expand("flex_damping")[:, flex] = values["damping"][:, 0]
    if mesh.axes is not None:
        batch.expand("flex_radius")[:, flex] = 0.5 * values["thickness"][:, 0]
        rows = cloth_numbers(model, flex, mesh, dynamics)
    else:
        scale = _solid_scale(values["youngs_modulus"], values["poisson_ratio"]) * dynamics.topology.fraction[:, None]
        first = int(model.flex_stiffnessadr[flex])
        own = model.flex_stiffness[first : first + SOLID_ROW * len(mesh.elements)].reshape(-1, SOLID_ROW)
        own = np.concatenate([own[:, :-1] * scale, np.broadcast_to(own[:, -1:], (*scale.shape[:2], 1))], axis=-1)
        rows = {"flex_stiffness": own.reshape(len(own), -1)}
    start = {"flex_stiffness": model.flex_stiffnessadr, "flex_bending": model.flex_bendingadr}
    for name, numbers in rows.items():
        first = int(start[name][flex])
        batch.expand(name)[:, first : first + numbers.shape[1]] = numbers


def _solid_scale(young: np.ndarray, poisson: np.ndarray) -> np.ndarray:
    """Return by what the numbers of a solid are multiplied, (worlds, elements or 1, 23), but for the last of each."""
    young, poisson = (np.asarray(array, dtype=np.float64) for array in (young, poisson))
    shear = young / (2.0 * (1.0 + poisson))
    both = young * poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson)) + 2.0 * shear
    compiled = YOUNG / (2.0 * (1.0 + POISSON))
    compiled_both = YOUNG * POISSON / ((1.0 + POISSON) * (1.0 - 2.0 * POISSON)) + 2.0 * compiled
    return np.stack([*22 * [shear / compiled], both / compiled_both], axis=-1)


def cloth_numbers(model: Any, flex: int, mesh: FlexMesh, dynamics: ArrayParticles) -> dict[str, np.ndarray]:
    """Return a compiled cloth's ``flex_stiffness`` (worlds, k) and ``flex_bending`` (worlds, k), by its material."""
    values = dynamics.material.resolved(dynamics.world_count, element_count(dynamics.shape))

    def by_element(name: str) -> np.ndarray:
        array = values[name].astype(np.float64)
        return array[:, mesh.owner] if array.shape[1] > 1 else np.repeat(array, len(mesh.owner), axis=1)

    assert mesh.axes is not None
    first, count = int(model.flex_edgeadr[flex]), int(model.flex_edgenum[flex])
    ends = model.flex_edge[first : first + count]
    start = int(model.flex_elemedgeadr[flex])
    sides = model.flex_elemedge[start : start + 3 * len(mesh.elements)].reshape(-1, 3)
    along = mesh.rest[ends[:, 1]] - mesh.rest[ends[:, 0]]
    local = np.einsum("max,mcx->mca", mesh.axes, along[sides])  # (m, 3 edges, 2)
    squares = np.stack([local[..., 0] ** 2, local[..., 1] ** 2, local[..., 0] * local[..., 1]], axis=-1)
    strain = np.linalg.inv(squares)  # from half the edges' longer squares to e_uu, e_vv and 2 e_uv
    corners = mesh.rest[mesh.elements]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = 0.5 * np.linalg.norm(normals, axis=1)
    modulus = np.stack(
        [by_element("stretch_stiffness_warp"), by_element("stretch_stiffness_weft"), by_element("shear_stiffness")],
        axis=-1,
    )
    matrix = 0.5 * area[:, None, None] * np.einsum("mij,wmi,mik->wmjk", strain, modulus, strain)
    stiffness = np.zeros((len(matrix), len(mesh.elements), ROW))
    for k, (i, j) in enumerate(PAIRS):
        stiffness[..., k] = matrix[..., i, j]
    return {
        "flex_stiffness": stiffness.reshape(len(matrix), -1),
        "flex_bending": _bending(model, flex, mesh, sides, local, by_element),
    }


def _bending(
    model: Any, flex: int, mesh: FlexMesh, sides: np.ndarray, local: np.ndarray, by_element: Any
) -> np.ndarray:
    """Return the bending numbers (worlds, k) of a cloth's edges, scaled from those that were compiled."""
    first, count = int(model.flex_bendingadr[flex]), int(model.flex_edgenum[flex])
    compiled = model.flex_bending[first : first + BEND * count].reshape(count, BEND)
    unit = local / np.linalg.norm(local, axis=-1, keepdims=True)
    # the normal of an edge (u, v) is (-v, u)
    warp, weft = (
        np.sqrt(factor * by_element(f"bending_rigidity_{way}"))[:, :, None]
        for factor, way in zip(mesh.factors, ("warp", "weft"), strict=True)
    )
    wanted = (warp * unit[..., 1] ** 2 + weft * unit[..., 0] ** 2) ** 2
    total = np.zeros((len(wanted), count))
    number = np.bincount(sides.ravel(), minlength=count)
    for world, own in enumerate(wanted):
        total[world] = np.bincount(sides.ravel(), own.ravel(), minlength=count) / np.maximum(number, 1)
    return ((total / BENDING)[:, :, None] * compiled).reshape(len(total), -1)


def _same_faces(triangles: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return (m,) int, which of ``triangles`` each face is, whatever the order of its corners."""
    index = {tuple(sorted(corners)): k for k, corners in enumerate(np.asarray(triangles).tolist())}
    return np.array([index[tuple(sorted(corners))] for corners in faces.tolist()])
