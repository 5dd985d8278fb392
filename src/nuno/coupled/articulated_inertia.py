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
def seen_from(own: Inertia, arm: wp.vec3):
    """The inertia of a frame as that of another of the same body, from which ``arm`` leads to it."""
    s = wp.skew(arm)
    made = Inertia()
    made.a = own.a
    made.b = own.b - own.a * s
    made.c = own.c + s * own.b - wp.transpose(own.b) * s - s * own.a * s
    made.force = own.force
    made.torque = own.torque + wp.cross(arm, own.force)
    return made


@wp.func
def added(one: Inertia, other: Inertia):
    """The sum of two inertias of one frame."""
    made = Inertia()
    made.a = one.a + other.a
    made.b = one.b + other.b
    made.c = one.c + other.c
    made.force = one.force + other.force
    made.torque = one.torque + other.torque
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
def body_inertia(rigid: RigidState, i: int):
    """A rigid body's own inertia at its centre of mass; without mass, none."""
    made = Inertia()
    if rigid.weight[i] > 0.0:
        made.a = wp.identity(n=3, dtype=float) / rigid.weight[i]
        made.c = inverted(rigid.give[i])
    return made
