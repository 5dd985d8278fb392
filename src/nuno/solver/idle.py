"""Motion without speed: what elements of a soft body that are inside out move its particles by.

They right themselves without a gain of energy: velocities come to what they would be if the substep had begun where
they moved the particles from. To contact it is motion like any other: taken for the substep's start, it carried what
was crushed through edges and corners, of which then nothing told the side.
"""

from typing import Any

import warp as wp

from nuno.solver.lanes import add, anywhere, fill, mul, sub  # noqa: F401
from nuno.solver.vector import at, put


@wp.func
def move_idly(t: Any, i: Any, x: Any, y: Any, z: Any, s: Any):
    """Note that particle i is moved by s (x, y, z) without speed."""
    put(t.idle_x, i, at(t.idle_x, i) + s * x)
    put(t.idle_y, i, at(t.idle_y, i) + s * y)
    put(t.idle_z, i, at(t.idle_z, i) + s * z)


@wp.func
def motion_of(t: Any, i: Any, x: Any, y: Any, z: Any):
    """What particle i, which is now at x, y, z, has moved in the substep with speed [m]."""
    return (
        x - at(t.px, i) - at(t.idle_x, i), y - at(t.py, i) - at(t.idle_y, i), z - at(t.pz, i) - at(t.idle_z, i)
    )  # fmt: skip


@wp.func
def forget_idle(t: Any, n: int, thread: int, threads: int):
    """Let the substep have begun as much later on, before velocities are read."""
    for i in range(thread, n, threads):
        x = at(t.idle_x, i)
        y = at(t.idle_y, i)
        z = at(t.idle_z, i)
        if anywhere(x * x + y * y + z * z):
            put(t.px, i, at(t.px, i) + x)
            put(t.py, i, at(t.py, i) + y)
            put(t.pz, i, at(t.pz, i) + z)
            zero = fill(x, 0.0)
            put(t.idle_x, i, zero)
            put(t.idle_y, i, zero)
            put(t.idle_z, i, zero)
