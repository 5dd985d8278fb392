"""Moving shapes: where one is after any substep, between key poses half a frame apart.

Three keys of a frame are joined by the parabola through them: at a constant acceleration the surface's speed then has
no steps, each of which would let slip what lies on it.

What stands throughout a frame is where the table of static shapes would have it, to the bit: a world whose body stands
on a path that leads elsewhere in other worlds of a batch is then what it is alone, where the body has no path.
"""

from typing import Any

import warp as wp

from nuno.numbers.lanes import add, anywhere, choose, div, full_like, mul, per_world, sqrt, sub  # noqa: F401
from nuno.numbers.vec3 import mat3, vec3
from nuno.state.cloth_state import Shapes

FRAMES = 32
"""Frames of a run, at most 30 whole ones and a shorter last one, and one that begins where it ends."""
KEY_SIZE = 7
"""Position 0-2 [m], relative to the frame's base, and quaternion 3-6 (w, x, y, z)."""
STANDING = 3 + 3 * KEY_SIZE
"""Place in a frame's numbers of 1 where the shape stands throughout it, else 0."""
FRAME_SIZE = STANDING + 1
"""Numbers of a frame: its base 0-2 [m], a whole number of 1/1024 m, then the keys at its start, middle and end, and
whether it stands. In place of the last two keys, what stands has its place and rotation as the table has them."""
ROW = 3 + KEY_SIZE
"""Place in a frame's numbers of these: position 0-2 [m], rotation (row major, shape to world) 3-11."""
SLOT_SIZE = FRAMES * FRAME_SIZE
"""Numbers of a slot in `Shapes.pose`."""


@wp.func
def frame_of(shapes: Shapes, slot: int, clock: int):
    """Return where the frame's numbers begin in which substep ``clock`` ends, and the part of it that is over."""
    span = wp.max(shapes.timing[1], 1)
    k = wp.clamp(clock / span, 0, FRAMES - 1 - shapes.timing[0])
    part = wp.min(float(clock - k * span) / float(span), 1.0)
    return slot * SLOT_SIZE + (shapes.timing[0] + k) * FRAME_SIZE, part


@wp.func
def frame_of_substep(shapes: Shapes, slot: int, substep: int):
    """Return where the numbers of the frame begin that has the substep that ends at clock ``substep``."""
    span = wp.max(shapes.timing[1], 1)
    k = wp.clamp((substep - 1) / span, 0, FRAMES - 1 - shapes.timing[0])
    return slot * SLOT_SIZE + (shapes.timing[0] + k) * FRAME_SIZE


@wp.func
def standing_number(like: Any, shapes: Shapes, frame: int, k: int, group: int, worlds: int):
    """Number k of what the table would have of a shape in a frame throughout which it stands."""
    return per_world(like, shapes.pose, group, shapes.pose_stride, worlds, frame + ROW + k)


@wp.func
def stands(like: Any, shapes: Shapes, slot: int, substep: int, group: int, worlds: int):
    """1 where a moving shape stands throughout the frame of a substep, else 0."""
    frame = frame_of_substep(shapes, slot, substep)
    return per_world(like, shapes.pose, group, shapes.pose_stride, worlds, frame + STANDING)


@wp.func
def kinematic_number(like: Any, shapes: Shapes, entry: int, part: float, group: int, worlds: int):
    """One number on the parabola through three keys, all of which it meets exactly."""
    a = per_world(like, shapes.pose, group, shapes.pose_stride, worlds, entry)
    b = per_world(like, shapes.pose, group, shapes.pose_stride, worlds, entry + KEY_SIZE)
    c = per_world(like, shapes.pose, group, shapes.pose_stride, worlds, entry + 2 * KEY_SIZE)
    rest = 1.0 - part
    return a * (rest * (1.0 - 2.0 * part)) + b * (4.0 * part * rest) + c * (part * (2.0 * part - 1.0))


@wp.func
def kinematic_position(
    like: Any, shapes: Shapes, slot: int, clock: int, substep: int, group: int, worlds: int, ox: Any, oy: Any, oz: Any
):
    """Position [m] relative to ``o``, of which base and origins lose no digits.

    It is that after ``clock`` substeps, at the start or the end of the one that ends at clock ``substep``.
    """
    base, part = frame_of(shapes, slot, clock)
    entry = base + 3
    x = per_world(like, shapes.pose, group, shapes.pose_stride, worlds, base) - ox
    y = per_world(like, shapes.pose, group, shapes.pose_stride, worlds, base + 1) - oy
    z = per_world(like, shapes.pose, group, shapes.pose_stride, worlds, base + 2) - oz
    x = x + kinematic_number(like, shapes, entry, part, group, worlds)
    y = y + kinematic_number(like, shapes, entry + 1, part, group, worlds)
    z = z + kinematic_number(like, shapes, entry + 2, part, group, worlds)
    still = stands(like, shapes, slot, substep, group, worlds)
    if anywhere(still):
        frame = frame_of_substep(shapes, slot, substep)
        x = choose(still, standing_number(like, shapes, frame, 0, group, worlds) - ox, x)
        y = choose(still, standing_number(like, shapes, frame, 1, group, worlds) - oy, y)
        z = choose(still, standing_number(like, shapes, frame, 2, group, worlds) - oz, z)
    return x, y, z


@wp.func
def kinematic_rotation(like: Any, shapes: Shapes, slot: int, clock: int, substep: int, group: int, worlds: int):
    """Rotation matrix, row major, shape to world; ``clock`` and ``substep`` as of `kinematic_position`."""
    base, part = frame_of(shapes, slot, clock)
    entry = base + 6
    w = kinematic_number(like, shapes, entry, part, group, worlds)
    x = kinematic_number(like, shapes, entry + 1, part, group, worlds)
    y = kinematic_number(like, shapes, entry + 2, part, group, worlds)
    z = kinematic_number(like, shapes, entry + 3, part, group, worlds)
    one = full_like(w, 1.0)
    scale = one / sqrt(w * w + x * x + y * y + z * z)
    w = w * scale
    x = x * scale
    y = y * scale
    z = z * scale
    r00 = one - (y * y + z * z) * 2.0
    r01 = (x * y - w * z) * 2.0
    r02 = (x * z + w * y) * 2.0
    r10 = (x * y + w * z) * 2.0
    r11 = one - (x * x + z * z) * 2.0
    r12 = (y * z - w * x) * 2.0
    r20 = (x * z - w * y) * 2.0
    r21 = (y * z + w * x) * 2.0
    r22 = one - (x * x + y * y) * 2.0
    still = stands(like, shapes, slot, substep, group, worlds)
    if anywhere(still):
        frame = frame_of_substep(shapes, slot, substep)
        r00 = choose(still, standing_number(like, shapes, frame, 3, group, worlds), r00)
        r01 = choose(still, standing_number(like, shapes, frame, 4, group, worlds), r01)
        r02 = choose(still, standing_number(like, shapes, frame, 5, group, worlds), r02)
        r10 = choose(still, standing_number(like, shapes, frame, 6, group, worlds), r10)
        r11 = choose(still, standing_number(like, shapes, frame, 7, group, worlds), r11)
        r12 = choose(still, standing_number(like, shapes, frame, 8, group, worlds), r12)
        r20 = choose(still, standing_number(like, shapes, frame, 9, group, worlds), r20)
        r21 = choose(still, standing_number(like, shapes, frame, 10, group, worlds), r21)
        r22 = choose(still, standing_number(like, shapes, frame, 11, group, worlds), r22)
    return r00, r01, r02, r10, r11, r12, r20, r21, r22


@wp.func
def kinematic_pose(
    like: Any, shapes: Shapes, slot: int, clock: int, substep: int, group: int, worlds: int, origin: Any
):
    """Position [m] relative to the origin, and rotation, shape to world: see `kinematic_position`."""
    x, y, z = kinematic_position(like, shapes, slot, clock, substep, group, worlds, origin.x, origin.y, origin.z)
    r00, r01, r02, r10, r11, r12, r20, r21, r22 = kinematic_rotation(
        like, shapes, slot, clock, substep, group, worlds
    )  # fmt: skip
    return vec3(x, y, z), mat3(vec3(r00, r01, r02), vec3(r10, r11, r12), vec3(r20, r21, r22))
