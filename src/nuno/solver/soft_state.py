"""What a kernel sees of a soft body: the state of its worlds, and the tetrahedra that they share."""

from typing import Any

import warp as wp

from nuno.solver.fine import fine, fine_lane
from nuno.solver.lanes import lane, lane_int, window
from nuno.solver.state import LISTINGS, LOADS, NOTES, PARTICLE_ARRAYS, PICK_REACH, PLACES

CRUMPLED, SEEN = LISTINGS, PICK_REACH
"""Notes in the place of two that only lists of pairs need: whether an element was inside out in the last substep, and
whether one is in this."""

IDLE = ("idle_x", "idle_y", "idle_z")
"""How far elements that are inside out have moved a particle in the substep without giving it speed [m]."""


def _make(name: str, number: type, integer: type, place: type) -> Any:
    """A struct under the names that `nuno.solver.state` has for the arrays that all particles have."""
    numbers = (*PARTICLE_ARRAYS, "fx", "fy", "fz", "mu", "bulk", "scalars", "notes", "box")
    numbers += IDLE
    numbers += ("grip_x", "grip_y", "grip_z", "grip_weight", "grip_ghost", "grip_load")
    fields: dict[str, Any] = {name: wp.array(dtype=number) for name in numbers}
    fields |= {name: wp.array(dtype=place) for name in PLACES}
    fields |= {"grip_corner": wp.array(dtype=integer), "group": int, "worlds": int}
    fields |= {name: wp.array(dtype=int) for name in ("near", "sharp", "sharp_mark", "sharp_list", "gone_to", "moved")}
    fields["sharp_wake"] = wp.array(dtype=float)
    return wp.struct(type(name, (), {"__annotations__": fields, "__module__": __name__}))


SoftFloat = _make("SoftFloat", float, int, float)
"""One world after the other: CUDA, and one world alone on the CPU."""

SoftLanes = _make("SoftLanes", lane, lane_int, lane)
"""Sixteen worlds in the lanes of each element: batches on the CPU."""

SoftFine, SoftFineLanes = _make("SoftFine", float, int, fine), _make("SoftFineLanes", lane, lane_int, fine_lane)
"""The same with coordinates as doubles, as `nuno.solver.state` has them."""


STAR = wp.constant(5)
"""Elements that a star has room for: see `nuno.scene.stars`."""


@wp.struct
class Tetrahedra:
    """A soft body's elements, the same in every world, in stars that are sorted by colour.

    ``inner`` and ``outer`` are a star's vertices, ``shape`` where the ``number`` of its elements begin and how many
    outer elements it has. Rest shapes are rows of `STAR` elements, two vectors of four columns of
    `nuno.solver.tetrahedron` each. ``soft`` is which of a world's moduli an element has, where they ``differ``.
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
    soft: wp.array(dtype=int)
    colour: wp.array(dtype=int)


@wp.struct
class WideTetrahedra:
    """The same by groups of sixteen stars, and room for what all particles of a world have in common."""

    rows: int
    differ: int
    speed: float
    height: float
    inner: wp.array(dtype=lane_int)
    outer: wp.array(dtype=lane_int)
    count: wp.array(dtype=int)
    number: wp.array(dtype=lane)
    soft: wp.array(dtype=lane_int)
    colour: wp.array(dtype=int)
    scalars: wp.array(dtype=lane)
    notes: wp.array(dtype=lane)


@wp.struct
class Sides:
    """A soft body's surface, under the names that `nuno.solver.state.Topology` has for a cloth's."""

    particles: int
    side: wp.array(dtype=wp.vec2i)
    face: wp.array(dtype=wp.vec3i)
    sharp_colour: wp.array(dtype=int)
    side_colours: int
    longest: float


@wp.struct
class FarSides:
    """`Sides` in kernels that go on for as long as nothing sharp is near."""

    particles: int
    side: wp.array(dtype=wp.vec2i)
    face: wp.array(dtype=wp.vec3i)
    sharp_colour: wp.array(dtype=int)
    side_colours: int
    longest: float


@wp.struct
class SoftSizes:
    """How many elements of each per-world array belong to one world."""

    soft: int
    forces: int
    keys: int
    grips: int
    near: int
    sharp: int
    sharp_list: int
    moved: int


@wp.func
def view(s: Any, group: int, n: int, size: SoftSizes):
    """The part of the state that belongs to one world, or to one group of lanes."""
    t = s
    t.group = group
    t.x = window(s.x, group * n, n)
    t.y = window(s.y, group * n, n)
    t.z = window(s.z, group * n, n)
    t.px = window(s.px, group * n, n)
    t.py = window(s.py, group * n, n)
    t.pz = window(s.pz, group * n, n)
    t.vx = window(s.vx, group * n, n)
    t.vy = window(s.vy, group * n, n)
    t.vz = window(s.vz, group * n, n)
    t.w = window(s.w, group * n, n)
    t.idle_x = window(s.idle_x, group * n, n)
    t.idle_y = window(s.idle_y, group * n, n)
    t.idle_z = window(s.idle_z, group * n, n)
    t.fx = window(s.fx, group * size.forces, size.forces)
    t.fy = window(s.fy, group * size.forces, size.forces)
    t.fz = window(s.fz, group * size.forces, size.forces)
    t.mu = window(s.mu, group * size.soft, size.soft)
    t.bulk = window(s.bulk, group * size.soft, size.soft)
    t.scalars = window(s.scalars, group * 7, 7)
    t.notes = window(s.notes, group * NOTES, NOTES)
    t.box = window(s.box, group * 6, 6)
    t.grip_x = window(s.grip_x, group * size.keys, size.keys)
    t.grip_y = window(s.grip_y, group * size.keys, size.keys)
    t.grip_z = window(s.grip_z, group * size.keys, size.keys)
    t.grip_weight = window(s.grip_weight, group * 3 * size.grips, 3 * size.grips)
    t.grip_ghost = window(s.grip_ghost, group * size.grips, size.grips)
    t.grip_load = window(s.grip_load, group * LOADS * size.grips, LOADS * size.grips)
    t.grip_corner = window(s.grip_corner, group * 3 * size.grips, 3 * size.grips)
    t.near = window(s.near, group * size.near, size.near)
    t.sharp = window(s.sharp, group * size.sharp, size.sharp)
    t.gone_to = window(s.gone_to, group, 1)
    t.sharp_mark = window(s.sharp_mark, group * n, n)
    t.sharp_list = window(s.sharp_list, group * size.sharp_list, size.sharp_list)
    t.sharp_wake = window(s.sharp_wake, group * (size.sharp_list + 2), size.sharp_list + 2)
    t.moved = window(s.moved, group * size.moved, size.moved)
    return t
