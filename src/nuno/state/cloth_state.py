"""The state of a cloth as kernels have it: arrays of its worlds, elements that they share, settings of a run."""

from typing import Any

import warp as wp

from nuno.numbers.doubles import double_lane, float64
from nuno.numbers.lanes import lane, lane_int, subarray
from nuno.topology.cloth_topology import ELEMENT_KINDS, ElementKind

# Per-world scalars in `State.scalars`.
DRAG, FRICTION, DAMPING, THICKNESS, ORIGIN = 0, 1, 2, 3, 4
SCALARS = 7
"""The origin takes three: positions are kept relative to it, for a float's digits are scarce: at 1 m from zero
a coordinate's step is 1e-7 m, a tenth of what gravity moves a vertex in a substep."""
# Per-world figures that the solver keeps for itself in `State.notes`.
TRAVEL, SPEED, CLOCK, LISTINGS = 0, 1, 2, 3
# How far anything may have gone since the pairs that may touch were picked, and how far it may go [m].
INNER_TRAVEL, INNER_REACH = 4, 5
# Since they were last set to zero: the largest squared speed of any substep but the last [m2/s2], and how far anything
# of the cloth was within the thickness of what it touches while contacts were solved [m].
FASTEST, DEEPEST = 6, 7
NOTES = 8

# Counts of candidate pairs in `State.pair_count`: vertex-triangle and edge-edge ones of the present list, the most of
# each in an earlier list; and where there was no room for them, pairs of elements that a warp found to look at in two
# blocks, and pairs of near blocks.
MAX_NEIGHBOURS, MISSED_ELEMENTS, MISSED_LEAVES = 2, 4, 5
COUNTS = 6

WORK_COUNTS = 8
"""Numbers in `State.work_counts`: see `nuno.contact.self.search_queue`."""

LOADS = 4
"""Numbers in `State.grip_load` for each grip: what it bore in the frame's substeps [kg m], and how many these were."""

PARTICLE_ARRAYS = ("x", "y", "z", "px", "py", "pz", "vx", "vy", "vz", "w")
"""Positions, those at the substep's start, velocities and inverse masses."""

PLACES = ("x", "y", "z", "px", "py", "pz")
"""Those that may be doubles: see `nuno.numbers.doubles`."""

# The parts of a substep, which a run does all of, and others from outside step between.
MOTION, COMPLIANT_GRIPS, SELF_CONTACT, SHAPES, VELOCITIES = 1, 2, 4, 8, 16
"""Prediction, stiff grips and elasticity; other grips; self-contact; static shapes; velocities."""
ALL_PARTS = 31


INTEGERS = ("moved", "shape_list", "feature_shapes", "feature_list", "feature_asleep", "work_counts", "work_queue")
"""Whole numbers that lanes share."""


def _state_fields(number: type, integer: type, place: type) -> dict[str, Any]:
    """The fields of a State whose numbers are floats or lanes of floats, and ``place`` its coordinates."""
    numbers = (*PARTICLE_ARRAYS, "fx", "fy", "fz")
    numbers += (
        "stretch_compliance",
        "shear_compliance",
        "bend_compliance",
        "scalars",
        "notes",
        "bounds",
        "box",
        "reference",
        "middle",
        "feature_due",
    )
    numbers += ("grid_line_gain", "grid_line_pull", "grid_line_inverse", "grid_line_goal", "cell_sum", "triangle_sum")
    numbers += ("grip_x", "grip_y", "grip_z", "grip_weight", "grip_inverse_mass", "grip_load")
    integers = (
        "grip_corner",
        "vertex_triangle",
        "edge_edge",
        "pair_count",
        "inner_triangle",
        "inner_edge",
        "inner_count",
        "active_triangle",
        "active_edge",
        "active_count",
        "leaf_pairs",
        "feature_mark",
    )
    fields = {name: wp.array(dtype=number) for name in numbers}
    fields |= {name: wp.array(dtype=integer) for name in integers}
    fields |= {name: wp.array(dtype=int) for name in INTEGERS}
    fields |= {name: wp.array(dtype=place) for name in PLACES}
    return fields | {"group": int, "worlds": int, "spare_blocks": int}


def make_struct(name: str, module: str, fields: dict[str, Any]) -> Any:
    """Make a struct of kernels with these fields."""
    return wp.struct(type(name, (), {"__annotations__": fields, "__module__": module}))


def _make(name: str, number: type, integer: type, place: type) -> Any:
    return make_struct(name, __name__, _state_fields(number, integer, place))


StateFloat = _make("StateFloat", float, int, float)
"""One world after the other: CUDA, and one world alone on the CPU."""

StateLanes = _make("StateLanes", lane, lane_int, lane)
"""Sixteen worlds in the lanes of each element: batches on the CPU."""

StateDouble, StateDoubleLanes = (
    _make("StateDouble", float, int, float64),
    _make("StateDoubleLanes", lane, lane_int, double_lane),
)
"""The same with coordinates as doubles. Beside such a state stands the other, with their floats where a substep began:
what looks for what is near is content with these."""


def vertex_type(kind: ElementKind) -> Any:
    """Return the type of a table's vertices: a vector for an element, or of many corners one number after the other."""
    return {2: wp.vec2i, 3: wp.vec3i, 4: wp.vec4i}.get(kind.corners, int)


def column_type(size: int) -> Any:
    """Return the type of a column of so many numbers an element, as `vertex_type`."""
    return wp.vec3 if size == 3 else float


def compliance_type(kind: ElementKind) -> Any:
    """Return the type of the places in tables of compliances: one of an element, or three of a triangle."""
    return wp.vec3i if len(kind.stiffness) == 3 else int


def _element_fields() -> dict[str, Any]:
    edge: dict[str, Any] = {"edge": wp.vec2i, "edge_rest": float, "edge_scale": float, "edge_compliance": int}
    types = edge | {"grid_line": int, "grid_line_kind": int}
    for kind in ELEMENT_KINDS:
        types[kind.name] = vertex_type(kind)
        types |= {f"{kind.name}_{name}": column_type(size) for name, (_, size) in kind.columns.items()}
        types |= {f"{kind.name}_compliance": compliance_type(kind), f"{kind.name}_colour": int}
    return {name: wp.array(dtype=own) for name, own in types.items()}


_INTS, _PAIRS = wp.array(dtype=int), wp.array(dtype=wp.vec2i)

Topology = make_struct("Topology", __name__, {
    "particles": int,
    **_element_fields(),
    # self-contact: elements sorted by block of neighbouring vertices
    "leaves": int,
    "leaf_vertex": _INTS, "leaf_vertex_start": _INTS,
    "leaf_face": wp.array(dtype=wp.vec3i), "leaf_face_start": _INTS,
    "leaf_edge": _PAIRS, "leaf_edge_start": _INTS,
    "leaf_corner": _INTS, "leaf_corner_start": _INTS,
    "crease": wp.array(dtype=wp.vec4i),
    # contact with sharp shapes: all edges of the triangles, then the triangles, by colour; where each colour starts,
    # how many of these are edges', and how long an edge may become [m]
    "side": _PAIRS, "face": wp.array(dtype=wp.vec3i), "feature_colour": _INTS, "side_colours": int, "longest": float,
    "region_corner": _INTS, "region_start": _INTS, "columns": int, "leaf_span": _INTS, "crease_corner": _INTS,
    "crease_key": _INTS,
})  # fmt: skip
"""The cloth's elements, the same in every world: those of `nuno.topology.cloth_topology.ELEMENT_KINDS`, and edges."""


@wp.struct
class Sizes:
    """Elements of each per-world array that belong to one world."""

    stretch_compliance: int
    shear_compliance: int
    bend_compliance: int
    edges: int
    goals: int
    cells: int
    triangles: int
    forces: int
    keys: int
    grips: int
    bounds: int
    vertex_triangle: int
    edge_edge: int
    reference: int
    middle: int
    moved: int
    shape_list: int
    feature_shapes: int
    feature_list: int
    leaf_pairs: int


@wp.struct
class Settings:
    """Settings of a whole run, or while it goes by parts: ``first`` is the first substep's number.

    ``pulled`` says whether there are grips other than stiff ones on vertices; ``sweeps`` how often a substep goes
    through shear and stretch, 0 for one plain pass, over-relaxed by ``rise`` and ``onset``
    (`nuno.constraints.relaxation`).
    """

    dt: float
    gravity: wp.vec3
    pushed: int
    damped: int
    sweeps: int
    rise: float
    onset: float
    touching: int
    margin: float
    reach: float
    cell: float
    frame: int
    first: int
    parts: int
    passes: int  # over contacts of a cloth with itself
    grips: int
    pulled: int
    keys: int
    # of the world's clock: keys, and where the run starts; of a step [s]. A float has too few digits for them
    grip_time: wp.array(dtype=wp.float64)
    grip_start: wp.array(dtype=wp.float64)
    step: wp.float64
    grip_ease: wp.array(dtype=int)
    grip_fixed: wp.array(dtype=int)
    grip_compliance: wp.array(dtype=float)


@wp.struct
class Shapes:
    """Static shapes: a row of numbers each, for all worlds (stride 0) or per world.

    What moves has a slot of poses besides (else slot -1): ``timing`` is the first frame of a launch and the substeps of
    each, ``shape_speed`` how fast any of it moves [m/s], per world where ``pose_stride`` is not 0. A hull has its
    ``faces``, first and last, among ``planes``: an outward normal and the distance from the hull's origin [m]; and so
    its ``corner_ends`` among ``corners``: places, and the cells from which on each is sharp [m], the least first. Its
    ``hull_grid`` has a first cell and the cells along x, y and z (0: none), ``hull_low`` the grid's corner and cells a
    metre; cell c has, of the hull's planes, those of ``cell_planes`` from ``cell_ends[c]`` to the next.
    """

    count: int
    stride: int
    mesh_stride: int
    pose_stride: int
    kind: wp.array(dtype=int)
    table: wp.array(dtype=float)
    mesh: wp.array(dtype=wp.uint64)
    faces: wp.array(dtype=wp.vec2i)
    planes: wp.array(dtype=wp.vec4)
    corner_ends: wp.array(dtype=wp.vec2i)
    corners: wp.array(dtype=wp.vec4)
    hull_grid: wp.array(dtype=wp.vec4i)
    hull_low: wp.array(dtype=wp.vec4)
    cell_ends: wp.array(dtype=int)
    cell_planes: wp.array(dtype=int)
    slot: wp.array(dtype=int)
    pose: wp.array(dtype=float)
    timing: wp.array(dtype=int)
    shape_speed: wp.array(dtype=float)


@wp.func
def view(s: Any, group: int, n: int, sizes: Sizes):
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
    t.fx = subarray(s.fx, group * sizes.forces, sizes.forces)
    t.fy = subarray(s.fy, group * sizes.forces, sizes.forces)
    t.fz = subarray(s.fz, group * sizes.forces, sizes.forces)
    t.stretch_compliance = subarray(s.stretch_compliance, group * sizes.stretch_compliance, sizes.stretch_compliance)
    t.shear_compliance = subarray(s.shear_compliance, group * sizes.shear_compliance, sizes.shear_compliance)
    t.bend_compliance = subarray(s.bend_compliance, group * sizes.bend_compliance, sizes.bend_compliance)
    t.scalars = subarray(s.scalars, group * 7, 7)
    t.notes = subarray(s.notes, group * NOTES, NOTES)
    t.bounds = subarray(s.bounds, group * sizes.bounds, sizes.bounds)
    t.reference = subarray(s.reference, group * sizes.reference, sizes.reference)
    t.middle = subarray(s.middle, group * sizes.middle, sizes.middle)
    t.box = subarray(s.box, group * 6, 6)
    t.grid_line_gain = subarray(s.grid_line_gain, group * sizes.edges, sizes.edges)
    t.grid_line_pull = subarray(s.grid_line_pull, group * sizes.edges, sizes.edges)
    t.grid_line_inverse = subarray(s.grid_line_inverse, group * sizes.edges, sizes.edges)
    t.grid_line_goal = subarray(s.grid_line_goal, group * sizes.goals, sizes.goals)
    t.cell_sum = subarray(s.cell_sum, group * sizes.cells, sizes.cells)
    t.triangle_sum = subarray(s.triangle_sum, group * sizes.triangles, sizes.triangles)
    t.grip_x = subarray(s.grip_x, group * sizes.keys, sizes.keys)
    t.grip_y = subarray(s.grip_y, group * sizes.keys, sizes.keys)
    t.grip_z = subarray(s.grip_z, group * sizes.keys, sizes.keys)
    t.grip_weight = subarray(s.grip_weight, group * 3 * sizes.grips, 3 * sizes.grips)
    t.grip_inverse_mass = subarray(s.grip_inverse_mass, group * sizes.grips, sizes.grips)
    t.grip_load = subarray(s.grip_load, group * LOADS * sizes.grips, LOADS * sizes.grips)
    t.grip_corner = subarray(s.grip_corner, group * 3 * sizes.grips, 3 * sizes.grips)
    t.vertex_triangle = subarray(s.vertex_triangle, group * 4 * sizes.vertex_triangle, 4 * sizes.vertex_triangle)
    t.edge_edge = subarray(s.edge_edge, group * 4 * sizes.edge_edge, 4 * sizes.edge_edge)
    t.inner_triangle = subarray(s.inner_triangle, group * 4 * sizes.vertex_triangle, 4 * sizes.vertex_triangle)
    t.inner_edge = subarray(s.inner_edge, group * 4 * sizes.edge_edge, 4 * sizes.edge_edge)
    t.inner_count = subarray(s.inner_count, group * 2, 2)
    t.active_triangle = subarray(s.active_triangle, group * 4 * sizes.vertex_triangle, 4 * sizes.vertex_triangle)
    t.active_edge = subarray(s.active_edge, group * 4 * sizes.edge_edge, 4 * sizes.edge_edge)
    t.active_count = subarray(s.active_count, group * 2, 2)
    t.pair_count = subarray(s.pair_count, group * COUNTS, COUNTS)
    t.moved = subarray(s.moved, group * sizes.moved, sizes.moved)
    t.shape_list = subarray(s.shape_list, group * sizes.shape_list, sizes.shape_list)
    t.feature_shapes = subarray(s.feature_shapes, group * sizes.feature_shapes, sizes.feature_shapes)
    t.feature_mark = subarray(s.feature_mark, group * n, n)
    t.feature_list = subarray(s.feature_list, group * sizes.feature_list, sizes.feature_list)
    t.feature_asleep = subarray(s.feature_asleep, group * sizes.feature_list, sizes.feature_list)
    t.feature_due = subarray(s.feature_due, group * (sizes.feature_list + 2), sizes.feature_list + 2)
    t.work_counts = subarray(s.work_counts, group * WORK_COUNTS, WORK_COUNTS)
    t.leaf_pairs = subarray(s.leaf_pairs, group * sizes.leaf_pairs, sizes.leaf_pairs)
    return t
