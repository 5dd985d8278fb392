"""Grips: vertices and surface points that follow key frames."""

from typing import Any

import warp as wp

from nuno.numbers.lanes import (  # noqa: F401 (add, div, mul, sub: Warp takes them for the operators)
    add,
    choose,
    clipped,
    div,
    full_like,
    gather,
    index_mask,
    lane_max,
    mul,
    place,
    relative_to,
    sub,
    to_float,
)
from nuno.state.cloth_state import CLOCK, LOADS, Settings

SAME_TIME = wp.constant(wp.float64(1.0e-9))
"""[s] Below which two times are the same."""
SHARES = wp.constant(wp.float64(2.0**30))
"""Shares of the way between two keys, more than a float tells; those of substeps, n in all, are 1 / n apart."""


@wp.func
def key_position(t: Any, run: Settings, g: int):
    """Return where grip g should be now: linear or quintic minimum jerk between its key frames.

    Whether a run goes through a frame or through many, its times are the same but for rounding. What comes of them is
    the same to the bit, as the share of the way between two keys is rounded to `SHARES`.
    """
    now = run.grip_start[0] + wp.float64(lane_max(t.notes[CLOCK])) * run.step
    first = g * run.keys
    k = int(0)
    while k < run.keys - 2 and now > run.grip_time[first + k + 1] + SAME_TIME:
        k = k + 1
    last = wp.min(k + 1, run.keys - 1)
    begin = run.grip_time[first + k]
    # the operator would take times for coordinates (see `nuno.numbers.doubles`)
    span = wp.sub(run.grip_time[first + last], begin)
    s = float(1.0)
    if span > wp.float64(0.0):
        s = wp.clamp(float(wp.rint(wp.sub(now, begin) / span * SHARES) / SHARES), 0.0, 1.0)
    if run.grip_ease[g] != 0:
        s = s * s * s * (10.0 + s * (6.0 * s - 15.0))
    a = first + k
    b = first + last
    x = t.grip_x[a] + (t.grip_x[b] - t.grip_x[a]) * s
    y = t.grip_y[a] + (t.grip_y[b] - t.grip_y[a]) * s
    z = t.grip_z[a] + (t.grip_z[b] - t.grip_z[a]) * s
    return x, y, z


@wp.func
def hold_vertices(t: Any, run: Settings, rank: int, size: int):
    """Stiff grips on vertices: the vertex stands where its path is, all but immovable.

    For the time of the constraints it has a small share of its inverse mass, so that where they move it tells what they
    pull with; `read_loads` puts it back.
    """
    one = full_like(t.x[0], 1.0)
    for g in range(rank, run.grips, size):
        if run.grip_fixed[g] != 0:
            on = index_mask(one, t.grip_corner[3 * g])
            if lane_max(on) > 0.0:  # where no lane's world has it, another thread may be moving what would be written
                x, y, z = key_position(t, run, g)
                i = clipped(t.grip_corner[3 * g])
                # a world without this grip writes back what was there
                place(t.w, i, choose(on, t.grip_inverse_mass[g], gather(t.w, i)))
                place(t.x, i, choose(on, x, gather(t.x, i)))
                place(t.y, i, choose(on, y, gather(t.y, i)))
                place(t.z, i, choose(on, z, gather(t.z, i)))


@wp.func
def off_path(x: Any, a: Any, b: Any, c: Any, ka: Any, kb: Any, kc: Any, path: Any):
    """Return how far the mean of three coordinates with the weights k is from the path."""
    base = gather(x, a)
    mean = ka * relative_to(base, base) + kb * relative_to(gather(x, b), base)
    return mean + kc * relative_to(gather(x, c), base) - relative_to(path, base)


@wp.func
def pull_points(t: Any, run: Settings, rank: int, size: int):
    """Grips on surface points, and compliant ones: c = sum b_i x_i - path, one after the other."""
    if rank == 0:
        for g in range(run.grips):
            if run.grip_fixed[g] == 0:
                x, y, z = key_position(t, run, g)
                on = index_mask(x, t.grip_corner[3 * g])
                a = clipped(t.grip_corner[3 * g])
                b = clipped(t.grip_corner[3 * g + 1])
                c = clipped(t.grip_corner[3 * g + 2])
                ka = t.grip_weight[3 * g]
                kb = t.grip_weight[3 * g + 1]
                kc = t.grip_weight[3 * g + 2]
                dx = off_path(t.x, a, b, c, ka, kb, kc, x)
                dy = off_path(t.y, a, b, c, ka, kb, kc, y)
                dz = off_path(t.z, a, b, c, ka, kb, kc, z)
                wa = ka * gather(t.w, a)
                wb = kb * gather(t.w, b)
                wc = kc * gather(t.w, c)
                weight = wa * ka + wb * kb + wc * kc
                s = -on / (weight + (run.grip_compliance[g] + 1.0e-9))
                add_load(t, g, dx, dy, dz, -s)
                nudge(t, a, dx, dy, dz, s * wa)
                nudge(t, b, dx, dy, dz, s * wb)
                nudge(t, c, dx, dy, dz, s * wc)


@wp.func
def read_loads(t: Any, run: Settings, rank: int, size: int):
    """Sum up what the constraints pulled stiffly gripped vertices with, and put the vertices back."""
    one = full_like(t.x[0], 1.0)
    for g in range(rank, run.grips, size):
        if run.grip_fixed[g] != 0 and lane_max(index_mask(one, t.grip_corner[3 * g])) > 0.0:
            x, y, z = key_position(t, run, g)
            i = clipped(t.grip_corner[3 * g])
            on = index_mask(x, t.grip_corner[3 * g])
            held_inverse_mass = t.grip_inverse_mass[g]
            share = on / (held_inverse_mass + 1.0e-30)
            add_load(
                t, g, to_float(gather(t.x, i) - x), to_float(gather(t.y, i) - y), to_float(gather(t.z, i) - z), share
            )
            place(t.x, i, choose(on, x, gather(t.x, i)))
            place(t.y, i, choose(on, y, gather(t.y, i)))
            place(t.z, i, choose(on, z, gather(t.z, i)))
            place(t.w, i, choose(on, x - x, gather(t.w, i)))


@wp.func
def add_load(t: Any, g: int, dx: Any, dy: Any, dz: Any, s: Any):
    """Add s (dx, dy, dz) to a grip's load, one substep's."""
    k = LOADS * g
    t.grip_load[k] = t.grip_load[k] + dx * s
    t.grip_load[k + 1] = t.grip_load[k + 1] + dy * s
    t.grip_load[k + 2] = t.grip_load[k + 2] + dz * s
    t.grip_load[k + 3] = t.grip_load[k + 3] + 1.0


@wp.func
def forget_loads(t: Any, run: Settings, rank: int, size: int):
    """Start the sums of a frame."""
    for k in range(rank, LOADS * run.grips, size):
        t.grip_load[k] = full_like(t.x[0], 0.0)


@wp.func
def nudge(t: Any, i: Any, dx: Any, dy: Any, dz: Any, s: Any):
    """Move particle i (its own in each lane) by s (dx, dy, dz)."""
    place(t.x, i, gather(t.x, i) + dx * s)
    place(t.y, i, gather(t.y, i) + dy * s)
    place(t.z, i, gather(t.z, i) + dz * s)
