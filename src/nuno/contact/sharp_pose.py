"""One sharp shape in one substep: where it was when the substep began, what its surface moves, and how it touches."""

from typing import Any

import warp as wp

from nuno.contact.shapes import COLUMNS, LEAVE_SPEED
from nuno.contact.sharp_shapes import QUICK, ROUND, pose_of
from nuno.solver.lanes import (  # noqa: F401
    add,
    choose,
    fill,
    lane,
    largest,
    mul,
    per_world,
    root,
    sub,
    times,
)
from nuno.solver.state import CLOCK, FRICTION, THICKNESS, Settings, Shapes

NUMBERS = (
    "cx", "cy", "cz", "r00", "r01", "r02", "r10", "r11", "r12", "r20", "r21", "r22",
    "ex", "ey", "ez", "d00", "d01", "d02", "d10", "d11", "d12", "d20", "d21", "d22",
    "sa", "sb", "sc", "mu", "leave", "radius", "reach",
)  # fmt: skip
"""Place [m] and rotation (row major, shape to world) when the substep began, and what they change in it; sizes [m],
friction; how far what is too near is let go at most, half the cloth's thickness, and what is not farther when the
substep begins may be reached in it [m]."""


def _make(name: str, number: type) -> Any:
    fields: dict[str, Any] = {name: number for name in NUMBERS} | {"broad": float, "kind": int, "slot": int}
    return wp.struct(type(name, (), {"__annotations__": fields, "__module__": __name__}))


SharpFloat, SharpLanes = _make("SharpFloat", float), _make("SharpLanes", lane)


@wp.func
def sharp_pose(like: float, t: Any, run: Settings, shapes: Shapes, s: int):
    """The numbers of shape s."""
    h = SharpFloat()
    return measured(h, like, t, run, shapes, s)


@wp.func
def sharp_pose(like: lane, t: Any, run: Settings, shapes: Shapes, s: int):
    h = SharpLanes()
    return measured(h, like, t, run, shapes, s)


@wp.func
def measured(h: Any, like: Any, t: Any, run: Settings, shapes: Shapes, s: int):
    """`sharp_pose` into ``h``."""
    clock = int(largest(t.notes[CLOCK]))
    h.kind = shapes.kind[s]
    h.slot = shapes.slot[s]
    cx, cy, cz, r00, r01, r02, r10, r11, r12, r20, r21, r22 = pose_of(like, t, shapes, s, clock - 1)
    h.cx = cx
    h.cy = cy
    h.cz = cz
    h.r00 = r00
    h.r01 = r01
    h.r02 = r02
    h.r10 = r10
    h.r11 = r11
    h.r12 = r12
    h.r20 = r20
    h.r21 = r21
    h.r22 = r22
    if h.slot >= 0:
        ex, ey, ez, d00, d01, d02, d10, d11, d12, d20, d21, d22 = pose_of(like, t, shapes, s, clock)
        h.ex = ex - cx
        h.ey = ey - cy
        h.ez = ez - cz
        h.d00 = d00 - r00
        h.d01 = d01 - r01
        h.d02 = d02 - r02
        h.d10 = d10 - r10
        h.d11 = d11 - r11
        h.d12 = d12 - r12
        h.d20 = d20 - r20
        h.d21 = d21 - r21
        h.d22 = d22 - r22
    row = s * COLUMNS
    h.sa = per_world(like, shapes.table, t.group, shapes.stride, t.worlds, row + 12)
    h.sb = per_world(like, shapes.table, t.group, shapes.stride, t.worlds, row + 13)
    h.sc = per_world(like, shapes.table, t.group, shapes.stride, t.worlds, row + 14)
    mean = root(times(t.scalars[FRICTION], per_world(like, shapes.table, t.group, shapes.stride, t.worlds, row + 15)))
    pair = per_world(like, shapes.table, t.group, shapes.stride, t.worlds, row + 16)
    h.mu = choose(pair + fill(like, 0.5), pair, mean)
    h.radius = t.scalars[THICKNESS] * 0.5
    h.leave = fill(like, LEAVE_SPEED * run.dt)
    h.reach = h.radius + fill(like, QUICK * run.dt)
    h.broad = ROUND * run.cell
    return h
