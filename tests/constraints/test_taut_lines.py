"""Taut grid lines: what turns of an edge's force."""

import numpy as np
import pytest
import warp as wp

from nuno.constraints.taut_lines import ONSET, TURNED, turned
from nuno.numbers.vec3 import vec3


@wp.kernel(enable_backward=False)
def _turn(force: wp.vec3, edge: wp.vec3, light: float, rest: float, out: wp.array(dtype=float)):
    change = turned(vec3(force[0], force[1], force[2]), vec3(edge[0], edge[1], edge[2]), light, rest)
    out[0] = change.x
    out[1] = change.y
    out[2] = change.z


def change_of(force, edge, light, rest):
    """The change of an edge's force, by the kernels' function."""
    out = wp.zeros(3, dtype=float, device="cpu")
    wp.launch(_turn, dim=1, inputs=[wp.vec3(*force), wp.vec3(*edge), light, rest, out], device="cpu")
    return out.numpy()


@pytest.mark.parametrize(("taut", "share"), [(0.4, 0.0), (0.55, 0.4), (0.7, 1.0), (2.0, 1.0), (-2.0, 0.0)])
def test_a_share_of_what_a_force_has_across_its_edge_is_taken_off(taut, share):
    """Definition: none up to the onset and of a pressed edge, all of `TURNED` from 5/4 of it on, straight between."""
    edge, light, rest = np.array([0.011, 0.002, -0.001]), 500.0, 0.01
    old = np.array([0.01, -0.001, 0.0005])
    force = -old / np.linalg.norm(old) * taut * rest / light  # a vertex is drawn to the other one: against the edge
    across = force - edge * (force @ edge) / (edge @ edge)
    # floats
    np.testing.assert_allclose(
        change_of(force, edge, light, rest), -share * TURNED * across, rtol=0, atol=1e-6 * np.linalg.norm(force)
    )
    assert ONSET == 0.5
