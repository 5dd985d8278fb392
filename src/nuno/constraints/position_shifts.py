"""Motion without speed: what elements of a soft body that are inside out move its particles by.

They right themselves without a gain of energy: velocities come to what they would be if the substep had begun where
they moved the particles from. To contact it is motion like any other: taken for the substep's start, it carried what
was crushed through edges and corners, of which then nothing told the side.
"""

from typing import Any

import warp as wp

from nuno.numbers.element_access import at, put
from nuno.numbers.lanes import add, anywhere, full_like, mul, sub  # noqa: F401


@wp.func
def shift_position(t: Any, i: Any, x: Any, y: Any, z: Any, s: Any):
    """Note that particle i is moved by s (x, y, z) without speed."""
    put(t.shift_x, i, at(t.shift_x, i) + s * x)
    put(t.shift_y, i, at(t.shift_y, i) + s * y)
    put(t.shift_z, i, at(t.shift_z, i) + s * z)


@wp.func
def motion_of(t: Any, i: Any, x: Any, y: Any, z: Any):
    """Return what particle i, which is now at x, y, z, has moved in the substep with speed [m]."""
    return (
        x - at(t.px, i) - at(t.shift_x, i), y - at(t.py, i) - at(t.shift_y, i), z - at(t.pz, i) - at(t.shift_z, i)
    )  # fmt: skip


@wp.func
def clear_shifts(t: Any, n: int, rank: int, size: int):
    """Let the substep have begun as much later on, before velocities are read."""
    for i in range(rank, n, size):
        x = at(t.shift_x, i)
        y = at(t.shift_y, i)
        z = at(t.shift_z, i)
        if anywhere(x * x + y * y + z * z):
            put(t.px, i, at(t.px, i) + x)
            put(t.py, i, at(t.py, i) + y)
            put(t.pz, i, at(t.pz, i) + z)
            zero = full_like(x, 0.0)
            put(t.shift_x, i, zero)
            put(t.shift_y, i, zero)
            put(t.shift_z, i, zero)
