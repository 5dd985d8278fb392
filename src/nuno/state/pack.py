"""Small kernels between the solver's layout and the rest: positions for the renderer, the clock, what is finite."""

from typing import Any

import numpy as np
import warp as wp

from nuno.numbers.cpu_compiler import compile_quickly
from nuno.numbers.doubles import add, at, double_lane, to_float  # noqa: F401 (add: the operator)
from nuno.numbers.lanes import LANES, lane
from nuno.state.cloth_state import CLOCK, NOTES, ORIGIN, SCALARS

compile_quickly(__name__)


@wp.kernel(enable_backward=False)
def pack(
    x: wp.array(dtype=Any),
    y: wp.array(dtype=Any),
    z: wp.array(dtype=Any),
    scalars: wp.array(dtype=float),
    n: int,
    out: wp.array2d(dtype=wp.vec3),
):
    """One world after the other, (worlds, n) of vec3; doubles are rounded once."""
    world, i = wp.tid()
    k = world * n + i
    o = world * SCALARS + ORIGIN
    out[world, i] = wp.vec3(
        to_float(x[k] + scalars[o]), to_float(y[k] + scalars[o + 1]), to_float(z[k] + scalars[o + 2])
    )


@wp.kernel(enable_backward=False)
def pack_lanes(
    x: wp.array(dtype=Any),
    y: wp.array(dtype=Any),
    z: wp.array(dtype=Any),
    scalars: wp.array(dtype=lane),
    n: int,
    out: wp.array2d(dtype=wp.vec3),
):
    """The same out of lanes."""
    group, i = wp.tid()
    k = group * n + i
    o = group * SCALARS + ORIGIN
    a = to_float(at(x, k) + scalars[o])
    b = to_float(at(y, k) + scalars[o + 1])
    c = to_float(at(z, k) + scalars[o + 2])
    for j in range(LANES):
        world = group * LANES + j
        if world < out.shape[0]:
            out[world, i] = wp.vec3(a[j], b[j], c[j])


for _kernel, _own, _numbers in ((pack, float, (float, wp.float64)), (pack_lanes, lane, (lane, double_lane))):
    for _number in _numbers:
        _places = [wp.array(dtype=_number)] * 3
        wp.overload(_kernel, [*_places, wp.array(dtype=_own), int, wp.array2d(dtype=wp.vec3)])


@wp.kernel(enable_backward=False)
def zero_note(notes: wp.array(dtype=Any), stride: int, entry: int):
    """Set a note of each world or group to zero."""
    i = wp.tid() * stride + entry
    notes[i] = notes[i] * 0.0


wp.overload(zero_note, [wp.array(dtype=float), int, int])
wp.overload(zero_note, [wp.array(dtype=lane), int, int])


# A module of its own: only CUDA asks it.
@wp.kernel(enable_backward=False, module="nuno.state.finite")
def find_broken(
    x: wp.array(dtype=float),
    y: wp.array(dtype=float),
    z: wp.array(dtype=float),
    vx: wp.array(dtype=float),
    vy: wp.array(dtype=float),
    vz: wp.array(dtype=float),
    n: int,
    broken: wp.array(dtype=int),
):
    """Note the worlds with a number that is not finite."""
    world, i = wp.tid()
    k = world * n + i
    if not (
        wp.isfinite(x[k])
        and wp.isfinite(y[k])
        and wp.isfinite(z[k])
        and wp.isfinite(vx[k])
        and wp.isfinite(vy[k])
        and wp.isfinite(vz[k])
    ):
        broken[world] = 1


@wp.kernel(enable_backward=False, module="nuno.state.finite")
def gather_places(
    x: wp.array(dtype=Any),
    y: wp.array(dtype=Any),
    z: wp.array(dtype=Any),
    origin: wp.array2d(dtype=wp.float64),
    some: wp.array2d(dtype=int),
    n: int,
    out: wp.array3d(dtype=wp.float64),
):
    """All particles of each world, or ``some`` where there are any, in doubles and about the world's own origin."""
    world, i = wp.tid()
    k = world * n + i
    if some.shape[1] > 0:
        k = world * n + (some[world, i] + n) % n  # -1 is the last, as in NumPy
    out[world, i, 0] = wp.float64(x[k]) + origin[world, 0]
    out[world, i, 1] = wp.float64(y[k]) + origin[world, 1]
    out[world, i, 2] = wp.float64(z[k]) + origin[world, 2]


for _number in (float, wp.float64):
    _ends = [wp.array2d(dtype=wp.float64), wp.array2d(dtype=int), int, wp.array3d(dtype=wp.float64)]
    wp.overload(gather_places, [*[wp.array(dtype=_number)] * 3, *_ends])


def places_of_worlds(
    places: list[wp.array], origin: np.ndarray, n: int, some: np.ndarray | None, device: str
) -> np.ndarray:
    """Return (worlds, k, 3) float64 [m], put together on the device, which is waited for once.

    Args:
        places: The solver's x, y and z, one world of n particles after the other.
        origin: (worlds, 3) float64, what they are relative to.
        n: Particles of a world.
        some: (worlds, k) int, which of them; None for all.
        device: Where they are.
    """
    worlds = len(origin)
    count = n if some is None else some.shape[1]
    chosen = np.zeros((worlds, 0), dtype=np.int32) if some is None else np.asarray(some, dtype=np.int32)
    out = wp.empty((worlds, count, 3), dtype=wp.float64, device=device)
    if out.size:
        given = [wp.array(origin, dtype=wp.float64, device=device), wp.array(chosen, dtype=int, device=device), n, out]
        wp.launch(gather_places, dim=(worlds, count), inputs=[*places, *given], device=device)
    return np.asarray(out.numpy())


def finite_worlds(
    state: Any, worlds: int, n: int, device: str, counts: wp.array | None = None
) -> tuple[np.ndarray, np.ndarray | None]:
    """(worlds,) bool: whether every position and velocity is finite, found on the device; and (worlds, k) ``counts``.

    All comes in one piece, which the device is waited for once.
    """
    flags = wp.zeros(worlds + (0 if counts is None else counts.size), dtype=int, device=device)
    arrays = [getattr(state, name) for name in ("x", "y", "z", "vx", "vy", "vz")]
    wp.launch(find_broken, dim=(worlds, n), inputs=[*arrays, n, flags], device=device)
    if counts is not None:
        wp.copy(flags, counts, dest_offset=worlds)
    values = flags.numpy()
    return np.asarray(values[:worlds] == 0), None if counts is None else values[worlds:].reshape(worlds, -1)


def pack_positions(
    state: Any, worlds: int, n: int, lanes: int, device: str, out: wp.array | None = None,
    places: list[wp.array] | None = None,
) -> wp.array:  # fmt: skip
    """(worlds, n) array of vec3 [m] from a solver's state, or into ``out``; from doubles, where they are ``places``."""
    if out is None:
        out = wp.empty((worlds, n), dtype=wp.vec3, device=device)
    places = [state.x, state.y, state.z] if places is None else places
    count = -(-worlds // lanes)
    wp.launch((pack, pack_lanes)[lanes > 1], dim=(count, n), inputs=[*places, state.scalars, n, out], device=device)
    return out


def pack_velocities(state: Any, worlds: int, n: int, lanes: int, device: str, out: wp.array | None = None) -> wp.array:
    """(worlds, n) array of vec3 [m/s] from a solver's state, or into ``out``: as positions about no origin."""
    if out is None:
        out = wp.empty((worlds, n), dtype=wp.vec3, device=device)
    nothing = wp.zeros_like(state.scalars)
    inputs = [state.vx, state.vy, state.vz, nothing, n, out]
    wp.launch((pack, pack_lanes)[lanes > 1], dim=(-(-worlds // lanes), n), inputs=inputs, device=device)
    return out


def reset_note(state: Any, groups: int, device: str, entry: int) -> None:
    """Set one of the notes to zero in all worlds."""
    wp.launch(zero_note, dim=groups, inputs=[state.notes, NOTES, entry], device=device)


def reset_clock(state: Any, groups: int, device: str) -> None:
    """Start a run's clock at zero."""
    reset_note(state, groups, device, CLOCK)
