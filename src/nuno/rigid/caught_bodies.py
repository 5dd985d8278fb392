"""Bodies that are caught: pressed from opposite sides by what cannot go, as a hand between two walls.

What presses a caught body may be of any size, if only both sides press alike. No motion tells them to press less, and
what a substep leaves undone adds to it, 1 to 3 % each time. Where one side then gives way, the body is thrown.
"""

import warp as wp

from nuno.rigid.pair_motion import Meeting
from nuno.rigid.rigid_body import RigidState

CAUGHT = wp.constant(2.0e-4)
"""[m] Overlap of a caught body from which on joints are closed after it was parted, and its forces fade."""
FADED = wp.constant(0.9)
"""Share of a force that such an overlap begins the next substep with."""
OPPOSED = wp.constant(-0.5)
"""Cosine of 120 degrees, from which on normals oppose each other: those of a corner, or of what lies around, do not."""


@wp.func
def are_opposed(a: wp.vec3, b: wp.vec3):
    """Return True if two normals, or sums of them, oppose each other."""
    return wp.dot(a, b) < OPPOSED * wp.length(a) * wp.length(b)


@wp.func
def add_normal(s: RigidState, i: int, n: wp.vec3):
    """Add a normal to those along which what cannot go touches a body."""
    before = s.pressed[i]
    if are_opposed(before, n):
        s.caught[i] = 1
    s.pressed[i] = before + n


@wp.func
def note_pressed(s: RigidState, m: Meeting):
    """Note which of two bodies that touch is pressed by the other, which cannot go."""
    if m.wa > 0.0 and m.wb == 0.0:
        add_normal(s, m.i, m.n)
    if m.wb > 0.0 and m.wa == 0.0:
        add_normal(s, m.j, -m.n)


@wp.func
def is_caught(s: RigidState, m: Meeting):
    """Return True if one of two bodies is caught, the other one of those between which it is, and joined to others.

    A free body finds its place between two walls by itself.
    """
    a = s.caught[m.i] != 0 and s.joined[m.i] != 0 and m.wb == 0.0
    b = s.caught[m.j] != 0 and s.joined[m.j] != 0 and m.wa == 0.0
    return a or b
