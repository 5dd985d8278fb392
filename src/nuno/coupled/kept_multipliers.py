"""Multipliers of rows that are kept from one substep of a frame to the next, where cloth lies between rigid bodies.

28 passes from nothing do not bring the weight of a pile of plates down through its napkins, and what they leave is the
same in every substep, so that the pile creeps. From where the substep before ended they have only to follow what has
changed. A frame begins with none: nothing of this is in what a world saves, and a copy goes as its original.
"""

import warp as wp

from nuno.coupled.bounded_particles import Particles
from nuno.coupled.contact_rows import Rows
from nuno.coupled.pass_progress import Passing, is_linked
from nuno.rigid.rigid_body import RigidState, shift_whole, turn_whole


@wp.struct
class Kept:
    """The active rows of the last substep, ``room`` a world, chained by their first particles."""

    room: int
    head: wp.array(dtype=int)  # (particles), the first of them, where in the world's part of what follows
    at: wp.array(dtype=float)  # (particles), the fraction of the frame at which it was kept
    next: wp.array(dtype=int)  # -1: none
    key: wp.array(dtype=wp.vec4i)  # see `key_of`: a row has another number when rows are listed anew
    push: wp.array(dtype=float)
    drag: wp.array(dtype=wp.vec3)


def kept_room(worlds: int, particles: int, room: int, device: str) -> Kept:
    """Return room for ``room`` rows a world of so many particles, of which none is kept."""
    made = Kept()
    made.room = room
    made.head = wp.zeros(max(1, worlds * particles), dtype=int, device=device)
    made.at = wp.zeros(max(1, worlds * particles), dtype=float, device=device)
    for name, kind in (("next", int), ("key", wp.vec4i), ("push", float), ("drag", wp.vec3)):
        setattr(made, name, wp.zeros(max(1, worlds * room), dtype=kind, device=device))
    return made


def more_kept_room(kept: Kept, worlds: int, room: int) -> Kept:
    """Return the same with room for more rows a world."""
    made = kept_room(worlds, len(kept.head) // worlds, room, str(kept.head.device))
    made.head, made.at = kept.head, kept.at
    for name in ("next", "key", "push", "drag") if kept.room else ():
        before = getattr(kept, name).numpy().reshape(worlds, kept.room, -1)
        after = getattr(made, name).numpy().reshape(worlds, room, -1)
        after[:, : kept.room] = before
        getattr(made, name).assign(after.reshape(getattr(made, name).numpy().shape))
    return made


@wp.func
def key_of(rows: Rows, r: int):
    """The kind of a row, the rigid body's part, and its particles but for the first."""
    corners = rows.corners[r]
    return wp.vec4i(8 * rows.part[r] + rows.kind[r], corners[1], corners[2], corners[3])


@wp.func
def recall(kept: Kept, particles: Particles, rigid: RigidState, rows: Rows, passing: Passing, world: int, first: int,
           start: int, base: int, count: int, fraction: float, step: float):  # fmt: skip
    """Start the active rows of linked islands with the multipliers that they had, and move what they hold by these."""
    for k in range(count):
        r = rows.active[base + k]
        corners = rows.corners[r]
        j = first + corners[0]
        age = fraction - kept.at[j]
        if kept.at[j] > 0.0 and age > 0.0 and age < 1.5 * step and is_linked(passing, world, rows.bodies[r][0]) != 0:
            key = key_of(rows, r)
            m = kept.head[j]
            while m >= 0:
                e = world * kept.room + m
                m = kept.next[e]
                if kept.key[e] == key:
                    push = kept.push[e]
                    drag = kept.drag[e]
                    # friction lies in the tangent plane of where the substep began
                    drag = drag - rows.normal[r] * wp.dot(drag, rows.normal[r])
                    rows.push[r] = push
                    rows.drag[r] = drag
                    impulse = rows.normal[r] * push + drag
                    for c in range(4):
                        if corners[c] >= 0:
                            i = first + corners[c]
                            particles.u[i] = particles.u[i] + impulse * (rows.weights[r][c] * particles.w[i])
                    if rows.slot[r] >= 0:
                        i = start + rows.slot[r]
                        arm = wp.quat_rotate(rigid.rotation[i], rows.point[r])
                        shift_whole(rigid, i, rigid.weight[i] * -impulse)
                        turn_whole(rigid, i, rigid.give[i] * wp.cross(arm, -impulse))


@wp.func
def keep(kept: Kept, rows: Rows, passing: Passing, world: int, first: int, base: int, count: int, fraction: float):
    """Keep the multipliers of the active rows of linked islands for the next substep."""
    for k in range(count):
        kept.head[first + rows.corners[rows.active[base + k]][0]] = -1
    for k in range(count):
        r = rows.active[base + k]
        if rows.push[r] > 0.0 and is_linked(passing, world, rows.bodies[r][0]) != 0:
            j = first + rows.corners[r][0]
            e = world * kept.room + k
            kept.key[e] = key_of(rows, r)
            kept.push[e] = rows.push[r]
            kept.drag[e] = rows.drag[r]
            kept.next[e] = kept.head[j]
            kept.head[j] = k
            kept.at[j] = fraction
