"""The state of a soft body as kernels have it: the arrays of its worlds, and the tetrahedra that they share."""

from typing import Any

import warp as wp

from nuno.numbers.doubles import double_lane, float64
from nuno.numbers.lanes import lane, lane_int, subarray
from nuno.state.cloth_state import INNER_REACH, LISTINGS, LOADS, NOTES, PARTICLE_ARRAYS, PLACES, make_struct

INVERTED, SEEN = LISTINGS, INNER_REACH
"""Notes in the place of two that only lists of pairs need: whether an element was inside out in the last substep, and
whether one is in this."""

SHIFTS = ("shift_x", "shift_y", "shift_z")
"""Shifts of a particle in the substep by elements that are inside out, which give it no speed [m]."""


def _make(name: str, number: type, integer: type, place: type) -> Any:
    """A struct under the names that `nuno.state.cloth_state` has for the arrays that all particles have."""
    numbers = (*PARTICLE_ARRAYS, "fx", "fy", "fz", "mu", "bulk", "scalars", "notes", "box", "feature_due")
    numbers += SHIFTS
    numbers += ("grip_x", "grip_y", "grip_z", "grip_weight", "grip_inverse_mass", "grip_load")
    fields: dict[str, Any] = {name: wp.array(dtype=number) for name in numbers}
    fields |= {name: wp.array(dtype=place) for name in PLACES}
    fields |= {name: wp.array(dtype=integer) for name in ("grip_corner", "feature_mark")}
    fields |= {"group": int, "worlds": int}
    fields |= {
        name: wp.array(dtype=int)
        for name in ("shape_list", "feature_shapes", "feature_list", "feature_asleep", "reached", "moved")
    }
    return make_struct(name, __name__, fields)


SoftFloat = _make("SoftFloat", float, int, float)
"""One world after the other: CUDA, and one world alone on the CPU."""

SoftLanes = _make("SoftLanes", lane, lane_int, lane)
"""Sixteen worlds in the lanes of each element: batches on the CPU."""

SoftDouble, SoftDoubleLanes = (
    _make("SoftDouble", float, int, float64),
    _make("SoftDoubleLanes", lane, lane_int, double_lane),
)
"""The same with coordinates as doubles, as `nuno.state.cloth_state` has them."""


CLUSTER = wp.constant(5)
"""Elements that a cluster has room for: see `nuno.topology.element_clusters`."""


@wp.struct
class Tetrahedra:
    """A soft body's elements, the same in every world, in clusters that are sorted by colour.

    ``inner`` and ``outer`` are a cluster's vertices, ``shape`` where the ``number`` of its elements begin and how many
    outer elements it has. Rest shapes are rows of `CLUSTER` elements, two vectors of four columns of
    `nuno.constraints.tetrahedron` each. ``modulus`` is which of a world's moduli an element has, where they ``differ``.
    """

    particles: int
    rows: int
    differ: int
    speed: float
    height: float
    inner: wp.array(dtype=wp.vec4i)
    outer: wp.array(dtype=wp.vec4i)
    shape: wp.array(dtype=wp.vec2i)
    number: wp.array(dtype=wp.vec4)
    modulus: wp.array(dtype=int)
    colour: wp.array(dtype=int)


@wp.struct
class SimdClusters:
    """The same by groups of sixteen clusters, and room for what all particles of a world have in common."""

    particles: int
    rows: int
    differ: int
    speed: float
    height: float
    inner: wp.array(dtype=lane_int)
    outer: wp.array(dtype=lane_int)
    count: wp.array(dtype=int)
    number: wp.array(dtype=lane)
    modulus: wp.array(dtype=lane_int)
    colour: wp.array(dtype=int)
    scalars: wp.array(dtype=lane)
    notes: wp.array(dtype=lane)


_SIDES = {
    "particles": int, "side": wp.array(dtype=wp.vec2i), "face": wp.array(dtype=wp.vec3i),
    "feature_colour": wp.array(dtype=int), "side_colours": int, "longest": float,
}  # fmt: skip
Sides = make_struct("Sides", __name__, _SIDES)
"""A soft body's surface, under the names that `nuno.state.cloth_state.Topology` has for a cloth's."""
FarSides = make_struct("FarSides", __name__, _SIDES)
"""`Sides` in kernels that go on for as long as nothing sharp is near."""


@wp.struct
class SoftSizes:
    """Elements of each per-world array that belong to one world."""

    modulus: int
    forces: int
    keys: int
    grips: int
    shape_list: int
    feature_shapes: int
    feature_list: int
    moved: int


@wp.func
def view(s: Any, group: int, n: int, sizes: SoftSizes):
    """The part of the state that belongs to one world, or to one group of lanes."""
    t = s
    t.group = group
    t.x = subarray(s.x, group * n, n)
    t.y = subarray(s.y, group * n, n)
    t.z = subarray(s.z, group * n, n)
    t.px = subarray(s.px, group * n, n)
    t.py = subarray(s.py, group * n, n)
    t.pz = subarray(s.pz, group * n, n)
    t.vx = subarray(s.vx, group * n, n)
    t.vy = subarray(s.vy, group * n, n)
    t.vz = subarray(s.vz, group * n, n)
    t.w = subarray(s.w, group * n, n)
    t.shift_x = subarray(s.shift_x, group * n, n)
    t.shift_y = subarray(s.shift_y, group * n, n)
    t.shift_z = subarray(s.shift_z, group * n, n)
    t.fx = subarray(s.fx, group * sizes.forces, sizes.forces)
    t.fy = subarray(s.fy, group * sizes.forces, sizes.forces)
    t.fz = subarray(s.fz, group * sizes.forces, sizes.forces)
    t.mu = subarray(s.mu, group * sizes.modulus, sizes.modulus)
    t.bulk = subarray(s.bulk, group * sizes.modulus, sizes.modulus)
    t.scalars = subarray(s.scalars, group * 7, 7)
    t.notes = subarray(s.notes, group * NOTES, NOTES)
    t.box = subarray(s.box, group * 6, 6)
    t.grip_x = subarray(s.grip_x, group * sizes.keys, sizes.keys)
    t.grip_y = subarray(s.grip_y, group * sizes.keys, sizes.keys)
    t.grip_z = subarray(s.grip_z, group * sizes.keys, sizes.keys)
    t.grip_weight = subarray(s.grip_weight, group * 3 * sizes.grips, 3 * sizes.grips)
    t.grip_inverse_mass = subarray(s.grip_inverse_mass, group * sizes.grips, sizes.grips)
    t.grip_load = subarray(s.grip_load, group * LOADS * sizes.grips, LOADS * sizes.grips)
    t.grip_corner = subarray(s.grip_corner, group * 3 * sizes.grips, 3 * sizes.grips)
    t.shape_list = subarray(s.shape_list, group * sizes.shape_list, sizes.shape_list)
    t.feature_shapes = subarray(s.feature_shapes, group * sizes.feature_shapes, sizes.feature_shapes)
    t.reached = subarray(s.reached, group, 1)
    t.feature_mark = subarray(s.feature_mark, group * n, n)
    t.feature_list = subarray(s.feature_list, group * sizes.feature_list, sizes.feature_list)
    t.feature_asleep = subarray(s.feature_asleep, group * sizes.feature_list, sizes.feature_list)
    t.feature_due = subarray(s.feature_due, group * (sizes.feature_list + 2), sizes.feature_list + 2)
    t.moved = subarray(s.moved, group * sizes.moved, sizes.moved)
    return t
