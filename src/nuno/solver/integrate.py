"""The first and the last act of a substep: predict positions, and read velocities off them."""

from typing import Any

import warp as wp

from nuno.solver.lanes import add, choose, fill, most, mul, over, root, rough, sub, times  # noqa: F401
from nuno.solver.state import CLOCK, DRAG, FASTEST, PICKED, SPEED, TRAVEL, Settings, StateFloat, StateLanes
from nuno.solver.vector import at, put
from nuno.solver.warps import leads_warp, most_of_warp


@wp.func
def predict(t: Any, n: int, run: Settings, thread: int, threads: int):
    """Gravity, pushes and air drag (implicit: v / (1 + drag dt)), then x = p + v dt."""
    one = fill(t.x[0], 1.0)
    zero = fill(t.x[0], 0.0)
    slow = over(one, one + t.scalars[DRAG] * run.dt)
    gx = fill(one, run.gravity[0] * run.dt)
    gy = fill(one, run.gravity[1] * run.dt)
    gz = fill(one, run.gravity[2] * run.dt)
    for i in range(thread, n, threads):
        w = at(t.w, i)
        free = choose(w, one, zero)
        ux = at(t.vx, i) + gx
        uy = at(t.vy, i) + gy
        uz = at(t.vz, i) + gz
        if run.pushed != 0:
            ux = ux + times(w, at(t.fx, i)) * run.dt
            uy = uy + times(w, at(t.fy, i)) * run.dt
            uz = uz + times(w, at(t.fz, i)) * run.dt
        keep = times(free, slow)
        ux = times(ux, keep)
        uy = times(uy, keep)
        uz = times(uz, keep)
        x = at(t.x, i)
        y = at(t.y, i)
        z = at(t.z, i)
        put(t.px, i, x)
        put(t.py, i, y)
        put(t.pz, i, z)
        put(t.vx, i, ux)
        put(t.vy, i, uy)
        put(t.vz, i, uz)
        put(t.x, i, x + ux * run.dt)
        put(t.y, i, y + uy * run.dt)
        put(t.z, i, z + uz * run.dt)


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
        vx = at(t.vx, i) + (at(t.x, i) - (at(t.px, i) + at(t.vx, i) * run.dt)) * rate
        vy = at(t.vy, i) + (at(t.y, i) - (at(t.py, i) + at(t.vy, i) * run.dt)) * rate
        vz = at(t.vz, i) + (at(t.z, i) - (at(t.pz, i) + at(t.vz, i) * run.dt)) * rate
        put(t.vx, i, vx)
        put(t.vy, i, vy)
        put(t.vz, i, vz)
        top = most(top, times(vx, vx) + times(vy, vy) + times(vz, vz))
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
        t.notes[CLOCK] = t.notes[CLOCK] + fill(t.x[0], 1.0)
        t.notes[PICKED] = t.notes[PICKED] + root(t.notes[SPEED]) * run.dt
        t.notes[TRAVEL] = t.notes[TRAVEL] + root(t.notes[SPEED]) * run.dt
        t.notes[FASTEST] = most(t.notes[FASTEST], t.notes[SPEED])
