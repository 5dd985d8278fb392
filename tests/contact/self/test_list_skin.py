"""The margin of a neighbour list that moves have used up, by the corners of boxes."""

from itertools import product

import numpy as np
import pytest
import warp as wp

from nuno.contact.self.list_skin import used_up
from nuno.state.cloth_state import StateFloat

FAR = 0.02


@wp.kernel(enable_backward=False)
def _used_up(t: StateFloat, far: float, out: wp.array(dtype=float)):
    out[0] = used_up(t, 0, 1, 12, far)


def boxes(rng, size):
    """Two boxes (2, 6): lower and upper corners."""
    low = rng.uniform(-size, size, (2, 3))
    return np.concatenate([low, low + rng.uniform(0.0, size, (2, 3))], axis=1)


def corners(box):
    """(8, 3), of one box."""
    return np.array([[box[c + 3 * side] for c, side in enumerate(sides)] for sides in product((0, 1), repeat=3)])


@pytest.mark.parametrize("seed", range(20))
def test_what_two_boxes_used_up_is_their_largest_move_less_what_they_had_to_spare(seed):
    """Exact: the longest difference of two moves, by all corners, less the widest gap of an axis beyond ``far``."""
    rng = np.random.default_rng(seed)
    places, moves = boxes(rng, 0.1), boxes(rng, 0.03)
    t = StateFloat()
    t.bounds = wp.array(np.concatenate([places, moves]).ravel().astype(np.float32), dtype=float, device="cpu")
    found = wp.zeros(1, dtype=float, device="cpu")
    wp.launch(_used_up, dim=1, inputs=[t, FAR, found], device="cpu")
    farthest = max(np.linalg.norm(u - v) for u in corners(moves[0]) for v in corners(moves[1]))
    gap = max(max(places[0, c] - places[1, c + 3], places[1, c] - places[0, c + 3]) for c in range(3))
    assert found.numpy()[0] == pytest.approx(farthest - max(gap - FAR, 0.0), abs=1e-7)
