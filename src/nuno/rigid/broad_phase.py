"""Broad phase of rigid bodies: rows of pairs of parts that may touch, and their manifolds, which last.

A pair stands in the row of its smaller part, so that no row is long: few parts as large as oneself find room around
one. Rows are listed anew where anything may have come nearer than the last list foresaw. A manifold is made anew
where its parts have moved against each other by more than `keep_within`; points found again keep their forces and
where they stuck.
"""

from typing import Any

import warp as wp

from nuno.numbers.block_group import wait_for
from nuno.rigid.convex import FLAT, SURFACE, Parts, convex_of
from nuno.rigid.manifold import collide, collide_flat
from nuno.rigid.mesh_manifolds import PATCHES, collide_mesh
from nuno.rigid.persistent_manifolds import (
    COUNTS,
    LISTINGS,
    NOTES,
    OVERFLOW,
    REACH,
    SPEED,
    TRAVEL,
    WAITING,
    Contacts,
    moves,
    ready,
    take_points,
)
from nuno.rigid.rigid_body import RigidState
from nuno.rigid.solve_order import may_act

LOOK = wp.constant(0.02)
"""[m] Least distance that a list looks ahead."""
AHEAD = wp.constant(7.0)
"""Substeps at the greatest speed that it looks ahead besides; a pair needs 2.5 of them itself."""
NEAR = wp.constant(0.002)
"""[m] Least distance at which points are kept ready."""


@wp.struct
class Rules:
    """The rules of contact: who touches whom, and how."""

    radius: wp.array(dtype=float)  # (capacity,) of each body around its centre of mass
    friction: wp.array(dtype=float)  # (worlds * capacity,)
    bounce: wp.array(dtype=float)
    group: wp.array(dtype=int)  # (capacity,)
    collides_with: wp.array(dtype=int)
    exceptions: int
    pair: wp.array(dtype=wp.int64)  # smaller slot * 2^32 + larger, sorted
    pair_friction: wp.array(dtype=float)  # (worlds, exceptions); -1: they do not touch, -2: no exception here


@wp.func
def find_exception(rules: Rules, a: int, b: int):
    """Return where the pair stands among the exceptions, or -1."""
    key = wp.int64(wp.min(a, b)) * wp.int64(4294967296) + wp.int64(wp.max(a, b))
    low = int(0)
    high = int(rules.exceptions)
    while low < high:
        middle = (low + high) / 2
        if rules.pair[middle] < key:
            low = middle + 1
        else:
            high = middle
    found = int(-1)
    if low < rules.exceptions:
        if rules.pair[low] == key:
            found = low
    return found


@wp.func
def pair_friction(rules: Rules, s: RigidState, world: int, a: int, b: int):
    """The pair's coefficient of friction, or -1 where the two do not touch."""
    mu = float(-1.0)
    if (rules.group[a] & rules.collides_with[b]) != 0 and (rules.group[b] & rules.collides_with[a]) != 0:
        first = world * s.capacity
        mu = wp.sqrt(rules.friction[first + a] * rules.friction[first + b])
        found = find_exception(rules, a, b)
        if found >= 0:
            own = rules.pair_friction[world * rules.exceptions + found]
            mu = wp.where(own < -1.5, mu, own)
    return mu


@wp.func
def turn_of(a: wp.quat, b: wp.quat):
    """The angle between two rotations [rad], or what is a little more."""
    d = wp.quat_inverse(a) * b
    return 2.05 * wp.sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2])


@wp.func
def reset_measures(c: Contacts, world: int):
    """Before `measure`, by one thread."""
    c.notes[world * NOTES + SPEED] = 0.0
    c.notes[world * NOTES + TRAVEL] = 0.0


@wp.func
def measure(s: RigidState, c: Contacts, rules: Rules, world: int, rank: int, size: int):
    """The greatest speed, and how far anything went since the rows were listed."""
    speed = float(0.0)
    travel = float(0.0)
    for k in range(rank, s.capacity, size):
        i = world * s.capacity + k
        if rules.radius[k] >= 0.0:
            r = wp.min(rules.radius[k], 100.0)
            if s.active[k] != 0:
                speed = wp.max(speed, wp.length(s.velocity[i]) + r * wp.length(s.spin[i]))
            went = wp.length(s.position[i] - c.listed_position[i]) + r * turn_of(c.listed_rotation[i], s.rotation[i])
            travel = wp.max(travel, went)
    if size > 1:
        if rank < s.capacity:
            wp.atomic_max(c.notes, world * NOTES + SPEED, speed)
            wp.atomic_max(c.notes, world * NOTES + TRAVEL, travel)
    else:
        c.notes[world * NOTES + SPEED] = speed
        c.notes[world * NOTES + TRAVEL] = travel


@wp.func
def must_list(c: Contacts, world: int, dt: float):
    """Return True if something may have come near that the rows do not have."""
    first = world * NOTES
    needed = NEAR + 3.0 * c.notes[first + SPEED] * dt
    return 2.0 * c.notes[first + TRAVEL] + needed > c.notes[first + REACH]


@wp.func
def apart(s: RigidState, parts: Parts, world: int, p: int, q: int):
    """At least how far part p's sphere is from part q's bounds [m]."""
    a = world * s.capacity + parts.slot[p]
    b = world * s.capacity + parts.slot[q]
    middle = parts.place[p] + wp.quat_rotate(parts.turn[p], 0.5 * (parts.low[p] + parts.high[p]))
    x = s.position[a] + wp.quat_rotate(s.rotation[a], middle) - s.position[b]
    x = wp.quat_rotate_inv(parts.turn[q], wp.quat_rotate_inv(s.rotation[b], x) - parts.place[q])
    off = wp.max(parts.low[q] - x, x - parts.high[q])
    off = wp.max(off, wp.vec3(0.0))
    return wp.length(off) - parts.radius[p]


@wp.func
def list_rows(s: RigidState, parts: Parts, c: Contacts, rules: Rules, world: int, dt: float, rank: int, size: int):
    """Bring the rows up to date: who went far goes, who came near gets the first free place."""
    reach = LOOK + AHEAD * c.notes[world * NOTES + SPEED] * dt
    for p in range(rank, parts.count, size):
        a = parts.slot[p]
        if a >= 0:
            if s.inverse_mass[world * s.capacity + a] > 0.0:
                list_row(s, parts, c, rules, world, p, a, reach)


@wp.func
def stands_in_row_of(s: RigidState, parts: Parts, world: int, p: int, q: int):
    """Return True if the pair is in the row of part p, which moves: if q is larger, or nothing moves it."""
    larger = parts.radius[q] > parts.radius[p]
    if parts.radius[q] == parts.radius[p]:
        larger = parts.rank[q] > parts.rank[p]
    return larger or s.inverse_mass[world * s.capacity + parts.slot[q]] == 0.0


@wp.func
def list_row(s: RigidState, parts: Parts, c: Contacts, rules: Rules, world: int, p: int, a: int, reach: float):
    """The row of part p, of body a."""
    first = (world * c.parts + p) * c.row
    for k in range(c.row):
        q = c.partner[first + k]
        if q >= 0:
            stays = int(0)
            if parts.slot[q] >= 0:
                mu = pair_friction(rules, s, world, a, parts.slot[q])
                if mu >= 0.0 and stands_in_row_of(s, parts, world, p, q) and apart(s, parts, world, p, q) <= reach:
                    stays = 1
            if stays == 0:
                c.partner[first + k] = -1
                c.count[first + k] = 0
    for q in range(parts.count):
        b = parts.slot[q]
        if b >= 0 and b != a:
            if stands_in_row_of(s, parts, world, p, q):
                if apart(s, parts, world, p, q) <= reach:
                    mu = pair_friction(rules, s, world, a, b)
                    if mu >= 0.0:
                        enter(parts, c, rules, world, s, first, q, a, b, mu)


@wp.func
def enter(
    parts: Parts, c: Contacts, rules: Rules, world: int, s: RigidState, first: int, q: int, a: int, b: int, mu: float
):
    """Give part q a place in the row, if it has none; a mesh has several."""
    wanted = int(1)
    if parts.kind[q] >= SURFACE:
        wanted = PATCHES
    bounce = wp.max(rules.bounce[world * s.capacity + a], rules.bounce[world * s.capacity + b])
    have = int(0)
    for k in range(c.row):
        if c.partner[first + k] == q:
            have = have + 1
            c.friction[first + k] = mu
            c.bounce[first + k] = bounce
    for k in range(c.row):
        if have < wanted and c.partner[first + k] < 0:
            e = first + k
            c.partner[e] = q
            c.patch[e] = have
            c.count[e] = 0
            c.clear[e] = -1.0
            c.friction[e] = mu
            c.bounce[e] = bounce
            have = have + 1
    if have < wanted:
        # told to the host, which makes longer rows
        wp.atomic_max(c.counts, world * COUNTS + OVERFLOW, 1)


@wp.func
def end_listing(s: RigidState, c: Contacts, world: int, dt: float, rank: int, size: int):
    """Remember where everything was."""
    for k in range(rank, s.capacity, size):
        i = world * s.capacity + k
        c.listed_position[i] = s.position[i]
        c.listed_rotation[i] = s.rotation[i]
    if rank == 0:
        first = world * NOTES
        c.notes[first + REACH] = LOOK + AHEAD * c.notes[first + SPEED] * dt
        c.notes[first + LISTINGS] = c.notes[first + LISTINGS] + 1.0


@wp.func
def keep_within(parts: Parts, p: int):
    """Return how far the parts may move against each other before their points are found anew [m]."""
    return wp.min(0.01 * parts.smallest[p], 0.0005)


@wp.func
def margin_for(s: RigidState, parts: Parts, world: int, p: int, q: int, away: wp.vec3, dt: float, down: float):
    """Up to how far apart two parts may touch within the substep [m]; ``away`` is from q's body to p's [m]."""
    a = parts.slot[p]
    b = parts.slot[q]
    i = world * s.capacity + a
    j = world * s.capacity + b
    speed = moves(s, i, a) * (wp.length(s.velocity[i]) + parts.radius[p] * wp.length(s.spin[i]))
    # a partner's spin counts where the owner is
    far = wp.min(wp.length(away) + parts.radius[p], parts.radius[q] + wp.length(parts.place[q]))
    speed = speed + moves(s, j, b) * (wp.length(s.velocity[j]) + far * wp.length(s.spin[j]))
    margin = NEAR + 1.25 * dt * (speed + down * dt)
    return wp.min(margin, 0.1 * parts.smallest[p] + 1.25 * dt * (speed + down * dt))


@wp.func
def refresh(s: RigidState, parts: Parts, c: Contacts, world: int, e: int, p: int, dt: float, down: float):
    """Find the entry's points anew where that is due."""
    q = c.partner[e]
    i = world * s.capacity + parts.slot[p]
    j = world * s.capacity + parts.slot[q]
    away = s.position[i] - s.position[j]
    margin = margin_for(s, parts, world, p, q, away, dt, down)
    kept = keep_within(parts, p)
    qa = s.rotation[i] * parts.turn[p]
    qb = s.rotation[j] * parts.turn[q]
    x = away + wp.quat_rotate(s.rotation[i], parts.place[p]) - wp.quat_rotate(s.rotation[j], parts.place[q])
    x = wp.quat_rotate_inv(qb, x)
    turn = wp.quat_inverse(qb) * qa
    moved = float(1.0e6)
    if c.clear[e] >= 0.0:
        moved = wp.length(x - c.built_place[e]) + parts.radius[p] * turn_of(c.built_turn[e], turn)
    n = c.count[e]
    if parts.kind[q] >= SURFACE:
        n = wp.where(c.clear[e] > 0.0, 0, 1)
    due = int(0)
    if n == 0:
        if c.clear[e] < 0.0 or c.clear[e] - moved <= margin:
            due = 1
    elif moved > kept or margin + kept > c.margin[e]:
        due = 1
    if due == 1:
        place = wp.zeros(shape=(24,), dtype=wp.vec3)
        gap = wp.zeros(shape=(24,), dtype=float)
        reach = 1.5 * margin + kept
        known = wp.where(moved > 1.0e5, 0.0, moved)
        c.margin[e] = reach
        c.built_place[e] = x
        c.built_turn[e] = turn
        part = convex_of(parts, p)
        if parts.kind[q] >= SURFACE:
            c.clear[e] = 0.0
            collide_mesh(s, parts, c, world, e, p, i, j, part, x, turn, reach, known, place, gap)
        else:
            normal = wp.vec3(0.0, 0.0, 1.0)
            least = float(0.0)
            count = int(0)
            if parts.kind[q] == FLAT:
                normal, least, count = collide_flat(parts, part, x, turn, reach, place, gap)
            else:
                normal, least, count = collide(parts, part, x, turn, convex_of(parts, q), reach, place, gap)
            c.clear[e] = wp.max(least, 0.0)
            if count > 0 or n > 0:
                take_points(s, parts, c, e, p, i, j, normal, count, known, place, gap)


@wp.func
def list_entries(parts: Parts, c: Contacts, world: int):
    """List the entries in use, row by row, so that one thread need not go through all places of all rows again."""
    count = int(0)
    for p in range(parts.count):
        if parts.slot[p] >= 0:
            first = (world * c.parts + p) * c.row
            for k in range(c.row):
                if c.partner[first + k] >= 0:
                    c.waiting[world * c.parts * c.row + count] = first + k
                    count = count + 1
    c.counts[world * COUNTS + WAITING] = count


@wp.func
def places(parts: Parts, c: Contacts, world: int, size: int):
    """Return how many places of rows there are to go through: of one thread those listed, see `entry_at`."""
    count = parts.count * c.row
    if size == 1:
        count = c.counts[world * COUNTS + WAITING]
    return count


@wp.func
def entry_at(parts: Parts, c: Contacts, world: int, k: int, size: int):
    """The k-th part and entry: of those listed, or for many threads first places first, which are in use."""
    base = world * c.parts * c.row
    p = k % parts.count
    e = base + p * c.row + k / parts.count
    if size == 1:
        e = c.waiting[base + k]
        p = (e - base) / c.row
    return p, e


@wp.func
def refresh_rows(
    s: RigidState, parts: Parts, c: Contacts, world: int, dt: float, down: float, rank: int, size: int, crew: Any
):
    """All manifolds, and what the passes need of them."""
    for k in range(rank, places(parts, c, world, size), size):
        p, e = entry_at(parts, c, world, k, size)
        if parts.slot[p] >= 0 and c.partner[e] >= 0 and c.patch[e] == 0:
            if may_act(s, parts, c, world, e, p) == 1:
                refresh(s, parts, c, world, e, p, dt, down)
    # a mesh's first entry has found the points of the others
    wait_for(crew)
    for k in range(rank, places(parts, c, world, size), size):
        p, e = entry_at(parts, c, world, k, size)
        if parts.slot[p] >= 0 and c.partner[e] >= 0 and c.count[e] > 0:
            if may_act(s, parts, c, world, e, p) == 1:
                ready(s, parts, c, world, e, p, dt, down)
