"""The elastic constraints by the blocks of a device, in the stages of `nuno.topology.barrier_stages`.

A block has its share of each step. Its threads read what tables have of their next element while they work on one, also
across waits, as in `nuno.plans.cloth_prefetch`.
"""

from itertools import pairwise
from typing import Any

import numpy as np
import warp as wp

from nuno.constraints.bending import bend_alpha, bend_line, bend_twist
from nuno.constraints.compliances import Compliances
from nuno.constraints.grips import hold_vertices
from nuno.constraints.membrane import shear_alpha, shear_cell
from nuno.constraints.sweeps import note_lengths, shear_cells, strain_triangles
from nuno.contact.self.group_search import Lists
from nuno.numbers.block_group import BlockGroup, grid_barrier
from nuno.numbers.crew import barrier
from nuno.numbers.lanes import subarray
from nuno.plans.cloth_elastic import solve_plain
from nuno.plans.grid_lines_by_block import stretch_grid_lines_of_block
from nuno.state.cloth_state import Settings, Topology
from nuno.state.integrate import predict
from nuno.topology.barrier_stages import Colour, Stages, make_stages
from nuno.topology.cloth_topology import PLAIN_KINDS, ClothTopology, Elements
from nuno.topology.grid_lines import find_grid_lines

PARTICLES, TWISTS, LINES, CELLS, SWEPT_CELLS, TRIANGLES, GRID_LINES, PLAIN = range(8)
"""Kinds of elements; particles are predicted first, then come plain kinds, one number each from `PLAIN` on, then the
others in this order. Those in the cloth's plane may be swept several times."""
KINDS = PLAIN + len(PLAIN_KINDS)
"""A step's kind is one of these, plus so many times the number of its sweep."""
SORTED = (TWISTS, LINES, CELLS)
"""Kinds whose elements are copied into a table in the order of the blocks' shares."""


@wp.struct
class Work:
    """The steps of all blocks, and a table of the elements that are sorted by block."""

    steps: int
    step: wp.array(dtype=int)  # four numbers each, of block after block: kind, whether a stage ends, first, last
    corner: wp.array(dtype=wp.vec4i)
    scale: wp.array(dtype=float)
    compliance: wp.array(dtype=float)  # of every world: what ``scale`` is multiplied with


def divide(topology: ClothTopology, blocks: int, sweeps: int = 0) -> Stages:
    """The stages of a cloth for so many blocks and sweeps (0 for one plain pass), made once."""
    key = f"stages of {blocks} blocks and {sweeps} sweeps"
    found: Stages | None = topology.device_arrays.get(key)
    if found is not None:
        return found
    n = topology.vertex_count
    colours = [Colour(PARTICLES, 0, n, np.arange(n), np.arange(n))]

    def add(kind: int, elements: Elements) -> None:
        for first, last in pairwise(elements.offsets):
            if last > first:
                vertices = elements.vertices[first:last]
                owner = np.repeat(np.arange(last - first), vertices.shape[1])
                colours.append(Colour(kind, int(first), int(last - first), owner, vertices.ravel()))

    for k, plain in enumerate(PLAIN_KINDS):
        add(PLAIN + k, getattr(topology, plain.elements))
    add(TWISTS, topology.twists)
    add(LINES, topology.lines)
    order, starts, kinds = find_grid_lines(topology.edges)
    ends = topology.edges.vertices[order]
    for sweep in range(max(1, sweeps)):
        add(SWEPT_CELLS + KINDS * sweep if sweeps else CELLS, topology.cells)
        add(TRIANGLES + KINDS * sweep, topology.triangles)
        for first, last in pairwise(kinds):
            if last > first:
                owner = np.repeat(np.arange(last - first), 2 * np.diff(starts[first : last + 1]))
                vertices = ends[starts[first] : starts[last]].ravel()
                colours.append(Colour(GRID_LINES + KINDS * sweep, int(first), int(last - first), owner, vertices))
    made = topology.device_arrays[key] = make_stages(colours, n, blocks, SORTED)
    return made


def make_work(topology: ClothTopology, compliances: Compliances, stages: Stages, device: str) -> Any:
    """A cloth's `Work` on a device."""
    quarter = topology.cells.extra["quarter"] if len(topology.cells) else topology.cells.scale
    columns = {
        TWISTS: (topology.twists.vertices, topology.twists.scale, compliances.place["twist"], compliances.bend),
        LINES: (topology.lines.vertices, topology.lines.scale, compliances.place["line"], compliances.bend),
        CELLS: (topology.cells.vertices, quarter, compliances.place["cell"], compliances.shear),
    }
    count = len(stages.row)
    corner, scale = np.zeros((count, 4), dtype=np.int32), np.zeros(count, dtype=np.float32)
    compliance = np.zeros((len(compliances.bend), count))
    for kind, (vertices, factor, which, table) in columns.items():
        own = np.nonzero(stages.row[:, 0] == kind)[0]
        element = stages.row[own, 1]
        corner[own, : vertices.shape[1]] = vertices[element]
        scale[own], compliance[:, own] = factor[element], table[:, which[element]]
    work: Any = Work()
    work.steps = len(stages.kind)
    common = np.broadcast_to(np.stack([stages.kind, stages.ends], axis=-1), stages.share.shape)
    work.step = wp.array(np.concatenate([common, stages.share], axis=-1).ravel(), dtype=int, device=device)
    work.corner = wp.array(corner, dtype=wp.vec4i, device=device)
    work.scale = wp.array(scale, dtype=float, device=device)
    work.compliance = wp.array(compliance.ravel(), dtype=float, device=device)
    return work


@wp.struct
class BlockShare:
    """A cloth's elements shared out among the blocks of a group, as one block has them, and its own particles."""

    particles: int
    work: Work
    steps: wp.array(dtype=int)
    lists: Lists
    world: int
    # particles whose contacts and velocities are the block's; how many grips there are, none where none is on these
    first: int
    last: int
    held: int
    # the same of the particles that the block predicts
    held_first: int


@wp.func
def is_sorted(kind: int):
    """Return True if the table has this kind's elements."""
    return kind == TWISTS or kind == LINES or kind == CELLS


@wp.struct
class Element:
    """An element as the table has it."""

    a: int
    b: int
    c: int
    d: int
    scale: float
    compliance: float


@wp.func
def read(work: Work, world: int, kind: int, k: int, last: int):
    """Element k of the table, or an empty one from ``last`` on."""
    element = Element()
    if is_sorted(kind) and k < last:
        q = work.corner[k]
        element.a = q[0]
        element.b = q[1]
        element.c = q[2]
        element.d = q[3]
        element.scale = work.scale[k]
        element.compliance = work.compliance[world * work.scale.shape[0] + k]
    return element


@wp.func
def solve(t: Any, kind: int, e: Element, rate: float):
    """One bend or shear, as in `nuno.plans.cloth_elastic`."""
    if kind == TWISTS:
        bend_twist(t, e.a, e.b, e.c, e.d, bend_alpha(e.compliance, e.scale, rate))
    elif kind == LINES:
        bend_line(t, e.a, e.b, e.c, bend_alpha(e.compliance, e.scale, rate))
    else:
        shear_cell(t, e.a, e.b, e.c, e.d, e.scale, shear_alpha(e.compliance, e.scale, rate), 0.0, 0.0, 0.0)


@wp.func
def grips_on(t: Any, run: Settings, first: int, last: int):
    """The number of grips, or none where no vertex from first to last is held by one."""
    held = int(0)
    for g in range(run.grips):
        i = t.grip_corner[3 * g]
        if i >= first and i < last:
            held = run.grips
    return held


@wp.func
def set_out(t: Any, run: Settings, grips: int, first: int, last: int, rank: int, size: int):
    """The predicted positions of the particles first to last, and those of ``grips`` stiff grips that are on them."""
    predict(t, last, run, first + rank, size)
    if grips > 0:
        barrier(size)
        for g in range(rank, grips, size):
            i = t.grip_corner[3 * g]
            if i >= first and i < last:
                hold_vertices(t, run, g, grips)


@wp.func
def steps_of(work: Work, block: int):
    """The steps of one block."""
    return subarray(work.step, 4 * block * work.steps, 4 * work.steps)


@wp.func
def sweep_share(
    t: Any, topo: Topology, run: Settings, kind: int, sweep: int, first: int, last: int, rank: int, size: int
):
    """A block's share of a step of `nuno.plans.cloth_elastic.sweep_membrane`."""
    if kind == SWEPT_CELLS:
        shear_cells(t, topo, t.cell_sum, run, sweep, first, last, rank, size)
    elif kind == TRIANGLES:
        strain_triangles(t, topo, t.triangle_sum, run, sweep, first, last, rank, size)
    else:
        stretch_grid_lines_of_block(t, topo, run, sweep, first, last, rank, size)
        if sweep + 1 < run.sweeps:
            barrier(size)
            note_lengths(t, topo, t.grid_line_goal, topo.grid_line[first], topo.grid_line[last], rank, size)


@wp.func
def go_through(
    t: Any, topo: Topology, work: Work, steps: wp.array(dtype=int), run: Settings, grips: int, begin: int,
    end: int, block_group: BlockGroup,
):  # fmt: skip
    """Of a block's ``steps`` those from ``begin`` to ``end``; after the last nobody waits.

    ``grips`` is none where no stiff grip is on a particle that the block predicts.
    """
    rank = block_group.rank_in_block
    size = block_group.block_size
    rate = 1.0 / (run.dt * run.dt)
    kind = steps[4 * begin]
    ready = read(work, t.group, kind, steps[4 * begin + 2] + rank, steps[4 * begin + 3])
    for step in range(begin, end):
        now = ready
        what = kind
        first = steps[4 * step + 2]
        last = steps[4 * step + 3]
        if step + 1 < end:
            kind = steps[4 * step + 4]
            ready = read(work, t.group, kind, steps[4 * step + 6] + rank, steps[4 * step + 7])
        if is_sorted(what):
            k = first + rank
            while k < last:
                solve(t, what, now, rate)
                k += size
                if k < last:
                    now = read(work, t.group, what, k, last)
        elif what == PARTICLES:
            set_out(t, run, grips, first, last, rank, size)
        elif what >= PLAIN and what < KINDS:
            solve_plain(t, topo, run, what - PLAIN, first, last, rank, size)
        else:
            sweep_share(t, topo, run, what % KINDS, what / KINDS, first, last, rank, size)
        if step + 1 < end:
            if steps[4 * step + 1] != 0:
                grid_barrier(block_group)
            else:
                barrier(size)
