"""A cloth's worlds on the CPU, each by one thread: one by one, sixteen at once, or one world by sixteen elements.

A Warp module for each kernel, so that only the kind that is run is compiled.
"""

import warp as wp

from nuno.numbers.cpu_compiler import compile_quickly
from nuno.numbers.crew import crew_of
from nuno.numbers.lanes import LANES
from nuno.plans.simd_elements import SimdElements, by_sixteen
from nuno.plans.substep import advance
from nuno.state.cloth_state import (
    Settings,
    Shapes,
    Sizes,
    StateDouble,
    StateDoubleLanes,
    StateFloat,
    StateLanes,
    Topology,
    view,
)

for _name in ("worlds", "lanes", "simd", "double_worlds", "double_lanes", "double_simd"):
    compile_quickly(f"nuno.plans.run_{_name}")


@wp.kernel(enable_backward=False, module="nuno.plans.run_worlds")
def run_worlds(s: StateFloat, topo: Topology, sizes: Sizes, run: Settings, shapes: Shapes, first: int, substeps: int):
    """Every world by itself, by one thread on the CPU."""
    t = view(s, first + wp.tid(), topo.particles, sizes)
    advance(t, t, t, t, topo, topo, run, shapes, 0, substeps, crew_of(0, 1))


@wp.kernel(enable_backward=False, module="nuno.plans.run_lanes")
def run_lanes(s: StateLanes, topo: Topology, sizes: Sizes, run: Settings, shapes: Shapes, first: int, substeps: int):
    """Sixteen worlds at once, by one thread on the CPU."""
    t = view(s, first + wp.tid(), topo.particles, sizes)
    advance(t, t, t, t, topo, topo, run, shapes, 0, substeps, crew_of(0, 1))


@wp.kernel(enable_backward=False, module="nuno.plans.run_double_worlds")
def run_double_worlds(
    s: StateDouble,
    rounded: StateFloat,
    topo: Topology,
    sizes: Sizes,
    run: Settings,
    shapes: Shapes,
    first: int,
    substeps: int,
):
    """Every world by itself, by one thread on the CPU, coordinates as doubles."""
    group = first + wp.tid()
    t = view(s, group, topo.particles, sizes)
    floats = view(rounded, group, topo.particles, sizes)
    advance(t, t, floats, floats, topo, topo, run, shapes, 0, substeps, crew_of(0, 1))


@wp.kernel(enable_backward=False, module="nuno.plans.run_double_lanes")
def run_double_lanes(
    s: StateDoubleLanes, rounded: StateLanes, topo: Topology, sizes: Sizes, run: Settings, shapes: Shapes, first: int,
    substeps: int,
):  # fmt: skip
    """Sixteen worlds at once, by one thread on the CPU, coordinates as doubles."""
    group = first + wp.tid()
    t = view(s, group, topo.particles, sizes)
    floats = view(rounded, group, topo.particles, sizes)
    advance(t, t, floats, floats, topo, topo, run, shapes, 0, substeps, crew_of(0, 1))


@wp.kernel(enable_backward=False, module="nuno.plans.run_simd")
def run_simd(
    s: StateFloat, topo: Topology, simd: SimdElements, sizes: Sizes, run: Settings, shapes: Shapes, substeps: int
):
    """One world by one thread."""
    n = topo.particles
    t = view(s, wp.tid(), n, sizes)
    p = by_sixteen(StateLanes(), t, simd, (n + LANES - 1) / LANES)
    advance(t, p, t, p, simd, topo, run, shapes, 0, substeps, crew_of(0, 1))


@wp.kernel(enable_backward=False, module="nuno.plans.run_double_simd")
def run_double_simd(
    s: StateDouble, rounded: StateFloat, topo: Topology, simd: SimdElements, sizes: Sizes, run: Settings,
    shapes: Shapes, substeps: int,
):  # fmt: skip
    """One world by one thread, coordinates as doubles."""
    n = topo.particles
    m = (n + LANES - 1) / LANES
    t = view(s, wp.tid(), n, sizes)
    floats = view(rounded, wp.tid(), n, sizes)
    p = by_sixteen(StateDoubleLanes(), t, simd, m)
    lanes = by_sixteen(StateLanes(), floats, simd, m)
    advance(t, p, floats, lanes, simd, topo, run, shapes, 0, substeps, crew_of(0, 1))
