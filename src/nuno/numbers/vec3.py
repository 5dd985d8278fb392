"""Vectors of three numbers (floats, lanes or doubles) with + - * /, so that a constraint reads like its equation.

`Vec3` is one world's vector of floats, `LaneVec3` that of the sixteen worlds or elements in the lanes of vectors.
`DoubleVec3` and `DoubleLaneVec3` are places whose coordinates are doubles (`nuno.numbers.doubles`): the difference of
two of them is a vector of floats, and a place moved by such a vector is a place. `Mat3` and `LaneMat3` are matrices of
three rows. The functions of particles read and write their three arrays at once, by an index or by a vector of sixteen
(`nuno.numbers.element_access`).

Sums run from x to z, and each product is rounded by itself, as if every coordinate were written out.
"""

from typing import Any

import warp as wp

from nuno.numbers.doubles import double_lane, float64
from nuno.numbers.element_access import at, put
from nuno.numbers.lanes import add, choose, div, gather, lane, mul, relative_to, sub, to_float


@wp.struct
class Vec3:
    """Three floats."""

    x: float
    y: float
    z: float


@wp.struct
class LaneVec3:
    """Three lanes."""

    x: lane
    y: lane
    z: lane


@wp.struct
class DoubleVec3:
    """A place in doubles."""

    x: float64
    y: float64
    z: float64


@wp.struct
class DoubleLaneVec3:
    """Sixteen places in doubles."""

    x: double_lane
    y: double_lane
    z: double_lane


@wp.struct
class Mat3:
    """A matrix of three rows."""

    x: Vec3
    y: Vec3
    z: Vec3


@wp.struct
class LaneMat3:
    """A matrix of three rows of lanes."""

    x: LaneVec3
    y: LaneVec3
    z: LaneVec3


@wp.func
def vec3(x: float, y: float, z: float):
    """The vector of three numbers."""
    v = Vec3()
    v.x = x
    v.y = y
    v.z = z
    return v


@wp.func
def vec3(x: lane, y: lane, z: lane):
    v = LaneVec3()
    v.x = x
    v.y = y
    v.z = z
    return v


@wp.func
def vec3(x: float64, y: float64, z: float64):
    v = DoubleVec3()
    v.x = x
    v.y = y
    v.z = z
    return v


@wp.func
def vec3(x: double_lane, y: double_lane, z: double_lane):
    v = DoubleLaneVec3()
    v.x = x
    v.y = y
    v.z = z
    return v


@wp.func
def mat3(x: Vec3, y: Vec3, z: Vec3):
    """The matrix of three rows."""
    m = Mat3()
    m.x = x
    m.y = y
    m.z = z
    return m


@wp.func
def mat3(x: LaneVec3, y: LaneVec3, z: LaneVec3):
    m = LaneMat3()
    m.x = x
    m.y = y
    m.z = z
    return m


@wp.func
def add(a: Vec3, b: Vec3):
    return vec3(a.x + b.x, a.y + b.y, a.z + b.z)


@wp.func
def add(a: LaneVec3, b: LaneVec3):
    return vec3(a.x + b.x, a.y + b.y, a.z + b.z)


@wp.func
def add(a: DoubleVec3, b: Vec3):
    return vec3(a.x + b.x, a.y + b.y, a.z + b.z)


@wp.func
def add(a: DoubleLaneVec3, b: LaneVec3):
    return vec3(a.x + b.x, a.y + b.y, a.z + b.z)


@wp.func
def sub(a: Vec3, b: Vec3):
    return vec3(a.x - b.x, a.y - b.y, a.z - b.z)


@wp.func
def sub(a: LaneVec3, b: LaneVec3):
    return vec3(a.x - b.x, a.y - b.y, a.z - b.z)


@wp.func
def sub(a: DoubleVec3, b: Vec3):
    return vec3(a.x - b.x, a.y - b.y, a.z - b.z)


@wp.func
def sub(a: DoubleLaneVec3, b: LaneVec3):
    return vec3(a.x - b.x, a.y - b.y, a.z - b.z)


@wp.func
def sub(a: DoubleVec3, b: DoubleVec3):
    return vec3(a.x - b.x, a.y - b.y, a.z - b.z)


@wp.func
def sub(a: DoubleLaneVec3, b: DoubleLaneVec3):
    return vec3(a.x - b.x, a.y - b.y, a.z - b.z)


@wp.func
def mul(a: Vec3, s: float):
    return vec3(a.x * s, a.y * s, a.z * s)


@wp.func
def mul(a: LaneVec3, s: lane):
    return vec3(a.x * s, a.y * s, a.z * s)


@wp.func
def mul(a: LaneVec3, s: float):
    return vec3(a.x * s, a.y * s, a.z * s)


@wp.func
def mul(s: float, a: Vec3):
    return a * s


@wp.func
def mul(s: lane, a: LaneVec3):
    return a * s


@wp.func
def mul(s: float, a: LaneVec3):
    return a * s


@wp.func
def div(a: Vec3, s: float):
    return vec3(a.x / s, a.y / s, a.z / s)


@wp.func
def div(a: LaneVec3, s: lane):
    return vec3(a.x / s, a.y / s, a.z / s)


@wp.func
def dot(a: Any, b: Any):
    """The scalar product a . b."""
    return a.x * b.x + a.y * b.y + a.z * b.z


@wp.func
def cross(a: Any, b: Any):
    """The vector product a x b."""
    return vec3(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x)


@wp.func
def sub(a: Mat3, b: Mat3):
    return mat3(a.x - b.x, a.y - b.y, a.z - b.z)


@wp.func
def sub(a: LaneMat3, b: LaneMat3):
    return mat3(a.x - b.x, a.y - b.y, a.z - b.z)


@wp.func
def mul(m: Mat3, v: Vec3):
    return vec3(dot(m.x, v), dot(m.y, v), dot(m.z, v))


@wp.func
def mul(m: LaneMat3, v: LaneVec3):
    return vec3(dot(m.x, v), dot(m.y, v), dot(m.z, v))


@wp.func
def transposed_mul(m: Any, v: Any):
    """The product of a matrix, transposed, and a vector: of a rotation, its inverse's."""
    x = m.x.x * v.x + m.y.x * v.y + m.z.x * v.z
    y = m.x.y * v.x + m.y.y * v.y + m.z.y * v.z
    z = m.x.z * v.x + m.y.z * v.y + m.z.z * v.z
    return vec3(x, y, z)


@wp.func
def less_product(a: Any, m: Any, v: Any):
    """The vector a - m v, one product taken off after the other."""
    x = a.x - m.x.x * v.x - m.x.y * v.y - m.x.z * v.z
    y = a.y - m.y.x * v.x - m.y.y * v.y - m.y.z * v.z
    z = a.z - m.z.x * v.x - m.z.y * v.y - m.z.z * v.z
    return vec3(x, y, z)


@wp.func
def choose(sign: float, a: Vec3, b: Vec3):
    return vec3(choose(sign, a.x, b.x), choose(sign, a.y, b.y), choose(sign, a.z, b.z))


@wp.func
def choose(sign: lane, a: LaneVec3, b: LaneVec3):
    return vec3(choose(sign, a.x, b.x), choose(sign, a.y, b.y), choose(sign, a.z, b.z))


@wp.func
def to_float(a: Vec3):
    return a


@wp.func
def to_float(a: LaneVec3):
    return a


@wp.func
def to_float(a: DoubleVec3):
    return vec3(to_float(a.x), to_float(a.y), to_float(a.z))


@wp.func
def to_float(a: DoubleLaneVec3):
    return vec3(to_float(a.x), to_float(a.y), to_float(a.z))


@wp.func
def offset(a: Any, base: Any):
    """A place in a sum whose weights add up to zero; where it is in doubles, what it exceeds ``base`` by."""
    return vec3(relative_to(a.x, base.x), relative_to(a.y, base.y), relative_to(a.z, base.z))


@wp.func
def position(t: Any, i: Any):
    """Particle i's position."""
    return vec3(at(t.x, i), at(t.y, i), at(t.z, i))


@wp.func
def gather_position(t: Any, i: Any):
    """Particle i's position; with lanes, each lane's own particle of its own world."""
    return vec3(gather(t.x, i), gather(t.y, i), gather(t.z, i))


@wp.func
def start_position(t: Any, i: Any):
    """Particle i's position when the substep began."""
    return vec3(at(t.px, i), at(t.py, i), at(t.pz, i))


@wp.func
def velocity(t: Any, i: Any):
    """Particle i's velocity."""
    return vec3(at(t.vx, i), at(t.vy, i), at(t.vz, i))


@wp.func
def put_position(t: Any, i: Any, place: Any):
    """Write particle i's position."""
    put(t.x, i, place.x)
    put(t.y, i, place.y)
    put(t.z, i, place.z)


@wp.func
def put_start_position(t: Any, i: Any, place: Any):
    """Write particle i's position when the substep began."""
    put(t.px, i, place.x)
    put(t.py, i, place.y)
    put(t.pz, i, place.z)


@wp.func
def put_velocity(t: Any, i: Any, v: Any):
    """Write particle i's velocity."""
    put(t.vx, i, v.x)
    put(t.vy, i, v.y)
    put(t.vz, i, v.z)


@wp.func
def move(t: Any, i: Any, way: Any):
    """Move particle i by a vector."""
    put_position(t, i, position(t, i) + way)
