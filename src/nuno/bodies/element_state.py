"""The state of a soft body's tetrahedra: volumes, strains and stresses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nuno.bodies.body import Body
from nuno.bodies.shape_topology import topology_of
from nuno.errors import InvalidInputError
from nuno.materials import Soft
from nuno.validation import instance


@dataclass(frozen=True, eq=False)
class ElementState:
    """The elements of a soft body at one instant; in a batch, what may differ by world starts with (worlds,).

    Attributes:
        tets: (m, 4) int32, the corners among ``body.vertices``.
        rest_volumes: (m,) [m3].
        volumes: (m,) [m3], negative where an element is inside out.
        strains: (m, 3, 3), Green's strain along the rest shape's axes.
        stresses: (m, 3, 3) [Pa], Cauchy's stress along the world's axes, tension positive, of the positions at the end
            of a substep: beside contacts 7 % more in the mean than what these bear at the default substeps, of second
            order in the substep (docs/soft-bodies.md). None while the body has no soft material.
    """

    tets: np.ndarray
    rest_volumes: np.ndarray
    volumes: np.ndarray
    strains: np.ndarray
    stresses: np.ndarray | None


def elements(body: Body) -> ElementState:
    """Return what the tetrahedra of a soft body are doing now.

    Args:
        body: A soft body, attached or not.

    Raises:
        InvalidInputError: the body has no tetrahedra.
    """
    from nuno.bodies import soft_measures

    shape = instance("body", body, Body).shape
    if not shape.is_soft:
        raise InvalidInputError(f"only soft bodies have tetrahedra; {body.name!r} is a {shape.kind}")
    topology, vertices, material = topology_of(body.shape), body.vertices, body.material
    stresses = None
    if isinstance(material, Soft):
        worlds = len(vertices) if vertices.ndim == 3 else 1
        stresses = soft_measures.stresses(topology, vertices, material, worlds)
    return ElementState(
        topology.tets, topology.volume, soft_measures.element_volumes(topology, vertices),
        soft_measures.strains(topology, vertices), stresses,
    )  # fmt: skip
