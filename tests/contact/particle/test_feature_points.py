"""Where an edge is nearest to a capsule's axis."""

import numpy as np
import pytest
import warp as wp

from nuno.contact.particle.feature_points import past_axis
from nuno.numbers.vec3 import vec3


@wp.kernel(enable_backward=False, module="test_past_axis")
def parts(start: wp.array(dtype=wp.vec3), way: wp.array(dtype=wp.vec3), half: float, found: wp.array(dtype=float)):
    """The part of each way."""
    k = wp.tid()
    a = start[k]
    w = way[k]
    found[k] = past_axis(vec3(a[0], a[1], a[2]), vec3(w[0], w[1], w[2]), half)


@pytest.mark.long
def test_an_edge_is_nowhere_nearer_to_an_axis_than_where_it_is_found():
    """Definition: of 2,001 points along each of 2,000 edges none is nearer, beside the axis, beyond it and across."""
    rng = np.random.default_rng(3)
    for half in (0.0, 0.02, 0.3):
        start = rng.normal(scale=0.04, size=(2000, 3)).astype(np.float32)
        way = rng.normal(scale=0.04, size=(2000, 3)).astype(np.float32)
        found = wp.zeros(2000, dtype=float, device="cpu")
        inputs = [wp.array(start, dtype=wp.vec3, device="cpu"), wp.array(way, dtype=wp.vec3, device="cpu"), half, found]
        wp.launch(parts, dim=2000, inputs=inputs, device="cpu")

        def away(part, start=start, way=way, half=half):
            """Return how far the points at parts (m, n or 1) of the ways are from the axis (m, n) [m]."""
            x = start[:, None] + part[..., None] * way[:, None]
            x[..., 2] -= np.clip(x[..., 2], -half, half)
            return np.linalg.norm(x, axis=2)

        least = away(np.broadcast_to(np.linspace(0.0, 1.0, 2001), (2000, 2001))).min(axis=1)
        # float rounding of 0.2 m
        assert (away(np.clip(found.numpy(), 0.0, 1.0)[:, None])[:, 0] < least + 1e-7).all()
