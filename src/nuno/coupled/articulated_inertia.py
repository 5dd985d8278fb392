"""Articulated inertias at the level of positions: what a frame of a tree of joints feels, and how it answers."""

import warp as wp

from nuno.coupled.joint_response import inverted
from nuno.rigid.rigid_body import RigidState


@wp.struct
class Inertia:
    """Multipliers that shift a frame by x and turn it by t: force + a x + b t, and torque + b^T x + c t."""

    a: wp.mat33
    b: wp.mat33
    c: wp.mat33
    force: wp.vec3
    torque: wp.vec3


@wp.func
def crossed_rows(m: wp.mat33, v: wp.vec3):
    """A matrix times that which crosses v with what it is multiplied by: each of its rows crossed with v."""
    return wp.matrix_from_rows(wp.cross(m[0], v), wp.cross(m[1], v), wp.cross(m[2], v))


@wp.func
def seen_from(own: Inertia, arm: wp.vec3):
    """The inertia of a frame as that of another of the same body, from which ``arm`` leads to it."""
    made = Inertia()
    made.a = own.a
    made.b = own.b - crossed_rows(own.a, arm)
    # s b' - b^T s, with s what crosses the arm
    made.c = own.c - wp.transpose(crossed_rows(wp.transpose(made.b), arm)) - crossed_rows(wp.transpose(own.b), arm)
    made.force = own.force
    made.torque = own.torque + wp.cross(arm, own.force)
    return made


@wp.func
def rest_of(own: Inertia):
    """Return the shift and turn of a frame that nothing carries."""
    inverse = inverted(own.a)
    across = wp.transpose(own.b) * inverse
    turn = -(inverted(own.c - across * own.b) * (own.torque - across * own.force))
    shift = -(inverse * (own.force + own.b * turn))
    return shift, turn


@wp.func
def body_inertia(rigid: RigidState, i: int, arm: wp.vec3):
    """A rigid body's own inertia, at a point to which ``arm`` leads from its centre of mass; without mass, none."""
    made = Inertia()
    if rigid.weight[i] > 0.0:
        mass = 1.0 / rigid.weight[i]
        unit = wp.identity(n=3, dtype=float)
        made.a = mass * unit
        made.b = mass * wp.skew(arm)
        made.c = inverted(rigid.give[i]) + mass * (wp.dot(arm, arm) * unit - wp.outer(arm, arm))
    return made
