"""The elastic constraints by the blocks of a device, in the stages of `nuno.scene.stages`.

A block has its share of each step. Its threads read what tables have of their next element while they work on one, also
across waits, as in `nuno.solver.cloth_ahead`.
"""

from itertools import pairwise
from typing import Any

import numpy as np
import warp as wp

from nuno.scene.cloth import ClothTopology, Elements
from nuno.scene.stages import Colour, Stages, make_stages
from nuno.scene.yarns import string_yarns
from nuno.solver.bending import bend_line, bend_twist
from nuno.solver.block_yarns import stretch_yarns_of_block
from nuno.solver.compliances import Compliances
from nuno.solver.frame import bend_patches, strain_triangles
from nuno.solver.grips import hold_vertices
from nuno.solver.integrate import predict
from nuno.solver.lanes import barrier, product, window
from nuno.solver.membrane import shear_cell
from nuno.solver.state import Settings, Topology
from nuno.solver.sweeps import note_lengths, shear_cells_again, strain_triangles_again
from nuno.solver.team import Team, meet

PARTICLES, PATCHES, TWISTS, LINES, CELLS, TRIANGLES, YARNS, SWEPT_CELLS, SWEPT_TRIANGLES, SWEPT_YARNS = range(10)
"""Kinds of elements in the order in which they are solved; particles are predicted first. Those in the cloth's plane
may be swept several times."""
KINDS = 16
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
    soft: wp.array(dtype=float)  # of every world: what ``scale`` is multiplied with


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

    for kind, elements in ((PATCHES, topology.patches), (TWISTS, topology.twists), (LINES, topology.lines)):
        add(kind, elements)
    order, starts, kinds = string_yarns(topology.edges)
    ends = topology.edges.vertices[order]
    cells, triangles, yarns = (SWEPT_CELLS, SWEPT_TRIANGLES, SWEPT_YARNS) if sweeps else (CELLS, TRIANGLES, YARNS)
    for sweep in range(max(1, sweeps)):
        add(cells + KINDS * sweep, topology.cells)
        add(triangles + KINDS * sweep, topology.triangles)
        for first, last in pairwise(kinds):
            if last > first:
                owner = np.repeat(np.arange(last - first), 2 * np.diff(starts[first : last + 1]))
                vertices = ends[starts[first] : starts[last]].ravel()
                colours.append(Colour(yarns + KINDS * sweep, int(first), int(last - first), owner, vertices))
    made = topology.device_arrays[key] = make_stages(colours, n, blocks, SORTED)
    return made


def make_work(topology: ClothTopology, soft: Compliances, stages: Stages, device: str) -> Any:
    """A cloth's `Work` on a device."""
    quarter = topology.cells.extra["quarter"] if len(topology.cells) else topology.cells.scale
    columns = {
        TWISTS: (topology.twists.vertices, topology.twists.scale, soft.twist, soft.bend),
        LINES: (topology.lines.vertices, topology.lines.scale, soft.line, soft.bend),
        CELLS: (topology.cells.vertices, quarter, soft.cell, soft.shear),
    }
    count = len(stages.row)
    corner, scale = np.zeros((count, 4), dtype=np.int32), np.zeros(count, dtype=np.float32)
    compliance = np.zeros((len(soft.bend), count))
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
    work.soft = wp.array(compliance.ravel(), dtype=float, device=device)
    return work


@wp.func
def is_sorted(kind: int):
    """Whether the table has this kind's elements."""
    return kind == TWISTS or kind == LINES or kind == CELLS


@wp.struct
class Element:
    """What the table has of one element."""

    a: int
    b: int
    c: int
    d: int
    scale: float
    soft: float


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
        element.soft = work.soft[world * work.scale.shape[0] + k]
    return element


@wp.func
def solve(t: Any, kind: int, e: Element, rate: float):
    """One bend or shear, as in `nuno.solver.frame`."""
    if kind == TWISTS:
        bend_twist(t, e.a, e.b, e.c, e.d, product(e.soft, e.scale * rate))
    elif kind == LINES:
        bend_line(t, e.a, e.b, e.c, product(e.soft, e.scale * rate))
    else:
        shear_cell(t, e.a, e.b, e.c, e.d, e.scale, product(e.soft, e.scale * 4.0 * rate), 0.0, 0.0, 0.0)


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
def set_out(t: Any, run: Settings, grips: int, first: int, last: int, thread: int, threads: int):
    """The predicted positions of the particles first to last, and those of ``grips`` stiff grips that are on them."""
    predict(t, last, run, first + thread, threads)
    if grips > 0:
        barrier(threads)
        for g in range(thread, grips, threads):
            i = t.grip_corner[3 * g]
            if i >= first and i < last:
                hold_vertices(t, run, g, grips)


@wp.func
def steps_of(work: Work, block: int):
    """The steps of one block."""
    return window(work.step, 4 * block * work.steps, 4 * work.steps)


@wp.func
def sweep_share(
    t: Any, topo: Topology, run: Settings, kind: int, sweep: int, first: int, last: int, thread: int, threads: int
):
    """A block's share of a step of `nuno.solver.frame.sweep_membrane`."""
    if kind == SWEPT_CELLS:
        shear_cells_again(t, topo, t.cell_sum, run, sweep, first, last, thread, threads)
    elif kind == SWEPT_TRIANGLES:
        strain_triangles_again(t, topo, t.triangle_sum, run, sweep, first, last, thread, threads)
    else:
        lengths = topo.edge_rest
        if sweep > 0:
            lengths = t.yarn_goal
        stretch_yarns_of_block(t, topo, lengths, run, first, last, thread, threads)
        if sweep + 1 < run.sweeps:
            barrier(threads)
            note_lengths(t, topo, t.yarn_goal, topo.yarn[first], topo.yarn[last], thread, threads)


@wp.func
def go_through(
    t: Any, topo: Topology, work: Work, steps: wp.array(dtype=int), run: Settings, grips: int, begin: int,
    end: int, team: Team,
):  # fmt: skip
    """Of a block's ``steps`` those from ``begin`` to ``end``; after the last nobody waits.

    ``grips`` is none where no stiff grip is on a particle that the block predicts.
    """
    thread = team.thread
    threads = team.threads
    rate = 1.0 / (run.dt * run.dt)
    kind = steps[4 * begin]
    ready = read(work, t.group, kind, steps[4 * begin + 2] + thread, steps[4 * begin + 3])
    for step in range(begin, end):
        now = ready
        what = kind
        first = steps[4 * step + 2]
        last = steps[4 * step + 3]
        if step + 1 < end:
            kind = steps[4 * step + 4]
            ready = read(work, t.group, kind, steps[4 * step + 6] + thread, steps[4 * step + 7])
        if is_sorted(what):
            k = first + thread
            while k < last:
                solve(t, what, now, rate)
                k += threads
                if k < last:
                    now = read(work, t.group, what, k, last)
        elif what == PARTICLES:
            set_out(t, run, grips, first, last, thread, threads)
        elif what == PATCHES:
            bend_patches(t, topo, run, first, last, thread, threads)
        elif what == TRIANGLES:
            strain_triangles(t, topo, run, first, last, thread, threads)
        elif what == YARNS:
            stretch_yarns_of_block(t, topo, topo.edge_rest, run, first, last, thread, threads)
        else:
            sweep_share(t, topo, run, what % KINDS, what / KINDS, first, last, thread, threads)
        if step + 1 < end:
            if steps[4 * step + 1] != 0:
                meet(team)
            else:
                barrier(threads)
