"""A mesh that moves is touched as its convex hull, which is told where the hull fills what the mesh leaves free."""

import numpy as np
import pytest
import trimesh

import nuno

PROFILE = np.array([(0, -0.1), (0.06, -0.08), (0.1, 0), (0.09, 0), (0.055, -0.07), (0, -0.09)])


def attached(mesh, caplog):
    """Return what was warned of as a mesh became dynamic twice."""
    world = nuno.World(device="cpu")
    body = world.add(nuno.mesh(mesh, name="bowl"))
    with caplog.at_level("WARNING", logger="nuno"):
        for _ in range(2):
            world.attach(body, nuno.Rigid(mass=0.2))
            world.detach(body)
    return [record.getMessage() for record in caplog.records]


def test_moving_bowl_is_told_of_once_with_its_cure(caplog):
    """The hull of a thin bowl fills it; the warning names the bowl, by how much, and nuno.compound."""
    bowl = trimesh.creation.revolve(PROFILE)
    told = attached(bowl, caplog)
    assert len(told) == 1
    assert "'bowl'" in told[0]
    assert f"{bowl.convex_hull.volume / bowl.volume:.3g} times" in told[0]
    assert "nuno.compound" in told[0]


@pytest.mark.parametrize("mesh", [trimesh.creation.icosphere(2, 0.1), trimesh.creation.box((0.1, 0.1, 0.2))])
def test_convex_mesh_is_not_told_of(mesh, caplog):
    """Its hull is the mesh itself."""
    assert attached(mesh, caplog) == []
