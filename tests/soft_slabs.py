"""Surfaces of soft bodies and slabs on static shapes: for tests of edges and corners."""

import numpy as np

from nuno.mesh.tetrahedra import box_tetrahedra
from nuno.solvers.soft_solver import SoftSolver
from nuno.tables.colliders import Colliders
from nuno.topology.soft_topology import SoftTopology


def surface(body, count=10):
    """Return points of a body's triangles, ``count`` steps a side [m]."""
    steps = np.array([(i, j, count - i - j) for i in range(count + 1) for j in range(count + 1 - i)]) / count
    return np.einsum("kb,fbx->fkx", steps, body.vertices[body.faces]).reshape(-1, 3)


def assert_plans_agree(shapes, material, substeps):
    """Check that a slab beside static shapes has the same bits by sixteen particles at a time and one by one."""
    topology = SoftTopology.of(*box_tetrahedra((0.2, 0.2, 0.06), (6, 6, 2)))
    start = topology.rest[None] + np.array([0.02, 0.01, 0.09])
    ends = []
    for plan in ("vector", "fused"):
        solver = SoftSolver(topology, material, start, 0 * start, substeps=substeps, plan=plan)
        solver.set_colliders(Colliders.from_bodies(shapes))
        solver.run(0.0, 0.3)
        assert solver.state.feature_shapes.numpy()[0] > 0
        ends.append(solver.positions())
    np.testing.assert_array_equal(ends[1], ends[0])
