"""Masks counted and looked up by CUDA's kernels, run on the CPU, against NumPy."""

import numpy as np
import pytest
import warp as wp

from nuno.camera.covered_fields import count_covered, count_fields, look_up_covered, read_fields


def random_masks():
    """Return masks (3, 5, 7) bool, the last of which is empty, and the same on the CPU device."""
    masks = np.random.default_rng(0).random((3, 5, 7)) < [[[0.5]], [[0.9]], [[0.0]]]
    return masks, wp.array(masks, dtype=wp.bool, device="cpu")


def test_fields_are_counted_and_looked_up():
    """NumPy's count of each mask, and its values at places of one's own in each."""
    masks, there = random_masks()
    assert count_covered(there).tolist() == masks.sum(axis=(1, 2)).tolist()
    fields = np.random.default_rng(1).integers((5, 7), size=(3, 4, 2))
    expected = [[masks[k, row, column] for row, column in fields[k]] for k in range(3)]
    assert look_up_covered(there, fields).tolist() == expected


@pytest.mark.long
def test_cudas_kernels_find_the_same():
    """The kernels that a GPU has, launched on the CPU, give what NumPy does."""
    _, there = random_masks()
    counts = wp.zeros(3, dtype=int, device="cpu")
    wp.launch(count_fields, dim=(3, 5), inputs=[there, counts], device="cpu")
    assert counts.numpy().tolist() == count_covered(there).tolist()
    fields = np.random.default_rng(1).integers((5, 7), size=(3, 4, 2))
    found = wp.empty((3, 4), dtype=wp.bool, device="cpu")
    given = wp.array(fields.astype(np.int32), dtype=wp.vec2i, device="cpu")
    wp.launch(read_fields, dim=(3, 4), inputs=[there, given, found], device="cpu")
    assert found.numpy().tolist() == look_up_covered(there, fields).tolist()
