"""Measures of a carried mat at every frame, taken on the device: where its middle is, and how near the arms are."""

# Warp: kernels are Python to a type checker, but not with Python's types
# mypy: disable-error-code="misc, index, valid-type"

from __future__ import annotations

from typing import Any

import numpy as np
import warp as wp

from nuno.shapes.shape import Hull, Shape
from nuno.tables.hull_tables import in_separating_order
from nuno.tasks.arm_tracks import ArmTracks

FAR = wp.constant(1.0e6)
"""[m] The gap where there is no shape."""
INSIDE = wp.constant(0.0)
"""[m] The least gap."""


@wp.kernel(enable_backward=False, module="nuno.tasks.mat_sight")
def see_middle(
    positions: wp.array2d(dtype=wp.vec3),
    trial_of: wp.array(dtype=int),
    frame: int,
    middle_out: wp.array2d(dtype=wp.vec3),
):
    """The mean of each world's vertices."""
    world = wp.tid()
    total = wp.vec3(0.0, 0.0, 0.0)
    n = positions.shape[1]
    # in 32 bits a sum about the first vertex loses nothing that matters, wherever the robot has walked to
    first = positions[world, 0]
    for i in range(n):
        total = total + (positions[world, i] - first)
    middle_out[frame, trial_of[world]] = first + total / float(n)


@wp.kernel(enable_backward=False, module="nuno.tasks.mat_sight")
def see_gaps(
    # of the mat
    positions: wp.array2d(dtype=wp.vec3),
    # of the arms: poses (walks, keys, shapes), and by shape its planes, first and last, and the side of the body
    places: wp.array3d(dtype=wp.vec3),
    turns: wp.array3d(dtype=wp.quat),
    faces: wp.array(dtype=wp.vec2i),
    planes: wp.array(dtype=wp.vec4),
    sides: wp.array(dtype=int),
    walk_of: wp.array(dtype=int),
    trial_of: wp.array(dtype=int),
    key: int,
    frame: int,
    # out
    gap_out: wp.array3d(dtype=float),
):
    """Measure how far each arm's shapes are from the nearest vertex, 0 where one is inside."""
    world, s = wp.tid()
    side = sides[s]
    if side < 0:
        return
    trial = trial_of[world]
    walk = walk_of[trial]
    place = places[walk, key, s]
    back = wp.quat_inverse(turns[walk, key, s])
    nearest = float(FAR)
    for i in range(positions.shape[1]):
        p = wp.quat_rotate(back, positions[world, i] - place)
        gap = float(INSIDE)
        for k in range(faces[s][0], faces[s][1]):
            f = planes[k]
            gap = wp.max(gap, f[0] * p[0] + f[1] * p[1] + f[2] * p[2] - f[3])
            if gap >= nearest:
                break
        nearest = wp.min(nearest, gap)
    wp.atomic_min(gap_out, frame, trial, side, nearest)  # the least does not depend on who comes first


class MatSight:
    """Measures of each frame of a run, kept on the device until it ends.

    Args:
        tracks: Of the arms.
        every: Gaps are read every so many frames.
        walk_of: (trials,) int, the walk of each; at first each has a world.
        device: Where the mat is simulated.
    """

    def __init__(self, tracks: ArmTracks, every: int, walk_of: np.ndarray, device: str) -> None:
        trials, frames = len(walk_of), tracks.frames
        self.every, self._device = every, device
        places, turns = (array.transpose(0, 2, 1, 3) for array in (tracks.positions, tracks.quaternions))
        planes = [in_separating_order(_planes(part)) for part in tracks.parts]
        ends = np.cumsum([0, *map(len, planes)])
        self._shapes: tuple[Any, ...] = (
            wp.array(places.astype(np.float32), dtype=wp.vec3, device=device),
            wp.array(turns[..., [1, 2, 3, 0]].astype(np.float32), dtype=wp.quat, device=device),
            wp.array(np.stack([ends[:-1], ends[1:]], axis=1).astype(np.int32), dtype=wp.vec2i, device=device),
            wp.array(np.concatenate(planes).astype(np.float32), dtype=wp.vec4, device=device),
            wp.array(tracks.sides.astype(np.int32), dtype=int, device=device),
            wp.array(walk_of.astype(np.int32), dtype=int, device=device),
        )
        self._middle = wp.full((frames + 1, trials), wp.vec3(wp.NAN, wp.NAN, wp.NAN), dtype=wp.vec3, device=device)
        self._gap = wp.full((frames // every + 1, trials, 2), FAR, dtype=float, device=device)
        self.go_on_with(np.arange(trials))

    def go_on_with(self, trials: np.ndarray) -> None:
        """Have only these trials (worlds,) from now on, one in each world."""
        self._trial_of: Any = wp.array(trials.astype(np.int32), dtype=int, device=self._device)

    def see(self, positions: wp.array, frame: int) -> None:
        """Read the mat's vertices (worlds, n) of vec3 at the end of a frame, the 0th being the start."""
        worlds = positions.shape[0]
        seen = [positions, self._trial_of, frame]
        wp.launch(see_middle, dim=worlds, inputs=seen, outputs=[self._middle], device=self._device)
        if frame % self.every == 0:
            wp.launch(
                see_gaps, dim=(worlds, len(self._shapes[-2])), outputs=[self._gap], device=self._device,
                inputs=[positions, *self._shapes, self._trial_of, 2 * frame, frame // self.every],
            )  # fmt: skip

    def middles(self) -> np.ndarray:
        """Return the mean of the vertices, (frames + 1, trials, 3) float64 [m], NaN where nobody saw it."""
        return self._middle.numpy().astype(float)

    def gaps(self) -> np.ndarray:
        """Return the gaps to the left and the right arm, (readings, trials, 2) float64 [m]."""
        return self._gap.numpy().astype(float)


def _planes(part: Shape) -> np.ndarray:
    return (part if isinstance(part, Hull) else Hull.of(part.mesh()[0])).planes
