"""Motion without speed: what elements of a soft body that are inside out move its particles by.

They right themselves without a gain of energy: velocities come to what they would be if the substep had begun where
they moved the particles from. To contact it is motion like any other: taken for the substep's start, it carried what
was crushed through edges and corners, of which then nothing told the side.
"""

from typing import Any

import warp as wp

from nuno.numbers.element_access import at, put
from nuno.numbers.lanes import add, anywhere, full_like, mul, sub  # noqa: F401 (the operators)
from nuno.numbers.vec3 import dot, put_start_position, start_position, vec3


@wp.func
def shift_of(t: Any, i: Any):
    """Particle i's motion without speed in the substep [m]."""
    return vec3(at(t.shift_x, i), at(t.shift_y, i), at(t.shift_z, i))


@wp.func
def put_shift(t: Any, i: Any, v: Any):
    """Write particle i's motion without speed."""
    put(t.shift_x, i, v.x)
    put(t.shift_y, i, v.y)
    put(t.shift_z, i, v.z)


@wp.func
def shift_position(t: Any, i: Any, way: Any, s: Any):
    """Note that particle i is moved by s times a vector without speed."""
    put_shift(t, i, shift_of(t, i) + s * way)


@wp.func
def motion_of(t: Any, i: Any, place: Any):
    """Particle i's motion with speed in the substep, now that it is at a place [m]."""
    return place - start_position(t, i) - shift_of(t, i)


@wp.func
def clear_shifts(t: Any, n: int, rank: int, size: int):
    """Let the substep have begun as much later on, before velocities are read."""
    for i in range(rank, n, size):
        shift = shift_of(t, i)
        if anywhere(dot(shift, shift)):
            put_start_position(t, i, start_position(t, i) + shift)
            zero = full_like(shift.x, 0.0)
            put_shift(t, i, vec3(zero, zero, zero))
