"""Blocks of soft material in the solver itself, the start of the tests of soft bodies."""

from __future__ import annotations

from typing import Any

import numpy as np

import nuno
from nuno.joints.grip import GripSpec
from nuno.mesh.tetrahedra import box_tetrahedra
from nuno.solvers.soft_solver import SoftSolver
from nuno.tables.colliders import Colliders
from nuno.topology.soft_topology import SoftTopology

GRAVITY = 9.81  # [m/s2], the default of the solver
FOAM = nuno.Soft(density=1000.0, youngs_modulus=5e4, poisson_ratio=0.3, damping=0.02)


def block(size, cells, irregular: float = 0.0, seed: int = 1, mean_strain: bool = False) -> SoftTopology:
    """A box about the origin; its inner vertices are displaced at random by ``irregular`` cells."""
    vertices, tets = box_tetrahedra(size, cells)
    if irregular:
        inner = (np.abs(vertices) < np.array(size) / 2 - 1e-9).all(axis=1)
        cell = np.array(size) / cells
        vertices[inner] += np.random.default_rng(seed).uniform(-irregular, irregular, (inner.sum(), 3)) * cell
    return SoftTopology.of(vertices, tets, mean_strain=mean_strain)


def solver(topology: SoftTopology, material: nuno.Soft = FOAM, *others: nuno.Body, **options: Any) -> SoftSolver:
    """A solver of the body, one world unless ``start`` (worlds, n, 3) or ``worlds`` says more; weightless."""
    worlds = options.pop("worlds", 1)
    start = options.pop("start", np.repeat(topology.rest[None], worlds, axis=0))
    velocities = options.pop("velocities", np.zeros_like(start))
    options.setdefault("gravity", (0.0, 0.0, 0.0))
    made = SoftSolver(topology, material, start, np.broadcast_to(velocities, start.shape), **options)
    if others:
        made.set_colliders(Colliders.from_bodies(list(others), len(start), "cpu"))
    return made


def hold(made: SoftSolver, vertices: np.ndarray, places: np.ndarray, compliance: float = 0.0) -> None:
    """Hold vertices (k,) at places (k, 3) [m] in every world."""
    worlds = made.world_count
    every = np.repeat(np.asarray(vertices)[None], worlds, axis=0)
    at = np.repeat(np.asarray(places, dtype=float)[None, :, None], worlds, axis=0)
    made.set_grips([GripSpec(every, None, None, np.array([0.0]), at, "linear", compliance)])


def traction(topology: SoftTopology, stress: np.ndarray) -> np.ndarray:
    """Return forces (n, 3) [N] of a uniform stress (3, 3) [Pa] on the whole rest surface, a third to each corner."""
    x = topology.rest[topology.faces]
    outward = 0.5 * np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0])
    forces = np.zeros_like(topology.rest)
    for corner in range(3):
        np.add.at(forces, topology.faces[:, corner], outward @ np.asarray(stress).T / 3.0)
    return forces


def rigid_fit_error(rest: np.ndarray, now: np.ndarray) -> np.ndarray:
    """Return (n,) [m], how far vertices (n, 3) are from the rest shape, moved and turned to fit best (Kabsch 1976)."""
    a, b = rest - rest.mean(axis=0), now - now.mean(axis=0)
    u, _, vt = np.linalg.svd(a.T @ b)
    turn = u @ np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ vt))]) @ vt
    return np.linalg.norm(a @ turn - b, axis=1)
