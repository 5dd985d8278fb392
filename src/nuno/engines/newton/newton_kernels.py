"""Kernels beside Newton's: what leads particles and bodies, and the drag of still air."""

from __future__ import annotations

from typing import Any

import warp as wp


@wp.kernel
def lead_particles(
    # driven
    indices: wp.array(dtype=wp.int32),  # type: ignore[valid-type]
    places: wp.array2d(dtype=wp.vec3),  # type: ignore[valid-type]
    substep: int,
    # out
    position_out: wp.array(dtype=wp.vec3),  # type: ignore[valid-type]
    velocity_out: wp.array(dtype=wp.vec3),  # type: ignore[valid-type]
) -> None:
    """Put each held particle where it is at the end of a substep."""
    k = wp.tid()
    i = indices[k]
    position_out[i] = places[substep, k]
    velocity_out[i] = wp.vec3(0.0, 0.0, 0.0)


@wp.kernel
def lead_bodies(
    # driven
    indices: wp.array(dtype=wp.int32),  # type: ignore[valid-type]
    poses: wp.array2d(dtype=wp.transform),  # type: ignore[valid-type]
    speeds: wp.array2d(dtype=wp.spatial_vector),  # type: ignore[valid-type]
    substep: int,
    # out
    pose_out: wp.array(dtype=wp.transform),  # type: ignore[valid-type]
    speed_out: wp.array(dtype=wp.spatial_vector),  # type: ignore[valid-type]
) -> None:
    """Put each kinematic body where it is at the end of a substep."""
    k = wp.tid()
    i = indices[k]
    pose_out[i] = poses[substep, k]
    speed_out[i] = speeds[substep, k]


@wp.kernel
def drag_particles(
    factor: wp.array(dtype=float),  # type: ignore[valid-type]
    velocity: wp.array(dtype=wp.vec3),  # type: ignore[valid-type]
) -> None:
    """Divide velocities as air drag does in a substep."""
    i = wp.tid()
    velocity[i] = factor[i] * velocity[i]


@wp.kernel
def drag_bodies(
    factor: wp.array(dtype=float),  # type: ignore[valid-type]
    velocity: wp.array(dtype=wp.spatial_vector),  # type: ignore[valid-type]
) -> None:
    """Divide velocities and spins as air drag does in a substep."""
    i = wp.tid()
    velocity[i] = factor[i] * velocity[i]


KERNELS: tuple[Any, ...] = (lead_particles, lead_bodies, drag_particles, drag_bodies)
