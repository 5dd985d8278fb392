"""The two bodies of a manifold, and how they go while its points are solved.

How they go is how far since the substep began, or how fast: the same arithmetic solves places and speeds.
"""

import warp as wp

from nuno.rigid.convex import Parts
from nuno.rigid.persistent_manifolds import Contacts, moves
from nuno.rigid.rigid_body import RigidState, rotation_between, turned


@wp.struct
class Meeting:
    """An entry's owner a and partner b, and the axes of their contact."""

    i: int  # a's place in `RigidState`
    j: int  # b's
    n: wp.vec3  # the normal, towards a
    t: wp.vec3  # two tangents
    u: wp.vec3
    wa: float  # the inverse masses in this run [1/kg]
    wb: float
    ia: wp.mat33  # the inverse inertias in this run
    ib: wp.mat33


@wp.struct
class Going:
    """The motion of a pair's bodies: how far [m], turns as `rotation_between` has them, or how fast [m/s], [rad/s]."""

    xa: wp.vec3  # the centres of mass
    xb: wp.vec3
    ta: wp.vec3  # the turns
    tb: wp.vec3
    changed: int  # 1 once anything was pushed


@wp.func
def meeting_of(s: RigidState, parts: Parts, c: Contacts, world: int, e: int):
    """The bodies of an entry."""
    m = Meeting()
    p = (e - world * c.parts * c.row) / c.row
    m.i = world * s.capacity + parts.slot[p]
    m.j = world * s.capacity + parts.slot[c.partner[e]]
    m.n = c.normal_now[e]
    m.t = c.tangent_now[e]
    m.u = wp.cross(m.n, m.t)
    wa = s.weight[m.i]
    wb = s.weight[m.j]
    m.wa = wp.abs(wa)
    m.wb = wp.abs(wb)
    m.ia = s.give[m.i]
    m.ib = s.give[m.j]
    # what is held (a negative weight) gives to what does not give either, but not to what is free
    if wa < 0.0 and wb > 0.0:
        m.wa = 0.0
        m.ia = wp.mat33(0.0)
    if wb < 0.0 and wa > 0.0:
        m.wb = 0.0
        m.ib = wp.mat33(0.0)
    return m


@wp.func
def places_of(s: RigidState, m: Meeting):
    """Return how far the bodies have gone in this substep."""
    g = Going()
    g.xa = s.position[m.i] - s.position_before[m.i]
    g.xb = s.position[m.j] - s.position_before[m.j]
    g.ta = rotation_between(s.rotation_before[m.i], s.rotation[m.i])
    g.tb = rotation_between(s.rotation_before[m.j], s.rotation[m.j])
    return g


@wp.func
def free_places_of(s: RigidState, m: Meeting):
    """Return how far the bodies would have gone in this substep without contacts."""
    g = Going()
    g.xa = s.position_free[m.i] - s.position_before[m.i]
    g.xb = s.position_free[m.j] - s.position_before[m.j]
    g.ta = rotation_between(s.rotation_before[m.i], s.rotation_free[m.i])
    g.tb = rotation_between(s.rotation_before[m.j], s.rotation_free[m.j])
    return g


@wp.func
def speeds_of(s: RigidState, m: Meeting, world: int):
    """Return how fast the bodies go."""
    g = Going()
    moves_a = moves(s, m.i, m.i - world * s.capacity)
    moves_b = moves(s, m.j, m.j - world * s.capacity)
    g.xa = moves_a * s.velocity[m.i]
    g.xb = moves_b * s.velocity[m.j]
    g.ta = moves_a * s.spin[m.i]
    g.tb = moves_b * s.spin[m.j]
    return g


@wp.func
def against(g: Going, ra: wp.vec3, rb: wp.vec3):
    """Return how a's point goes against b's, ``ra`` and ``rb`` [m] from the centres of mass."""
    return g.xa + wp.cross(g.ta, ra) - g.xb - wp.cross(g.tb, rb)


@wp.func
def ease(m: Meeting, ra: wp.vec3, rb: wp.vec3, direction: wp.vec3):
    """Return what a unit impulse along ``direction`` parts two points by [1/kg]: `inverse_mass_at` of both."""
    across = wp.dot(direction, direction)
    lever_a = wp.cross(ra, direction)
    lever_b = wp.cross(rb, direction)
    return (m.wa * across + wp.dot(lever_a, m.ia * lever_a)) + (m.wb * across + wp.dot(lever_b, m.ib * lever_b))


@wp.func
def keep_places(s: RigidState, m: Meeting, g: Going):
    """Put the bodies where they have been pushed."""
    if g.changed == 1:
        if m.wa > 0.0:
            s.position[m.i] = s.position_before[m.i] + g.xa
            s.rotation[m.i] = turned(s.rotation_before[m.i], g.ta)
        if m.wb > 0.0:
            s.position[m.j] = s.position_before[m.j] + g.xb
            s.rotation[m.j] = turned(s.rotation_before[m.j], g.tb)


@wp.func
def keep_speeds(s: RigidState, m: Meeting, g: Going):
    """Give the bodies the velocities that they were pushed to."""
    if g.changed == 1:
        if m.wa > 0.0:
            s.velocity[m.i] = g.xa
            s.spin[m.i] = g.ta
        if m.wb > 0.0:
            s.velocity[m.j] = g.xb
            s.spin[m.j] = g.tb
