"""One bend at a time, and its damping: what an update leaves of it, by its equation."""

import numpy as np
import pytest
import warp as wp

from nuno.constraints.bending import bend_line, bend_twist
from nuno.constraints.damping import damp_line, damp_twist
from nuno.state.cloth_state import StateFloat

STENCILS = {"line": np.array([1.0, -2.0, 1.0]), "twist": np.array([1.0, -1.0, -1.0, 1.0])}
"""k_i of c = sum k_i x_i."""


@wp.kernel(enable_backward=False)
def _bend(t: StateFloat, line: bool, damped: bool, alpha: float, gamma: float):
    if line and damped:
        damp_line(t, 0, 1, 2, alpha, gamma)
    elif line:
        bend_line(t, 0, 1, 2, alpha)
    elif damped:
        damp_twist(t, 0, 1, 2, 3, alpha, gamma)
    else:
        bend_twist(t, 0, 1, 2, 3, alpha)


@pytest.mark.parametrize("alpha", [0.0, 0.5, 2.0, 20.0])
@pytest.mark.parametrize("damped", [False, True])
@pytest.mark.parametrize("kind", STENCILS)
def test_an_update_takes_its_share_of_a_bend(kind, damped, alpha):
    """Closed form: dx_i = -w_i k_i c / D leaves c (1 - W / D), W = sum w_i k_i^2 and D = max(W / 2 + alpha, 0.8 W).

    Damping does the same to velocities with gamma^2 W and gamma W. Momentum, sum dx_i / w_i, stays.
    """
    stencil, random, gamma = STENCILS[kind], np.random.default_rng(3), 1.5
    count = len(stencil)
    values = random.normal(size=(6, count)).astype(np.float32)
    inverse_mass = random.uniform(0.5, 2.0, count).astype(np.float32)
    t = StateFloat()
    for name, column in zip(("x", "y", "z", "vx", "vy", "vz", "w"), [*values, inverse_mass], strict=True):
        setattr(t, name, wp.array(column, dtype=float, device="cpu"))
    wp.launch(_bend, dim=1, inputs=[t, kind == "line", damped, alpha, gamma], device="cpu")
    after = np.stack([getattr(t, name).numpy() for name in ("x", "y", "z", "vx", "vy", "vz")])
    changed, kept = (slice(3, 6), slice(0, 3)) if damped else (slice(0, 3), slice(3, 6))
    np.testing.assert_array_equal(after[kept], values[kept])
    weight = (inverse_mass.astype(float) * stencil**2).sum() * (gamma if damped else 1.0)
    share = weight / max(0.5 * weight + alpha, 0.8 * weight)
    before = values[changed].astype(float)
    np.testing.assert_allclose(after[changed] @ stencil, (1.0 - share) * (before @ stencil), atol=2e-5)
    np.testing.assert_allclose(((after[changed] - before) / inverse_mass).sum(axis=1), 0.0, atol=2e-6)
