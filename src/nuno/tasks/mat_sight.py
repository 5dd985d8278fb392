"""What is read of a carried mat at every frame, on the device: where its middle is, and how near the arms are."""

# Warp: kernels are Python to a type checker, but not with Python's types
# mypy: disable-error-code="misc, index, valid-type"

from __future__ import annotations

from typing import Any

import numpy as np
import warp as wp

FAR = wp.constant(1.0e6)
"""[m] The gap where there is no shape."""


@wp.kernel(enable_backward=False, module="nuno.tasks.mat_sight")
def see_middle(positions: wp.array2d(dtype=wp.vec3), frame: int, middle_out: wp.array2d(dtype=wp.vec3)):
    """The mean of each world's vertices."""
    world = wp.tid()
    total = wp.vec3(0.0, 0.0, 0.0)
    n = positions.shape[1]
    # in 32 bits a sum about the first vertex loses nothing that matters, wherever the robot has walked to
    first = positions[world, 0]
    for i in range(n):
        total = total + (positions[world, i] - first)
    middle_out[frame, world] = first + total / float(n)


@wp.kernel(enable_backward=False, module="nuno.tasks.mat_sight")
def see_gaps(
    # of the mat
    positions: wp.array2d(dtype=wp.vec3),
    # of the arms: poses (walks, keys, shapes), half sides and sides of the body by shape
    places: wp.array3d(dtype=wp.vec3),
    turns: wp.array3d(dtype=wp.quat),
    halves: wp.array(dtype=wp.vec3),
    sides: wp.array(dtype=int),
    walk_of: wp.array(dtype=int),
    key: int,
    frame: int,
    # out
    gap_out: wp.array3d(dtype=float),
):
    """How far each arm's boxes are from the nearest vertex, 0 where one is inside."""
    world, side = wp.tid()
    walk = walk_of[world]
    nearest = float(FAR)
    for s in range(halves.shape[0]):
        if sides[s] == side:
            place = places[walk, key, s]
            back = wp.quat_inverse(turns[walk, key, s])
            half = halves[s]
            for i in range(positions.shape[1]):
                p = wp.quat_rotate(back, positions[world, i] - place)
                x = wp.max(wp.abs(p[0]) - half[0], 0.0)
                y = wp.max(wp.abs(p[1]) - half[1], 0.0)
                z = wp.max(wp.abs(p[2]) - half[2], 0.0)
                nearest = wp.min(nearest, x * x + y * y + z * z)
    gap_out[frame, world, side] = wp.sqrt(nearest)


class MatSight:
    """What was read in each frame of a run, kept on the device until it ends.

    Args:
        frames: Frames of the run.
        every: Gaps are read every so many frames.
        places: (walks, keys, shapes, 3) [m], of the arms' boxes, two keys a frame.
        turns: (walks, keys, shapes, 4), (w, x, y, z).
        halves: (shapes, 3) [m], half their sides.
        sides: (shapes,) int, 0 left, 1 right, -1 neither.
        walk_of: (worlds,) int, the walk of each world.
        device: Where the mat is simulated.
    """

    def __init__(
        self, frames: int, every: int, places: np.ndarray, turns: np.ndarray, halves: np.ndarray, sides: np.ndarray,
        walk_of: np.ndarray, device: str,
    ) -> None:  # fmt: skip
        worlds = len(walk_of)
        self.every, self._device = every, device
        self._shapes: tuple[Any, ...] = (
            wp.array(places.astype(np.float32), dtype=wp.vec3, device=device),
            wp.array(turns[..., [1, 2, 3, 0]].astype(np.float32), dtype=wp.quat, device=device),
            wp.array(halves.astype(np.float32), dtype=wp.vec3, device=device),
            wp.array(sides.astype(np.int32), dtype=int, device=device),
            wp.array(walk_of.astype(np.int32), dtype=int, device=device),
        )
        self._middle = wp.zeros((frames + 1, worlds), dtype=wp.vec3, device=device)
        self._gap = wp.zeros((frames // every + 1, worlds, 2), dtype=float, device=device)

    def see(self, positions: wp.array, frame: int) -> None:
        """Read the mat's vertices (worlds, n) of vec3 at the end of a frame, the 0th being the start."""
        worlds = positions.shape[0]
        wp.launch(see_middle, dim=worlds, inputs=[positions, frame], outputs=[self._middle], device=self._device)
        if frame % self.every == 0:
            wp.launch(
                see_gaps, dim=(worlds, 2), inputs=[positions, *self._shapes, 2 * frame, frame // self.every],
                outputs=[self._gap], device=self._device,
            )  # fmt: skip

    def middles(self) -> np.ndarray:
        """Return the mean of the vertices, (frames + 1, worlds, 3) float64 [m]."""
        return self._middle.numpy().astype(float)

    def gaps(self) -> np.ndarray:
        """Return the gaps to the left and the right arm, (readings, worlds, 2) float64 [m]."""
        return self._gap.numpy().astype(float)
