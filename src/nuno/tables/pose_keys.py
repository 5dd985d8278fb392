"""Key poses of kinematic bodies, on paths of their own or on one path batch, written into the contacts' table.

What a kernel does here with some thousand links of robots takes NumPy longer than a small cloth's whole frame.
"""

import warp as wp

from nuno.contact.particle.kinematic_pose import FRAME_SIZE, KEY_SIZE, ROW, SLOT_SIZE, STANDING

BASES = wp.constant(wp.float64(1024.0))
"""Bases of frames are whole parts of a metre by this."""
SMALL = wp.constant(wp.float64(1.0e-6))
"""[rad] Half an angle below which turns are interpolated number by number."""
NEAR = wp.constant(wp.float64(0.98))
"""Cosine of half an angle, 23 degrees."""
HALFWAY = wp.constant(wp.float64(1.0e-6))
"""Part of a way by which it is not halfway: turns are then wrong by 1e-9 rad at most."""


@wp.func
def angle_between(a: wp.vec4d, b: wp.vec4d):
    """The angle between two turns with a . b >= 0 [rad], of near ones up to 1 % too large."""
    x = wp.float64(0.25) * wp.dot(a - b, a - b)
    if x < wp.float64(0.01):
        # 4 asin(c / 2) of the chord c
        return wp.float64(4.0) * wp.sqrt(x / (wp.float64(1.0) - x))
    return wp.float64(2.0) * wp.acos(wp.min(wp.dot(a, b), wp.float64(1.0)))


@wp.func
def turn_between(a: wp.vec4d, b: wp.vec4d, part: wp.float64):
    """The short way from a to b, as `nuno.shapes.quaternion.slerp`."""
    zero = wp.float64(0.0)
    one = wp.float64(1.0)
    if part == zero or a == b:
        return a
    if part == one:
        return b
    d = wp.dot(a, b)
    if d < zero:
        b = -b
    first = one - part
    second = part
    # halfway between turns that are near to each other numbers go as angles do
    if wp.abs(d) < NEAR or wp.abs(part - wp.float64(0.5)) > HALFWAY:
        angle = wp.acos(wp.min(wp.abs(d), one))
        if angle >= SMALL:
            first = wp.sin((one - part) * angle) / wp.sin(angle)
            second = wp.sin(part * angle) / wp.sin(angle)
    found = a * first + b * second
    return found / wp.sqrt(wp.dot(found, found))


@wp.func
def turned(q: wp.vec4d, p: wp.vec3d):
    """A vector turned by a quaternion (w, x, y, z)."""
    u = wp.vec3d(q[1], q[2], q[3])
    t = wp.cross(u, p) * wp.float64(2.0)
    return p + t * q[0] + wp.cross(u, t)


@wp.func
def write_base(pose: wp.array(dtype=float), frame: int, place: wp.vec3d):
    """The base of a frame that begins at a place."""
    for c in range(3):
        pose[frame + c] = float(wp.rint(place[c] * BASES) / BASES)


@wp.func
def write_key(pose: wp.array(dtype=float), frame: int, key: int, place: wp.vec3d, turn: wp.vec4d):
    """The start, middle or end of a frame whose base is written."""
    at = frame + 3 + key * KEY_SIZE
    for c in range(3):
        pose[at + c] = float(place[c] - wp.float64(pose[frame + c]))
    for c in range(4):
        pose[at + 3 + c] = float(turn[c])


@wp.func_native("""
#if defined(__CUDA_ARCH__)
return __dmul_rn(a, b);
#else
return a * b;
#endif
""")
def rounded_product(a: wp.float64, b: wp.float64) -> wp.float64:
    """The product, rounded by itself as NumPy's: as a part of a fused sum, products that cancel out would not."""
    ...


@wp.func
def write_row(pose: wp.array(dtype=float), frame: int, place: wp.vec3d, turn: wp.vec4d):
    """The place and rotation of what stands throughout a frame, as the table of static shapes has them."""
    one = wp.float64(1.0)
    two = wp.float64(2.0)
    w = turn[0]
    x = turn[1]
    y = turn[2]
    z = turn[3]
    xx = rounded_product(x, x)
    yy = rounded_product(y, y)
    zz = rounded_product(z, z)
    xy = rounded_product(x, y)
    xz = rounded_product(x, z)
    yz = rounded_product(y, z)
    wx = rounded_product(w, x)
    wy = rounded_product(w, y)
    wz = rounded_product(w, z)
    at = frame + ROW
    for c in range(3):
        pose[at + c] = float(place[c])
    pose[at + 3] = float(one - two * (yy + zz))
    pose[at + 4] = float(two * (xy - wz))
    pose[at + 5] = float(two * (xz + wy))
    pose[at + 6] = float(two * (xy + wz))
    pose[at + 7] = float(one - two * (xx + zz))
    pose[at + 8] = float(two * (yz - wx))
    pose[at + 9] = float(two * (xz - wy))
    pose[at + 10] = float(two * (yz + wx))
    pose[at + 11] = float(one - two * (xx + yy))


@wp.func
def write_standing(pose: wp.array(dtype=float), frame: int, moved: wp.float64, place: wp.vec3d, turn: wp.vec4d):
    """A frame in which a body ``moved`` so much: it stands where that is nothing, and then the row says where."""
    pose[frame + STANDING] = wp.where(moved > wp.float64(0.0), 0.0, 1.0)
    if moved == wp.float64(0.0):
        write_row(pose, frame, place, turn)


@wp.kernel(enable_backward=False)
def write_pose_keys(
    positions: wp.array3d(dtype=wp.vec3d),
    quaternions: wp.array3d(dtype=wp.vec4d),
    between: wp.array3d(dtype=wp.float64),
    rows: wp.array2d(dtype=int),
    centres: wp.array2d(dtype=wp.vec3d),
    radii: wp.array(dtype=wp.float64),
    stride: int,
    pose: wp.array(dtype=float),
    shape_speed: wp.array(dtype=float),
):
    """A thread for each world and body: its poses at the start, middle and end of each frame of a run.

    Args:
        positions: (n, worlds or 1, keys) [m] of the path batch.
        quaternions: (n, worlds or 1, keys) likewise.
        between: (frames, 3, 4), for the three instants of a frame the keys before and after, the part between them, and
            the time [s].
        rows: (bodies, 2), slots in the table, and rows of the path batch.
        centres: (worlds or 1, slots) [m], where shapes have their middle in their bodies' frames.
        radii: (slots,) [m], within which shapes are about their middle.
        stride: Numbers of a world in the table.
        pose: The table.
        shape_speed: (worlds,), the fastest that a point of any of them moves [m/s], where that is faster than it says.
    """
    w, k = wp.tid()
    slot = rows[k, 0]
    row = rows[k, 1]
    own = wp.min(w, positions.shape[1] - 1)
    centre = centres[wp.min(w, centres.shape[0] - 1), slot]
    frame = w * stride + slot * SLOT_SIZE
    place = wp.vec3d()
    turn = wp.vec4d()
    fastest = wp.float64(0.0)
    moved = wp.float64(0.0)
    for f in range(between.shape[0]):
        for i in range(3):
            before = place
            turn_before = turn
            first = int(between[f, i, 0])
            last = int(between[f, i, 1])
            part = between[f, i, 2]
            a = positions[row, own, first]
            turn = turn_between(quaternions[row, own, first], quaternions[row, own, last], part)
            place = a + (positions[row, own, last] - a) * part + turned(turn, centre)
            if i == 0:
                moved = wp.float64(0.0)
                write_base(pose, frame, place)
            else:
                # the short way round between neighbours, which the contacts' kernels blend number by number
                if wp.dot(turn, turn_before) < wp.float64(0.0):
                    turn = -turn
                moved += wp.length_sq(place - before) + wp.length_sq(turn - turn_before)
                way = wp.length(place - before) + angle_between(turn, turn_before) * radii[slot]
                fastest = wp.max(fastest, way / (between[f, i, 3] - between[f, i - 1, 3]))
            write_key(pose, frame, i, place, turn)
        write_standing(pose, frame, moved, place, turn)
        frame += FRAME_SIZE
    # the frame that begins at the end stands still, where the last one stands: what moves ends where its keys say
    write_base(pose, frame, place)
    for i in range(3):
        write_key(pose, frame, i, place, turn)
    write_standing(pose, frame, moved, place, turn)
    wp.atomic_max(shape_speed, w, float(fastest))
