"""The patch test (Irons 1965): a mesh of any triangles whose rim is moved by one uniform strain has it inside."""

import numpy as np
import pytest
from triangles import rectangle
from world_with import attached

import nuno

SIDE, CELL = 0.2, 0.02
STRAINS = {
    "stretch along warp": [[1.03, 0.0], [0.0, 1.0]],
    "stretch both ways": [[1.02, 0.0], [0.0, 1.04]],
    "shear": [[1.03, 0.02], [0.02, 1.03]],  # taut, or it would wrinkle
    "all, turned": [[1.03, -0.20], [0.24, 1.02]],
}


def departure(kind, strain, substeps):
    """Return how far from F X any vertex comes to rest [m], the rim held there, the inside put up to 1 mm off."""
    points, faces = rectangle(kind, (SIDE, SIDE), CELL)
    rim = np.abs(points - 0.5 * SIDE).max(axis=1) > 0.5 * SIDE - 1e-6
    goal = np.column_stack([points @ np.array(STRAINS[strain]).T, np.zeros(len(points))])
    start = goal + np.where(rim[:, None], 0.0, np.random.default_rng(4).uniform(-1e-3, 1e-3, goal.shape))
    material = nuno.Cloth(stretch_stiffness=(100.0, 200.0), shear_stiffness=80.0, air_drag=10.0, thickness=1e-4)
    world, body = attached(nuno.cloth_mesh(start, faces, points), material, gravity=(0, 0, 0), substeps=substeps)
    world.grip(body, np.flatnonzero(rim), to=body.vertices[rim].mean(axis=0))
    world.run(1.5)
    return np.abs(body.vertices - goal).max()


# stretch and shear at once, turned, in the default tests; each by itself in the long ones
@pytest.mark.parametrize(
    "strain", [pytest.param(name, marks=pytest.mark.long) if name != "all, turned" else name for name in STRAINS]
)
@pytest.mark.parametrize("kind", ["jittered", pytest.param("scattered", marks=pytest.mark.long)])
def test_a_uniform_strain_stays_uniform(kind, strain):
    """Invariant: all comes to rest at F X, but for what one pass a substep leaves, which falls with its square."""
    coarse, fine = departure(kind, strain, 120), departure(kind, strain, 240)
    # Et dt^2 / (rho h^2) is 3 % at 120 substeps, of strains that move the middle by 2 to 4 mm
    assert coarse < 6e-5
    assert fine < 0.35 * coarse  # a quarter, and float32
