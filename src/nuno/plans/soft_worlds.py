"""A soft body's worlds on the CPU, each by one thread: one by one, sixteen at once, or one world by sixteen clusters.

A Warp module for each kernel, so that only the kind that is run is compiled.
"""

from typing import Any

import warp as wp

from nuno.numbers.cpu_compiler import compile_quickly
from nuno.numbers.crew import crew_of
from nuno.numbers.lanes import LANES
from nuno.plans.simd_elements import as_lanes, by_sixteen
from nuno.plans.substep import advance
from nuno.state.cloth_state import Settings, Shapes
from nuno.state.soft_state import (
    Sides,
    SimdClusters,
    SoftDouble,
    SoftDoubleLanes,
    SoftFloat,
    SoftLanes,
    SoftSizes,
    Tetrahedra,
    view,
)

for _name in ("worlds", "lanes", "simd", "double_worlds", "double_lanes", "double_simd"):
    compile_quickly(f"nuno.plans.run_soft_{_name}")


@wp.func
def soft_by_sixteen(p: Any, t: Any, simd: SimdClusters, m: int):
    """`by_sixteen`, with what soft bodies alone have."""
    p = by_sixteen(p, t, simd, m)
    p.shift_x = as_lanes(t.shift_x, m)
    p.shift_y = as_lanes(t.shift_y, m)
    p.shift_z = as_lanes(t.shift_z, m)
    return p


@wp.kernel(enable_backward=False, module="nuno.plans.run_soft_worlds")
def run_soft_worlds(
    s: SoftFloat, topo: Tetrahedra, sides: Sides, sizes: SoftSizes, run: Settings, shapes: Shapes, first: int,
    substeps: int,
):  # fmt: skip
    """Every world by itself, by one thread on the CPU."""
    t = view(s, first + wp.tid(), topo.particles, sizes)
    advance(t, t, t, t, topo, sides, run, shapes, 0, substeps, crew_of(0, 1))


@wp.kernel(enable_backward=False, module="nuno.plans.run_soft_lanes")
def run_soft_lanes(
    s: SoftLanes, topo: Tetrahedra, sides: Sides, sizes: SoftSizes, run: Settings, shapes: Shapes, first: int,
    substeps: int,
):  # fmt: skip
    """Sixteen worlds at once, by one thread on the CPU."""
    t = view(s, first + wp.tid(), topo.particles, sizes)
    advance(t, t, t, t, topo, sides, run, shapes, 0, substeps, crew_of(0, 1))


@wp.kernel(enable_backward=False, module="nuno.plans.run_soft_simd")
def run_soft_simd(
    s: SoftFloat, topo: Tetrahedra, simd: SimdClusters, sides: Sides, sizes: SoftSizes, run: Settings, shapes: Shapes,
    substeps: int,
):  # fmt: skip
    """One world by one thread, sixteen tetrahedra or particles at a time."""
    n = topo.particles
    t = view(s, wp.tid(), n, sizes)
    p = soft_by_sixteen(SoftLanes(), t, simd, (n + LANES - 1) / LANES)
    advance(t, p, t, p, simd, sides, run, shapes, 0, substeps, crew_of(0, 1))


@wp.kernel(enable_backward=False, module="nuno.plans.run_soft_double_worlds")
def run_soft_double_worlds(
    s: SoftDouble, rounded: SoftFloat, topo: Tetrahedra, sides: Sides, sizes: SoftSizes, run: Settings, shapes: Shapes,
    first: int, substeps: int,
):  # fmt: skip
    """Every world by itself, by one thread on the CPU, coordinates as doubles."""
    n, group = topo.particles, first + wp.tid()
    t = view(s, group, n, sizes)
    floats = view(rounded, group, n, sizes)
    advance(t, t, floats, floats, topo, sides, run, shapes, 0, substeps, crew_of(0, 1))


@wp.kernel(enable_backward=False, module="nuno.plans.run_soft_double_lanes")
def run_soft_double_lanes(
    s: SoftDoubleLanes, rounded: SoftLanes, topo: Tetrahedra, sides: Sides, sizes: SoftSizes, run: Settings,
    shapes: Shapes,
    first: int, substeps: int,
):  # fmt: skip
    """Sixteen worlds at once, by one thread on the CPU, coordinates as doubles."""
    n, group = topo.particles, first + wp.tid()
    t = view(s, group, n, sizes)
    floats = view(rounded, group, n, sizes)
    advance(t, t, floats, floats, topo, sides, run, shapes, 0, substeps, crew_of(0, 1))


@wp.kernel(enable_backward=False, module="nuno.plans.run_soft_double_simd")
def run_soft_double_simd(
    s: SoftDouble, rounded: SoftFloat, topo: Tetrahedra, simd: SimdClusters, sides: Sides, sizes: SoftSizes,
    run: Settings, shapes: Shapes, substeps: int,
):  # fmt: skip
    """One world by one thread, sixteen tetrahedra or particles at a time, coordinates as doubles."""
    n = topo.particles
    m = (n + LANES - 1) / LANES
    t = view(s, wp.tid(), n, sizes)
    floats = view(rounded, wp.tid(), n, sizes)
    p = soft_by_sixteen(SoftDoubleLanes(), t, simd, m)
    lanes = by_sixteen(SoftLanes(), floats, simd, m)
    advance(t, p, floats, lanes, simd, sides, run, shapes, 0, substeps, crew_of(0, 1))
