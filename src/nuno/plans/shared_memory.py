"""The memory that the threads of a CUDA block share, which answers many times sooner than the device's."""

from typing import Any

import warp as wp

from nuno.state.cloth_state import NOTES, SCALARS

SHARED_FLOATS = 11500
"""Floats in the static buffer: 48 KB less the 2 KB that Warp takes for itself at 512 threads, the counts and the
figures."""
SHARED_PARTICLES = wp.constant(SHARED_FLOATS // 4)
"""Particles whose coordinates and inverse masses fit."""
MAX_STEPS = wp.constant(128)
"""Steps that there is room for in `program`."""
ROOMY_PARTICLES, WHOLE_PARTICLES = wp.constant(SHARED_FLOATS // 7), wp.constant(SHARED_FLOATS // 11)
"""Particles of which three more numbers fit, and those for whose contacts there is room besides."""
DOUBLE_PARTICLES = wp.constant(SHARED_FLOATS // 6)
"""Particles whose coordinates fit as doubles."""
SMALL_FLOATS = SHARED_FLOATS // 2
"""Floats in the buffer of small cloths; what blocks do not take of a multiprocessor's memory is its cache."""
SMALL_PARTICLES = wp.constant(SMALL_FLOATS // 11)
"""`WHOLE_PARTICLES` of a small cloth."""


_COLUMN = """
#if defined(__CUDA_ARCH__)
__shared__ float buffer[FLOATS];
return wp::array_t<wp::float32>(buffer + first, 0);
#else
return {};
#endif
"""


@wp.func_native(_COLUMN.replace("FLOATS", str(SHARED_FLOATS)))
def column(first: int) -> wp.array(dtype=float):  # type: ignore[valid-type]
    """The block's own memory from number ``first`` on.

    Known to the compiler as such, and by a place that it knows, an element is read by one short instruction. The array
    says that it has no elements, for then no index can be one that counts from the end.
    """
    ...


@wp.func_native(_COLUMN.replace("FLOATS", str(SMALL_FLOATS)))
def small_column(first: int) -> wp.array(dtype=float):  # type: ignore[valid-type]
    """The same of small cloths, in kernels that have no other."""
    ...


@wp.func_native("""
#if defined(__CUDA_ARCH__)
return wp::array_t<wp::int32>(reinterpret_cast<int*>(numbers.data), 0);
#else
return {};
#endif
""")
def whole(numbers: wp.array(dtype=float)) -> wp.array(dtype=int):  # type: ignore[valid-type]
    """A `column` of whole numbers."""
    ...


@wp.func_native("""
#if defined(__CUDA_ARCH__)
__shared__ double buffer[5750];
return wp::array_t<wp::float64>(buffer + first, 0);
#else
return {};
#endif
""")
def double_column(first: int) -> wp.array(dtype=wp.float64):  # type: ignore[valid-type]
    """The same memory as doubles, in kernels that have it as such alone."""
    ...


@wp.func_native("""
#if defined(__CUDA_ARCH__)
__shared__ float figures[16];
return wp::array_t<wp::float32>(figures + first, 0);
#else
return {};
#endif
""")
def figures(first: int) -> wp.array(dtype=float):  # type: ignore[valid-type]
    """Sixteen numbers in the block's own memory, from number ``first`` on: the world's scalars and notes."""
    ...


@wp.func_native("""
#if defined(__CUDA_ARCH__)
__shared__ int counts[8];
return wp::array_t<wp::int32>(counts + first, 0);
#else
return {};
#endif
""")
def counts(first: int) -> wp.array(dtype=int):  # type: ignore[valid-type]
    """Eight counts in the block's own memory, from number ``first`` on."""
    ...


@wp.func_native("""
#if defined(__CUDA_ARCH__)
__shared__ int steps[512];
return wp::array_t<wp::int32>(steps + first, 0);
#else
return {};
#endif
""")
def program(first: int) -> wp.array(dtype=int):  # type: ignore[valid-type]
    """Return a block's program, kept in its own memory, four numbers a step, from number ``first`` on."""
    ...


@wp.func
def bring_places(to: Any, of: Any, n: int, rank: int, size: int):
    """Copy x, y and z of ``n`` particles from one state of a world to another, by all threads of a block."""
    for i in range(rank, n, size):
        to.x[i] = of.x[i]
        to.y[i] = of.y[i]
        to.z[i] = of.z[i]


@wp.func
def bring_speeds(to: Any, of: Any, n: int, rank: int, size: int):
    """The same of velocities."""
    for i in range(rank, n, size):
        to.vx[i] = of.vx[i]
        to.vy[i] = of.vy[i]
        to.vz[i] = of.vz[i]


@wp.func
def bring_starts(to: Any, of: Any, n: int, rank: int, size: int):
    """Copy where all particles began the substep."""
    for i in range(rank, n, size):
        to.px[i] = of.px[i]
        to.py[i] = of.py[i]
        to.pz[i] = of.pz[i]


@wp.func
def bring_masses(to: Any, of: Any, n: int, rank: int, size: int):
    """The same of inverse masses."""
    for i in range(rank, n, size):
        to.w[i] = of.w[i]


@wp.func
def bring_notes(into: Any, notes: Any):
    """Copy a world's notes; one thread does it."""
    for k in range(NOTES):
        into[k] = notes[k]


@wp.func
def bring_figures(t: Any, scalars: Any, notes: Any, rank: int):
    """Copy a world's scalars and notes to where ``t`` has them."""
    if rank == 0:
        for k in range(SCALARS):
            t.scalars[k] = scalars[k]
        bring_notes(t.notes, notes)
