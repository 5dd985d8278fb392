"""One sharp shape in one substep: where it was when the substep began, what its surface moves, and how it touches."""

from typing import Any

import warp as wp

from nuno.contact.particle.feature_lists import QUICK, ROUND, pose_of
from nuno.contact.particle.shape_contact import COLUMNS, LEAVE_SPEED, three_of
from nuno.numbers.lanes import add, choose, full_like, lane, lane_max, mul, per_world, sqrt, sub  # noqa: F401
from nuno.numbers.vec3 import LaneMat3, LaneVec3, Mat3, Vec3
from nuno.state.cloth_state import CLOCK, FRICTION, THICKNESS, Settings, Shapes

NUMBERS = ("mu", "leave", "radius", "reach")
"""Friction; how far what is too near is let go at most, half the cloth's thickness, and what is not farther when the
substep begins may be reached in it [m]."""


def _make(name: str, number: type, vector: type, matrix: type) -> Any:
    fields: dict[str, Any] = {"centre": vector, "rotation": matrix}  # when the substep began: place [m], shape to world
    fields |= {"e": vector, "d": matrix}  # what they change in it
    fields |= {"size": vector} | {name: number for name in NUMBERS} | {"broad": float, "kind": int, "slot": int}
    return wp.struct(type(name, (), {"__annotations__": fields, "__module__": __name__}))


FeatureFloat, FeatureLanes = _make("FeatureFloat", float, Vec3, Mat3), _make("FeatureLanes", lane, LaneVec3, LaneMat3)


@wp.func
def feature_pose(like: float, t: Any, run: Settings, shapes: Shapes, s: int):
    """The numbers of shape s."""
    h = FeatureFloat()
    return measured(h, like, t, run, shapes, s)


@wp.func
def feature_pose(like: lane, t: Any, run: Settings, shapes: Shapes, s: int):
    h = FeatureLanes()
    return measured(h, like, t, run, shapes, s)


@wp.func
def measured(h: Any, like: Any, t: Any, run: Settings, shapes: Shapes, s: int):
    """`feature_pose` into ``h``."""
    clock = int(lane_max(t.notes[CLOCK]))
    h.kind = shapes.kind[s]
    h.slot = shapes.slot[s]
    centre, rotation = pose_of(like, t, shapes, s, clock - 1, clock)
    h.centre = centre
    h.rotation = rotation
    if h.slot >= 0:
        after, turn_after = pose_of(like, t, shapes, s, clock, clock)
        h.e = after - centre
        h.d = turn_after - rotation
    row = s * COLUMNS
    h.size = three_of(like, t, shapes, row + 12)
    mean = sqrt(t.scalars[FRICTION] * per_world(like, shapes.table, t.group, shapes.stride, t.worlds, row + 15))
    pair = per_world(like, shapes.table, t.group, shapes.stride, t.worlds, row + 16)
    h.mu = choose(pair + 0.5, pair, mean)
    h.radius = t.scalars[THICKNESS] * 0.5
    h.leave = full_like(like, LEAVE_SPEED * run.dt)
    h.reach = h.radius + QUICK * run.dt
    h.broad = ROUND * run.cell
    return h
