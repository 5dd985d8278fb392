"""Volume, strain and stress of a soft body's elements, from the positions of its vertices."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from nuno.topology.soft_topology import OWN_SHARE, SoftTopology, edge_matrices, moduli

if TYPE_CHECKING:
    from nuno.materials import Soft


def deformation_gradients(topology: SoftTopology, positions: ArrayLike) -> np.ndarray:
    """Return (..., m, 3, 3) float64: F of each element, how it maps small steps at rest to steps now.

    Args:
        topology: The body's elements.
        positions: (..., n, 3) [m].
    """
    return edge_matrices(np.asarray(positions, dtype=np.float64), topology.tets) @ topology.inverse


def element_volumes(topology: SoftTopology, positions: ArrayLike) -> np.ndarray:
    """Return (..., m) [m3]: each element's volume now, negative where it is inside out; `topology.volume` at rest.

    Args:
        topology: The body's elements.
        positions: (..., n, 3) [m].
    """
    return np.linalg.det(edge_matrices(np.asarray(positions, dtype=np.float64), topology.tets)) / 6.0


def strains(topology: SoftTopology, positions: ArrayLike) -> np.ndarray:
    """Return (..., m, 3, 3): Green's strain (F^T F - 1) / 2 of each element, along the rest shape's axes.

    Args:
        topology: The body's elements.
        positions: (..., n, 3) [m].
    """
    f = deformation_gradients(topology, positions)
    return 0.5 * (np.swapaxes(f, -1, -2) @ f - np.eye(3))


def stresses(topology: SoftTopology, positions: ArrayLike, material: Soft, worlds: int = 1) -> np.ndarray:
    """Return (..., m, 3, 3) [Pa]: Cauchy's stress of each element, along the world's axes; tension is positive.

    sigma = (mu F F^T + (bulk (J - 1) - mu) J 1) / J, of the energy in `nuno.constraints.tetrahedron`. An element that
    is only partly filled carries ``fraction`` of it. It is not finite where an element is flat. In voxels with a mean
    it is that of both, in the shares that they have of the stiffness.

    Args:
        topology: The body's elements.
        positions: (n, 3) or (worlds, n, 3) [m].
        material: What the body is made of.
        worlds: How many worlds the material's arrays may tell apart.
    """
    f, mu, bulk = _strained(topology, positions, material, worlds)
    own = _cauchy(f, mu, bulk)
    if len(topology.voxels):
        members = topology.clusters.elements[topology.voxels]
        mean = _cauchy(_means(topology, f)[..., None, :, :], mu[..., members], bulk[..., members])
        own[..., members, :, :] = OWN_SHARE * own[..., members, :, :] + (1.0 - OWN_SHARE) * mean
    return own


def elastic_energy(topology: SoftTopology, positions: ArrayLike, material: Soft, worlds: int = 1) -> np.ndarray:
    """Return (...,) [J]: the body's elastic energy, zero at rest.

    Args:
        topology: The body's elements.
        positions: (n, 3) or (worlds, n, 3) [m].
        material: What the body is made of.
        worlds: How many worlds the material's arrays may tell apart.
    """
    f, mu, bulk = _strained(topology, positions, material, worlds)
    density = _energy_density(f, mu, bulk)
    if len(topology.voxels):
        members = topology.clusters.elements[topology.voxels]
        inner = members[:, 0]
        mean = _energy_density(_means(topology, f), mu[..., inner], bulk[..., inner])
        density[..., members] = OWN_SHARE * density[..., members] + (1.0 - OWN_SHARE) * mean[..., None]
    return (density * topology.volume * topology.fraction).sum(axis=-1)


def _means(topology: SoftTopology, f: np.ndarray) -> np.ndarray:
    """Return (..., k, 3, 3), the mean deformation gradient of each voxel that has one, weighted by volume."""
    members = topology.clusters.elements[topology.voxels]
    weight = topology.volume[members] / topology.volume[members].sum(axis=1, keepdims=True)
    return np.einsum("kc,...kcij->...kij", weight, f[..., members, :, :])


def _cauchy(f: np.ndarray, mu: np.ndarray, bulk: np.ndarray) -> np.ndarray:
    mu, bulk = mu[..., None, None], bulk[..., None, None]
    j = np.linalg.det(f)[..., None, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        return mu / j * (f @ np.swapaxes(f, -1, -2)) + (bulk * (j - 1.0) - mu) * np.eye(3)


def _energy_density(f: np.ndarray, mu: np.ndarray, bulk: np.ndarray) -> np.ndarray:
    j = np.linalg.det(f)
    return 0.5 * mu * ((f**2).sum(axis=(-1, -2)) - 3.0) - mu * (j - 1.0) + 0.5 * bulk * (j - 1.0) ** 2


def _strained(
    topology: SoftTopology, positions: ArrayLike, material: Soft, worlds: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return deformation gradients (..., m, 3, 3), and mu and bulk moduli (..., m) [Pa]."""
    f = deformation_gradients(topology, positions)
    mu, bulk = moduli(material.resolved(worlds, topology.element_count))
    one = f.ndim == 3
    mu, bulk = (np.broadcast_to(a[0] if one else a, f.shape[:-2]) for a in (mu, bulk))
    return f, mu, bulk
