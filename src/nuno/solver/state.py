"""What a kernel sees: the state of the worlds, the cloth that they share, and the settings of a run."""

from typing import Any

import warp as wp

from nuno.solver.fine import fine, fine_lane
from nuno.solver.lanes import lane, lane_int, window

# Per-world scalars in `State.scalars`.
DRAG, FRICTION, DAMPING, THICKNESS, ORIGIN = 0, 1, 2, 3, 4
SCALARS = 7
"""The origin takes three: positions are kept relative to it, for a float's digits are scarce: at 1 m from zero
a coordinate's step is 1e-7 m, a tenth of what gravity moves a vertex in a substep."""
# Per-world figures that the solver keeps for itself in `State.notes`.
TRAVEL, SPEED, CLOCK, LISTINGS = 0, 1, 2, 3
# How far anything may have gone since the pairs that may touch were picked, and how far it may go [m].
PICKED, PICK_REACH = 4, 5
# Since they were last set to zero: the largest squared speed of any substep but the last [m2/s2], and how far anything
# of the cloth was within the thickness of what it touches while contacts were solved [m].
FASTEST, DEEPEST = 6, 7
NOTES = 8

# Counts of candidate pairs in `State.pair_count`: vertex-triangle and edge-edge ones of the present list, the most of
# each in an earlier list; and where there was no room for them, pairs of elements that a warp found to look at in two
# blocks, and pairs of near blocks.
MOST_LISTED, LEFT_OUT, MANY_BLOCKS = 2, 4, 5
COUNTS = 6

HELP = 8
"""Numbers in `State.help`: see `nuno.contact.helping`."""

LOADS = 4
"""Numbers in `State.grip_load` for each grip: what it bore in the frame's substeps [kg m], and how many these were."""

PARTICLE_ARRAYS = ("x", "y", "z", "px", "py", "pz", "vx", "vy", "vz", "w")
"""Positions, those at the substep's start, velocities and inverse masses."""

PLACES = ("x", "y", "z", "px", "py", "pz")
"""Those that may be doubles: see `nuno.solver.fine`."""

# The parts of a substep, which a run does all of, and others from outside step between.
MOTION, PULLS, LAYERS, SHAPES, VELOCITIES = 1, 2, 4, 8, 16
"""Prediction, stiff grips and elasticity; other grips; self-contact; static shapes; velocities."""
ALL_PARTS = 31


INTEGERS = ("moved", "near", "sharp", "sharp_mark", "sharp_list", "help", "help_room")
"""Whole numbers that lanes share."""


def _state_fields(number: type, integer: type, place: type) -> dict[str, Any]:
    """The fields of a State whose numbers are floats or lanes of floats, and ``place`` its coordinates."""
    numbers = (*PARTICLE_ARRAYS, "fx", "fy", "fz")
    numbers += ("stretch_soft", "shear_soft", "bend_soft", "scalars", "notes", "bounds", "box", "listed", "middle")
    numbers += ("yarn_gain", "yarn_pull", "yarn_inverse", "yarn_goal", "cell_sum", "triangle_sum")
    numbers += ("grip_x", "grip_y", "grip_z", "grip_weight", "grip_ghost", "grip_load")
    integers = (
        "grip_corner",
        "vertex_triangle",
        "edge_edge",
        "pair_count",
        "picked_triangle",
        "picked_edge",
        "picked_count",
        "touch_triangle",
        "touch_edge",
        "touch_count",
        "near_blocks",
    )
    fields = {name: wp.array(dtype=number) for name in numbers}
    fields |= {name: wp.array(dtype=integer) for name in integers}
    fields |= {name: wp.array(dtype=int) for name in INTEGERS}
    fields["sharp_wake"] = wp.array(dtype=float)
    fields |= {name: wp.array(dtype=place) for name in PLACES}
    return fields | {"group": int, "worlds": int, "helpers": int}


def _make(name: str, number: type, integer: type, place: type) -> Any:
    fields = _state_fields(number, integer, place)
    return wp.struct(type(name, (), {"__annotations__": fields, "__module__": __name__}))


StateFloat = _make("StateFloat", float, int, float)
"""One world after the other: CUDA, and one world alone on the CPU."""

StateLanes = _make("StateLanes", lane, lane_int, lane)
"""Sixteen worlds in the lanes of each element: batches on the CPU."""

StateFine, StateFineLanes = _make("StateFine", float, int, fine), _make("StateFineLanes", lane, lane_int, fine_lane)
"""The same with coordinates as doubles. Beside such a state stands the other, with their floats where a substep began:
what looks for what is near is content with these."""


@wp.struct
class Topology:
    """The cloth's elements, the same in every world."""

    particles: int
    edge: wp.array(dtype=wp.vec2i)
    edge_rest: wp.array(dtype=float)
    edge_scale: wp.array(dtype=float)
    edge_soft: wp.array(dtype=int)
    yarn: wp.array(dtype=int)
    yarn_kind: wp.array(dtype=int)
    cell: wp.array(dtype=wp.vec4i)
    cell_scale: wp.array(dtype=float)
    cell_soft: wp.array(dtype=int)
    cell_colour: wp.array(dtype=int)
    triangle: wp.array(dtype=wp.vec3i)
    triangle_u: wp.array(dtype=wp.vec3)
    triangle_v: wp.array(dtype=wp.vec3)
    triangle_area: wp.array(dtype=float)
    triangle_soft: wp.array(dtype=wp.vec3i)
    triangle_colour: wp.array(dtype=int)
    line: wp.array(dtype=wp.vec3i)
    line_scale: wp.array(dtype=float)
    line_soft: wp.array(dtype=int)
    line_colour: wp.array(dtype=int)
    twist: wp.array(dtype=wp.vec4i)
    twist_scale: wp.array(dtype=float)
    twist_soft: wp.array(dtype=int)
    twist_colour: wp.array(dtype=int)
    # six vertices, three rows of six weights and three rest vectors of three numbers each
    patch: wp.array(dtype=int)
    patch_weight: wp.array(dtype=float)
    patch_rest: wp.array(dtype=float)
    patch_curved: wp.array(dtype=float)
    patch_soft: wp.array(dtype=int)
    patch_colour: wp.array(dtype=int)
    # self-contact: elements sorted by block of neighbouring vertices
    blocks: int
    block_vertex: wp.array(dtype=int)
    block_vertex_start: wp.array(dtype=int)
    block_face: wp.array(dtype=wp.vec3i)
    block_face_start: wp.array(dtype=int)
    block_edge: wp.array(dtype=wp.vec2i)
    block_edge_start: wp.array(dtype=int)
    block_corner: wp.array(dtype=int)
    block_corner_start: wp.array(dtype=int)
    crease: wp.array(dtype=wp.vec4i)
    # contact with sharp shapes: all edges of the triangles, then the triangles, by colour; where each colour starts,
    # how many of these are edges', and how long an edge may become [m]
    side: wp.array(dtype=wp.vec2i)
    face: wp.array(dtype=wp.vec3i)
    sharp_colour: wp.array(dtype=int)
    side_colours: int
    longest: float
    region_corner: wp.array(dtype=int)
    region_start: wp.array(dtype=int)
    columns: int
    block_span: wp.array(dtype=int)
    crease_window: wp.array(dtype=int)


@wp.struct
class Sizes:
    """How many elements of each per-world array belong to one world."""

    stretch_soft: int
    shear_soft: int
    bend_soft: int
    edges: int
    goals: int
    cells: int
    triangles: int
    forces: int
    keys: int
    grips: int
    blocks: int
    vertex_triangle: int
    edge_edge: int
    listed: int
    middle: int
    moved: int
    near: int
    sharp: int
    sharp_list: int
    near_blocks: int


@wp.struct
class Settings:
    """What holds for the whole run, or while it goes by parts: ``first`` is the first substep's number.

    ``pulled`` says whether there are grips other than stiff ones on vertices; ``sweeps`` how often a substep goes
    through shear and stretch, 0 for one plain pass, over-relaxed by ``rise`` and ``onset`` (`nuno.solver.relaxation`).
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
    grip_soft: wp.array(dtype=float)


@wp.struct
class Shapes:
    """Static shapes: a row of numbers each, for all worlds (stride 0) or per world.

    What moves has a slot of poses besides (else slot -1): ``timing`` is the first frame of a launch and the substeps of
    each, ``haste`` how fast any of it moves [m/s]. A hull has its ``faces``, first and last, among ``planes``: an
    outward normal and the distance from the hull's origin [m].
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
    slot: wp.array(dtype=int)
    pose: wp.array(dtype=float)
    timing: wp.array(dtype=int)
    haste: wp.array(dtype=float)


@wp.func
def view(s: Any, group: int, n: int, size: Sizes):
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
    t.fx = window(s.fx, group * size.forces, size.forces)
    t.fy = window(s.fy, group * size.forces, size.forces)
    t.fz = window(s.fz, group * size.forces, size.forces)
    t.stretch_soft = window(s.stretch_soft, group * size.stretch_soft, size.stretch_soft)
    t.shear_soft = window(s.shear_soft, group * size.shear_soft, size.shear_soft)
    t.bend_soft = window(s.bend_soft, group * size.bend_soft, size.bend_soft)
    t.scalars = window(s.scalars, group * 7, 7)
    t.notes = window(s.notes, group * NOTES, NOTES)
    t.bounds = window(s.bounds, group * size.blocks, size.blocks)
    t.listed = window(s.listed, group * size.listed, size.listed)
    t.middle = window(s.middle, group * size.middle, size.middle)
    t.box = window(s.box, group * 6, 6)
    t.yarn_gain = window(s.yarn_gain, group * size.edges, size.edges)
    t.yarn_pull = window(s.yarn_pull, group * size.edges, size.edges)
    t.yarn_inverse = window(s.yarn_inverse, group * size.edges, size.edges)
    t.yarn_goal = window(s.yarn_goal, group * size.goals, size.goals)
    t.cell_sum = window(s.cell_sum, group * size.cells, size.cells)
    t.triangle_sum = window(s.triangle_sum, group * size.triangles, size.triangles)
    t.grip_x = window(s.grip_x, group * size.keys, size.keys)
    t.grip_y = window(s.grip_y, group * size.keys, size.keys)
    t.grip_z = window(s.grip_z, group * size.keys, size.keys)
    t.grip_weight = window(s.grip_weight, group * 3 * size.grips, 3 * size.grips)
    t.grip_ghost = window(s.grip_ghost, group * size.grips, size.grips)
    t.grip_load = window(s.grip_load, group * LOADS * size.grips, LOADS * size.grips)
    t.grip_corner = window(s.grip_corner, group * 3 * size.grips, 3 * size.grips)
    t.vertex_triangle = window(s.vertex_triangle, group * 4 * size.vertex_triangle, 4 * size.vertex_triangle)
    t.edge_edge = window(s.edge_edge, group * 4 * size.edge_edge, 4 * size.edge_edge)
    t.picked_triangle = window(s.picked_triangle, group * 4 * size.vertex_triangle, 4 * size.vertex_triangle)
    t.picked_edge = window(s.picked_edge, group * 4 * size.edge_edge, 4 * size.edge_edge)
    t.picked_count = window(s.picked_count, group * 2, 2)
    t.touch_triangle = window(s.touch_triangle, group * 4 * size.vertex_triangle, 4 * size.vertex_triangle)
    t.touch_edge = window(s.touch_edge, group * 4 * size.edge_edge, 4 * size.edge_edge)
    t.touch_count = window(s.touch_count, group * 2, 2)
    t.pair_count = window(s.pair_count, group * COUNTS, COUNTS)
    t.moved = window(s.moved, group * size.moved, size.moved)
    t.near = window(s.near, group * size.near, size.near)
    t.sharp = window(s.sharp, group * size.sharp, size.sharp)
    t.sharp_mark = window(s.sharp_mark, group * n, n)
    t.sharp_list = window(s.sharp_list, group * size.sharp_list, size.sharp_list)
    t.sharp_wake = window(s.sharp_wake, group * (size.sharp_list + 2), size.sharp_list + 2)
    t.help = window(s.help, group * HELP, HELP)
    t.near_blocks = window(s.near_blocks, group * size.near_blocks, size.near_blocks)
    return t
