"""The first and the last act of a substep: predict positions, and read velocities off them."""

from typing import Any

import warp as wp

from nuno.solver.lanes import add, choose, div, fill, most, mul, root, rough, sub  # noqa: F401
from nuno.solver.state import CLOCK, DRAG, FASTEST, PICKED, SPEED, TRAVEL, Settings, StateFloat, StateLanes
from nuno.solver.vec3 import (
    dot,
    position,
    put_position,
    put_start_position,
    put_velocity,
    start_position,
    vec3,
    velocity,
)
from nuno.solver.vector import at
from nuno.solver.warps import leads_warp, most_of_warp


@wp.func
def predict(t: Any, n: int, run: Settings, thread: int, threads: int):
    """Gravity, pushes and air drag: v = (v + (g + w f) dt) / (1 + drag dt), then x = p + v dt."""
    one = fill(t.x[0], 1.0)
    zero = fill(t.x[0], 0.0)
    slow = one / (one + t.scalars[DRAG] * run.dt)
    g = run.gravity
    fall = vec3(fill(one, g[0] * run.dt), fill(one, g[1] * run.dt), fill(one, g[2] * run.dt))
    for i in range(thread, n, threads):
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
def raise_speed(notes: wp.array(dtype=float), value: float, thread: int, threads: int):
    """Keep the largest squared speed."""
    if threads > 1:
        high = most_of_warp(value, threads)
        # most values are below what is there already; only the others queue up for the atomic
        if leads_warp(thread, threads) and high > notes[SPEED]:
            wp.atomic_max(notes, SPEED, high)
    else:
        notes[SPEED] = most(notes[SPEED], value)


@wp.func
def raise_speed(notes: wp.array(dtype=Any), value: Any, thread: int, threads: int):
    notes[SPEED] = most(notes[SPEED], value)


@wp.func
def read_velocities(t: Any, n: int, run: Settings, thread: int, threads: int):
    """Velocities (x - p) / dt, and the largest speed.

    Written as the predicted velocity plus what the constraints moved, so that rounding of the large coordinates
    does not enter a free particle's velocity.
    """
    rate = 1.0 / run.dt
    top = fill(t.x[0], 0.0)
    for i in range(thread, n, threads):
        v = velocity(t, i)
        v = v + (position(t, i) - (start_position(t, i) + v * run.dt)) * rate
        put_velocity(t, i, v)
        top = most(top, dot(v, v))
    raise_speed(t.notes, top, thread, threads)


@wp.func
def round_places(near: Any, t: Any, n: int, thread: int, threads: int):
    """Bring the floats ``near`` beside coordinates that are doubles."""
    for i in range(thread, n, threads):
        near.x[i] = rough(t.x[i])
        near.y[i] = rough(t.y[i])
        near.z[i] = rough(t.z[i])


@wp.func
def round_places(near: StateFloat, t: StateFloat, n: int, thread: int, threads: int):
    """Floats stand beside themselves."""


@wp.func
def round_places(near: StateLanes, t: StateLanes, n: int, thread: int, threads: int):
    """Floats stand beside themselves."""


@wp.func
def reset_speed(t: Any, thread: int):
    """Forget the largest speed before it is measured anew; one thread does it."""
    if thread == 0:
        t.notes[SPEED] = fill(t.x[0], 0.0)


@wp.func
def tick(t: Any, run: Settings, thread: int):
    """Advance the clock, which counts substeps, and how far anything may have gone since pairs were listed."""
    if thread == 0:
        t.notes[CLOCK] = t.notes[CLOCK] + 1.0
        t.notes[PICKED] = t.notes[PICKED] + root(t.notes[SPEED]) * run.dt
        t.notes[TRAVEL] = t.notes[TRAVEL] + root(t.notes[SPEED]) * run.dt
        t.notes[FASTEST] = most(t.notes[FASTEST], t.notes[SPEED])
