"""Volume, centre of mass and inertia of shapes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from nuno.errors import MeshError
from nuno.shapes import quaternion
from nuno.shapes.compound import Compound
from nuno.shapes.shape import Box, Capsule, Cylinder, Plane, Shape, Sphere


@dataclass(frozen=True, eq=False)
class MassProperties:
    """Mass and inertia of a body of density 1 kg/m3.

    Attributes:
        volume: [m3], which is the mass [kg] at density 1.
        centre: (3,) float [m], the centre of mass in the shape's frame.
        inertia: (3, 3) float [m5], about the centre of mass, in the shape's axes; times the density it is in kg m2.
    """

    volume: float
    centre: np.ndarray
    inertia: np.ndarray

    def turned(self, turn: np.ndarray, position: np.ndarray) -> MassProperties:
        """Return those of the shape where its frame stands at a position, turned by a quaternion (w, x, y, z)."""
        r = quaternion.to_matrix(turn)
        return MassProperties(self.volume, r @ self.centre + position, r @ self.inertia @ r.T)


def mass_properties(shape: Shape, *, thickness: float = 0.0, vertices: Any = None) -> MassProperties:
    """Return a shape's mass properties at density 1 kg/m3.

    Args:
        shape: Box, sphere, capsule, cylinder, compound, a closed mesh, or a cloth or open mesh.
        thickness: Of a cloth or an open mesh [m]: its volume is its area times this.
        vertices: (n, 3) float [m], where the vertices of a mesh or cloth are; None takes the shape's own.

    Raises:
        MeshError: a plane, or an open mesh without thickness.
    """
    if isinstance(shape, Box):
        return _solid(float(np.prod(shape.size)), *(np.square(shape.size) / 12.0))
    if isinstance(shape, Sphere):
        each = shape.radius**2 / 5.0
        return _solid(4.0 / 3.0 * np.pi * shape.radius**3, each, each, each)
    if isinstance(shape, Cylinder):
        across = shape.radius**2 / 4.0
        return _solid(np.pi * shape.radius**2 * shape.height, across, across, shape.height**2 / 12.0)
    if isinstance(shape, Capsule):
        return _capsule(shape.radius, shape.height)
    if isinstance(shape, Compound):
        return joined(
            [
                mass_properties(each, thickness=thickness).turned(np.array(turn), np.array(position))
                for each, position, turn in shape.parts
            ]
        )
    if isinstance(shape, Plane):
        raise MeshError("a plane is endless and has no mass; take a box")
    points, faces = shape.mesh()
    points = np.asarray(points if vertices is None else vertices, dtype=float)
    return of_volume(points, faces) if shape.is_solid else of_shell(points, faces, thickness)


def joined(pieces: list[MassProperties]) -> MassProperties:
    """Return the mass properties of several pieces together."""
    volume = sum(piece.volume for piece in pieces)
    centre = sum((piece.volume * piece.centre for piece in pieces), start=np.zeros(3)) / volume
    inertia = np.zeros((3, 3))
    for piece in pieces:
        inertia += piece.inertia + piece.volume * _steiner(piece.centre - centre)
    return MassProperties(volume, centre, inertia)


def of_volume(points: np.ndarray, faces: np.ndarray) -> MassProperties:
    """Return those of what a closed mesh encloses: vertices (n, 3) [m], faces (m, 3)."""
    import trimesh

    solid = trimesh.Trimesh(points, faces, process=False)
    return MassProperties(float(solid.volume), np.asarray(solid.center_mass), np.asarray(solid.moment_inertia))


def of_shell(points: np.ndarray, faces: np.ndarray, thickness: float) -> MassProperties:
    """Return those of a thin surface: vertices (n, 3) [m], faces (m, 3), ``thickness`` [m].

    Exact for triangles without thickness (second moments of a triangle from its corners and their mean), to which a
    plate's own thickness adds that of a rod across it, so that a flat one is no degenerate body.

    Raises:
        MeshError: no thickness, or triangles without area.
    """
    if thickness <= 0.0:
        raise MeshError(
            f"an open mesh that is no cloth has no mass, got a thickness of {thickness}; close it "
            "(trimesh.repair.fill_holes), or give nuno.cloth_mesh, which has the thickness of its cloth, Rigid"
        )
    corners = points[faces]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    twice = np.linalg.norm(cross, axis=1)
    mass = 0.5 * twice * thickness
    volume = float(mass.sum())
    if volume <= 0.0:
        raise MeshError("a mesh needs an area to have a mass, got none")
    middle = corners.mean(axis=1)
    centre = mass @ middle / volume
    arms = corners - centre
    mean = middle - centre
    # integral of x x^T over a triangle: area / 12 (sum over corners + 9 mean mean^T)
    second = np.einsum("f,fki,fkj->ij", mass / 12.0, arms, arms) + np.einsum("f,fi,fj->ij", 0.75 * mass, mean, mean)
    normal = cross / np.maximum(twice, 1e-30)[:, None]
    second += np.einsum("f,fi,fj->ij", mass * thickness**2 / 12.0, normal, normal)
    return MassProperties(volume, centre, np.trace(second) * np.eye(3) - second)


def _solid(volume: float, xx: float, yy: float, zz: float) -> MassProperties:
    """Of a body whose mean squares of x, y, z about its middle are given [m2]."""
    return MassProperties(float(volume), np.zeros(3), volume * np.diag([yy + zz, xx + zz, xx + yy]))


def _capsule(radius: float, height: float) -> MassProperties:
    """A cylinder and two half balls, whose centres of mass are 3/8 of a radius beyond its ends."""
    tube, ends = np.pi * radius**2 * height, 4.0 / 3.0 * np.pi * radius**3
    across = (tube * radius**2 / 4.0 + ends * radius**2 / 5.0) / (tube + ends)
    half = 0.5 * height
    end = half**2 + 0.75 * half * radius + radius**2 / 5.0
    along = (tube * height**2 / 12.0 + ends * end) / (tube + ends)
    return _solid(tube + ends, across, across, along)


def _steiner(arm: np.ndarray) -> np.ndarray:
    return arm @ arm * np.eye(3) - np.outer(arm, arm)
