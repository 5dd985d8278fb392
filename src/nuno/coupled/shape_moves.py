"""Kernels that add up what shapes give a body's particles, shape by shape: see `nuno.solvers.shape_impulses`.

Places are a solver's arrays as plain numbers, floats or doubles; sums are in the same order, one shape's after the
other's.
"""

from typing import Any

import warp as wp

from nuno.coupled.bounded_particles import MOST, Particles
from nuno.coupled.coupled_passes import Layout, place_of
from nuno.numbers.doubles import float64


@wp.kernel(enable_backward=False)
def note_lengths(
    x: wp.array(dtype=Any), y: wp.array(dtype=Any), z: wp.array(dtype=Any), from_x: wp.array(dtype=Any),
    from_y: wp.array(dtype=Any), from_z: wp.array(dtype=Any), first: int, lengths: wp.array(dtype=float),
):  # fmt: skip
    """Note how far all particles were moved [m], from number ``first`` of ``lengths`` on."""
    k = wp.tid()
    d = wp.vec3(float(x[k] - from_x[k]), float(y[k] - from_y[k]), float(z[k] - from_z[k]))
    lengths[first + k] = wp.length(d)


@wp.kernel(enable_backward=False)
def add_moves(
    x: wp.array(dtype=Any), y: wp.array(dtype=Any), z: wp.array(dtype=Any), from_x: wp.array(dtype=Any),
    from_y: wp.array(dtype=Any), from_z: wp.array(dtype=Any), w: wp.array(dtype=float), dt: float, sharing: int,
    own: int, lengths: wp.array(dtype=float), rank: int, total: wp.array(dtype=wp.vec3),
):  # fmt: skip
    """Add the impulses [N s] that moved all particles to the sums of one shape.

    Of ``sharing`` shapes that moved them together it takes its share, by the ``lengths`` that each would move them by.
    """
    k = wp.tid()
    count = x.shape[0]
    # what is held goes where its path leads
    if w[k] > 0.0:
        d = wp.vec3(float(x[k] - from_x[k]), float(y[k] - from_y[k]), float(z[k] - from_z[k]))
        share = float(1.0)
        if sharing > 1:
            whole = float(0.0)
            for c in range(sharing):
                whole += lengths[c * count + k]
            share = wp.where(own == 0, 1.0, 0.0)
            if whole > 0.0:
                share = lengths[own * count + k] / whole
        total[rank * count + k] = total[rank * count + k] + d * (share / (w[k] * dt))


@wp.kernel(enable_backward=False)
def add_bounds(
    layout: Layout, particles: Particles, dt: float, ranks: wp.array(dtype=int), count: int,
    total: wp.array(dtype=wp.vec3),
):  # fmt: skip
    """Add what shapes gave the particles of a body that rows pressed on."""
    world, k = wp.tid()
    if k < particles.bounded_count[world]:
        j = particles.bounded[world * particles.count + k]
        i = j - world * particles.count - layout.first
        if i >= 0 and i < layout.particles:
            at = place_of(layout, world, i)
            for c in range(MOST * j, MOST * (j + 1)):
                s = particles.shape[c]
                if s >= 0 and ranks[s] >= 0:
                    moved = particles.shape_push[c] * particles.shape_normal[c] + particles.shape_drag[c]
                    n = ranks[s] * count + at
                    total[n] = total[n] + moved * (1.0 / (particles.w[j] * dt))


NOTE_LENGTHS, ADD_MOVES = (
    {number is float64: wp.overload(kernel, [*[wp.array(dtype=number)] * 6, *rest]) for number in (wp.float32, float64)}
    for kernel, rest in (
        (note_lengths, [int, wp.array(dtype=float)]),
        (add_moves, [wp.array(dtype=float), float, int, int, wp.array(dtype=float), int, wp.array(dtype=wp.vec3)]),
    )
)
"""By whether coordinates are doubles."""
