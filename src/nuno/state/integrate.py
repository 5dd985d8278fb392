"""The first and the last act of a substep: predict positions, and read velocities off them."""

from typing import Any

import warp as wp

from nuno.numbers.element_access import at
from nuno.numbers.lanes import add, choose, div, full_like, maximum, mul, sqrt, sub, to_float  # noqa: F401
from nuno.numbers.vec3 import (
    dot,
    position,
    put_position,
    put_start_position,
    put_velocity,
    start_position,
    vec3,
    velocity,
)
from nuno.numbers.warps import leads_warp, warp_max
from nuno.state.cloth_state import CLOCK, DRAG, FASTEST, INNER_TRAVEL, SPEED, TRAVEL, Settings, StateFloat, StateLanes


@wp.func
def predict(t: Any, n: int, run: Settings, rank: int, size: int):
    """Gravity, pushes and air drag: v = (v + (g + w f) dt) / (1 + drag dt), then x = p + v dt."""
    one = full_like(t.x[0], 1.0)
    zero = full_like(t.x[0], 0.0)
    slow = one / (one + t.scalars[DRAG] * run.dt)
    g = run.gravity
    fall = vec3(full_like(one, g[0] * run.dt), full_like(one, g[1] * run.dt), full_like(one, g[2] * run.dt))
    for i in range(rank, n, size):
        w = at(t.w, i)
        v = velocity(t, i) + fall
        if run.pushed != 0:
            v = v + vec3(at(t.fx, i), at(t.fy, i), at(t.fz, i)) * w * run.dt
        v = v * (choose(w, one, zero) * slow)
        x = position(t, i)
        put_start_position(t, i, x)
        put_velocity(t, i, v)
        put_position(t, i, x + v * run.dt)


@wp.func
def raise_speed(notes: wp.array(dtype=float), value: float, rank: int, size: int):
    """Keep the largest squared speed."""
    if size > 1:
        high = warp_max(value, size)
        # most values are below what is there already; only the others queue up for the atomic
        if leads_warp(rank, size) and high > notes[SPEED]:
            wp.atomic_max(notes, SPEED, high)
    else:
        notes[SPEED] = maximum(notes[SPEED], value)


@wp.func
def raise_speed(notes: wp.array(dtype=Any), value: Any, rank: int, size: int):
    notes[SPEED] = maximum(notes[SPEED], value)


@wp.func
def read_velocities(t: Any, n: int, run: Settings, rank: int, size: int):
    """Velocities (x - p) / dt, and the largest speed.

    Written as the predicted velocity plus what the constraints moved, so that rounding of the large coordinates
    does not enter a free particle's velocity.
    """
    rate = 1.0 / run.dt
    top = full_like(t.x[0], 0.0)
    for i in range(rank, n, size):
        v = velocity(t, i)
        v = v + (position(t, i) - (start_position(t, i) + v * run.dt)) * rate
        put_velocity(t, i, v)
        top = maximum(top, dot(v, v))
    raise_speed(t.notes, top, rank, size)


@wp.func
def round_places(floats: Any, t: Any, n: int, rank: int, size: int):
    """Bring the floats ``near`` beside coordinates that are doubles."""
    for i in range(rank, n, size):
        floats.x[i] = to_float(t.x[i])
        floats.y[i] = to_float(t.y[i])
        floats.z[i] = to_float(t.z[i])


@wp.func
def round_places(floats: StateFloat, t: StateFloat, n: int, rank: int, size: int):
    """Floats stand beside themselves."""


@wp.func
def round_places(floats: StateLanes, t: StateLanes, n: int, rank: int, size: int):
    """Floats stand beside themselves."""


@wp.func
def reset_speed(t: Any, rank: int):
    """Forget the largest speed before it is measured anew; one thread does it."""
    if rank == 0:
        t.notes[SPEED] = full_like(t.x[0], 0.0)


@wp.func
def tick(t: Any, run: Settings, rank: int):
    """Advance the clock, which counts substeps, and how far anything may have gone since pairs were listed."""
    if rank == 0:
        t.notes[CLOCK] = t.notes[CLOCK] + 1.0
        t.notes[INNER_TRAVEL] = t.notes[INNER_TRAVEL] + sqrt(t.notes[SPEED]) * run.dt
        t.notes[TRAVEL] = t.notes[TRAVEL] + sqrt(t.notes[SPEED]) * run.dt
        t.notes[FASTEST] = maximum(t.notes[FASTEST], t.notes[SPEED])
