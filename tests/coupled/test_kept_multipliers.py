"""Multipliers that are kept from substep to substep: their room grows without losing any."""

import numpy as np
import warp as wp

from nuno.coupled.kept_multipliers import kept_room, more_kept_room


def test_more_room_keeps_what_is_kept():
    """Each world's rows stay at the beginning of its part, and those of particles are the same."""
    kept = kept_room(2, 3, 4, "cpu")
    assert len(kept.head) == 6
    assert not kept.at.numpy().any()  # none is kept yet, whatever the head says
    pushes, drags = np.arange(8.0), np.arange(24.0).reshape(8, 3)
    keys = np.arange(32).reshape(8, 4)
    for table, values in ((kept.push, pushes), (kept.drag, drags), (kept.key, keys), (kept.next, np.arange(8))):
        table.assign(values.astype(table.numpy().dtype))
    kept.at.assign(np.full(6, 0.5, dtype=np.float32))
    more = more_kept_room(kept, 2, 10)
    assert more.room == 10
    for name, values in (("push", pushes), ("drag", drags), ("key", keys), ("next", np.arange(8))):
        found = getattr(more, name).numpy().reshape(2, 10, -1)
        np.testing.assert_array_equal(found[:, :4], values.reshape(2, 4, -1))
        assert not found[:, 4:].any()
    assert isinstance(more.head, wp.array)
    np.testing.assert_array_equal(more.at.numpy(), kept.at.numpy())
