"""Projections of single contact rows: pushes along their normals, and Coulomb friction against their slip.

Friction between two cloths, or any two bodies that move, is here.

A row asks beforehand how far its particles give way: what lies on a shape not at all (`give_along`), what lies on
another rigid body as that does (`give_on`).
"""

import warp as wp

from nuno.coupled.bounded_particles import (
    Particles,
    bound,
    bound_corners,
    give_along,
    is_between,
    is_bounded,
    rub_between,
)
from nuno.coupled.contact_rows import (
    MOMENTUM,
    Rows,
    apply_row,
    body_weight,
    corner_weight,
    corners_weight,
    row_gap,
    row_slip,
    row_weight,
)
from nuno.coupled.rigid_supports import (
    SPLIT,
    ease_on,
    follow,
    give_on,
    move_support,
    no_supports,
    rub_both,
    support_of,
    support_slip,
    support_weight,
    supports_of,
)
from nuno.rigid.rigid_body import RigidState

ENOUGH_GAP = wp.constant(1.0e-7)
"""[m] Passes do not go on for a gap between particles alone that is off by less. Each substep measures gaps anew, so
that their errors do not add up as slips do; two towels at rest on each other take a quarter of the time."""


@wp.func
def push_step(particles: Particles, rigid: RigidState, first: int, start: int, rows: Rows, r: int, gap: float,
              compliance: float, linked: int, at_once: int):  # fmt: skip
    """By how much a row's multiplier is to grow so that its gap closes, as far as shapes let its particles go."""
    n = rows.normal[r]
    corners = rows.corners[r]
    weights = rows.weights[r]
    rigid_part = body_weight(particles, rigid, start, rows, r, n, at_once)
    total = corners_weight(particles, first, rows, r, at_once) + rigid_part
    step = -gap / (total + compliance)
    on = no_supports()
    gaps = wp.vec4(0.0, 0.0, 0.0, 0.0)
    eases = wp.vec4(1.0, 1.0, 1.0, 1.0)
    if linked != 0:
        on = supports_of(particles, first, rows, r)
        for k in range(4):
            if on[k] >= 0:
                on_gap, on_ease = ease_on(particles, rigid, first, start, rows, on[k])
                gaps[k] = on_gap
                eases[k] = on_ease
    if is_bounded(particles, first, corners) or wp.max(on) >= 0:
        # which particles end on a surface depends on the step, and the step on them
        passes = int(2)
        for _again in range(passes):
            total = 1.0e-9 + rigid_part
            left = float(gap)
            # supports may be one body, that all of them move together
            roots = float(0.0)
            for k in range(4):
                if on[k] >= 0:
                    w = particles.w[first + corners[k]]
                    cosine = wp.dot(n, rows.normal[on[k]])
                    push = step * weights[k] * w
                    share, besides = give_on(w, gaps[k], eases[k], rows.push[on[k]], cosine, push)
                    roots += wp.abs(weights[k]) * wp.sqrt(w * share)
                    left += weights[k] * besides
                elif corners[k] >= 0:
                    i = first + corners[k]
                    share, besides = give_along(particles, i, n, step * weights[k] * particles.w[i])
                    total += weights[k] * weights[k] * corner_weight(particles, i, at_once) * share
                    left += weights[k] * besides
            total += roots * roots
            step = -left / (total + compliance)
    return step, on


@wp.func
def join_row(particles: Particles, rigid: RigidState, first: int, start: int, rows: Rows, r: int):
    """Give a row that is pressed its share of the masses, from the next pass on; returns how far it is pressed [m]."""
    gap = wp.dot(row_gap(particles, rigid, first, start, rows, r), rows.normal[r]) - rows.distance[r]
    if gap < 0.0:
        rows.sharing[r] = 1
        corners = rows.corners[r]
        for k in range(4):
            if corners[k] >= 0:
                wp.atomic_add(particles.joining, first + corners[k], 1)
        if rows.slot[r] >= 0:
            wp.atomic_add(particles.body_joining, start + rows.slot[r], 1)
    return wp.max(-gap, 0.0)


@wp.func
def push_row(particles: Particles, rigid: RigidState, first: int, start: int, rows: Rows, r: int, linked: int,
             at_once: int):  # fmt: skip
    """One projection of a row along its normal; returns how far it was from where it asks to be [m]."""
    n = rows.normal[r]
    push = rows.push[r]
    compliance = float(rows.compliance[r])
    pressed = float(compliance * push)
    if pressed > rows.squeeze[r]:
        pressed = rows.squeeze[r]
        compliance = 0.0
    gap = wp.dot(row_gap(particles, rigid, first, start, rows, r), n) - rows.distance[r] + pressed
    wrong = wp.max(-gap, 0.0)
    if gap < 0.0 or push > 0.0:
        step, on = push_step(particles, rigid, first, start, rows, r, gap, compliance, linked, at_once)
        if at_once != 0 and step * rows.push_change[r] > 0.0:
            step = step + MOMENTUM * rows.push_change[r]
        more = wp.max(push + step, 0.0)
        rows.push[r] = more
        rows.push_change[r] = more - push
        apply_row(particles, rigid, first, start, rows, r, n * (more - push), at_once)
        if at_once == 0:
            bound_corners(particles, first, rows.corners[r], 0)
            if linked != 0:
                for k in range(4):
                    if on[k] >= 0:
                        follow(particles, rigid, first, start, rows, on[k])
        if push > 0.0:
            wrong = wp.abs(gap)
    if rows.slot[r] < 0 and at_once == 0 and linked == 0 and wrong < ENOUGH_GAP:
        wrong = 0.0
    return wrong


@wp.func
def drag_between(particles: Particles, rigid: RigidState, first: int, start: int, rows: Rows, r: int, c: int,
                 slip: wp.vec3, most: float, at_once: int):  # fmt: skip
    """`drag_row` of a particle that a rigid body presses on a shape, its contact c; see `rub_between`."""
    i = first + rows.corners[r][0]
    n = rows.normal[r]
    old = rows.drag[r]
    before = particles.shape_drag[c]
    w = corner_weight(particles, i, at_once)
    own = particles.u[i] - n * wp.dot(particles.u[i], n)
    motion = particles.shape_motion[c]
    motion = motion - n * wp.dot(motion, n)
    body_w = body_weight(particles, rigid, start, rows, r, wp.normalize(slip + n * 1.0e-12), at_once)
    free = own - old * w - before
    body_free = own - slip + old * body_w
    limit_shape = particles.shape_friction[c] * particles.shape_push[c]
    drag, multiplier = rub_between(free, w, motion, limit_shape, body_free, body_w, most)
    rows.drag[r] = multiplier
    rows.drag_change[r] = multiplier - old
    apply_row(particles, rigid, first, start, rows, r, multiplier - old, at_once)
    if at_once == 0:
        particles.shape_drag[c] = drag
        particles.u[i] = particles.u[i] + (drag - before)
        bound(particles, i, 1)
    return wp.length(drag - before) + wp.length(multiplier - old) * w


@wp.func
def drag_both(particles: Particles, rigid: RigidState, first: int, start: int, rows: Rows, r: int, s: int,
              slip: wp.vec3, most: float):  # fmt: skip
    """`drag_row` of a particle between two rigid bodies, those of rows r and s; see `rub_both`."""
    i = first + rows.corners[r][0]
    n = rows.normal[r]
    w = particles.w[i]
    own = particles.u[i] - n * wp.dot(particles.u[i], n)
    slip_b = support_slip(particles, rigid, first, start, rows, s)
    slip_b = slip_b - n * wp.dot(slip_b, n)
    old_a = rows.drag[r]
    old_b = rows.drag[s]
    wa = wp.max(support_weight(rigid, start, rows, r, wp.normalize(slip + n * 1.0e-12)), SPLIT * w)
    wb = wp.max(support_weight(rigid, start, rows, s, wp.normalize(slip_b + n * 1.0e-12)), SPLIT * w)
    limit_b = rows.friction[s] * rows.push[s]
    free = own - (old_a + old_b) * w
    a, b = rub_both(free, w, own - slip + old_a * wa, wa, most, own - slip_b + old_b * wb, wb, limit_b)
    rows.drag[r] = a
    rows.drag[s] = b
    move_support(particles, rigid, first, start, rows, r, a - old_a)
    move_support(particles, rigid, first, start, rows, s, b - old_b)
    return wp.length(a - old_a + b - old_b) * w + wp.length(a - old_a) * wa + wp.length(b - old_b) * wb


@wp.func
def drag_row(particles: Particles, rigid: RigidState, first: int, start: int, rows: Rows, r: int, linked: int,
             at_once: int):  # fmt: skip
    """Take back a row's slip, with up to mu times what its push has come to; returns what was left to take [m]."""
    most = rows.friction[r] * rows.push[r]
    old = rows.drag[r]
    if most <= 0.0 and wp.length_sq(old) == 0.0:
        return float(0.0)
    slip = row_slip(particles, rigid, first, start, rows, r)
    n = rows.normal[r]
    slip = slip - n * wp.dot(slip, n)
    length = wp.length(slip)
    if rows.slot[r] >= 0 and rows.corners[r][1] < 0:
        c = is_between(particles, first + rows.corners[r][0], n)
        if c >= 0:
            return drag_between(particles, rigid, first, start, rows, r, c, slip, most, at_once)
        # how two that are held share friction is open: a difference between them would use it up
        if linked != 0 and particles.held[start + rows.slot[r]] == 0:
            s = support_of(particles, rows, r, first + rows.corners[r][0], n)
            if s >= 0 and particles.held[start + rows.slot[wp.max(s, 0)]] == 0:
                return drag_both(particles, rigid, first, start, rows, r, s, slip, most)
    drag = old
    if length > 1.0e-12:
        step = -slip / row_weight(particles, rigid, first, start, rows, r, slip / length, at_once)
        if at_once != 0 and wp.dot(step, rows.drag_change[r]) > 0.0:
            step = step + MOMENTUM * rows.drag_change[r]
        drag = old + step
    size = wp.length(drag)
    left = length
    if size > most:
        drag = drag * (most / size)
        left = 0.0
    rows.drag[r] = drag
    rows.drag_change[r] = drag - old
    apply_row(particles, rigid, first, start, rows, r, drag - old, at_once)
    if at_once == 0:
        bound_corners(particles, first, rows.corners[r], 1)
    return left
