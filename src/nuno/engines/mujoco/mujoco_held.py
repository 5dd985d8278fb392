"""A grip, a ball or a fixed joint as it is in the spec and the model of MuJoCo."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from nuno.engines.mujoco.mujoco_balls import SphericalJoint
from nuno.engines.mujoco.mujoco_blends import Blend
from nuno.engines.mujoco.mujoco_bushing import Bushing, is_limited
from nuno.joints.grip import Grip, GripSpec
from nuno.joints.tie import TieSpec


def is_spring(spec: Any) -> bool:
    """Return True if a grip's points are drawn by springs: it gives way, or its force is limited."""
    if isinstance(spec, TieSpec):
        return spec.places is None and (spec.compliance > 0.0 or is_limited(spec))
    return isinstance(spec, GripSpec) and (spec.compliance > 0.0 or spec.max_force is not None)


@dataclass(eq=False)
class Held:
    """A grip as it is in the spec.

    Attributes:
        grip: The grip.
        names: Its equalities; of one by springs its actuators.
        rows: Their numbers in the model; of actuators (points, 3).
        point: (worlds, k) int, of each held point its number among the grip's distinct points, -1 for none.
        rest: (points, 3) [m], of each distinct point its place at rest, which coordinates are counted from.
        leader: The body that leads, or None.
        address: Its first coordinate and its first velocity in the model.
        terms, others: Of one by springs, of each distinct point its own vertices with their weights, and of a tie the
            other body's, whose weights are below 0.
        weights, qpos, dof: Of the same, arrays (points, most), and where they are in the model; ``all_dof`` are those
            of the other body besides.
        inverse: (worlds, points) [1/kg], the inverse mass of each.
        last, first: (worlds, points, 6), of springs with a limit the force [N] and the velocity at the start [m/s] of
            the last substep, and of the last one of the frame before; zeros are nothing known.
        drawn: What the substep is made of.
        blends: Of a tie of points inside faces to a rigid body, these points.
        bushings: Of a loose one, its bushings.
        ball: Of a ball joint with drives, that.
    """

    grip: Grip
    names: list[str] = field(default_factory=list)
    rows: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=int))
    point: np.ndarray | None = None
    rest: np.ndarray | None = None
    leader: Any = None
    address: tuple[int, int] = (-1, -1)
    terms: list[list[tuple[int, float]]] = field(default_factory=list)
    others: list[list[tuple[int, float]]] = field(default_factory=list)
    weights: Any = None
    all_dof: Any = None
    inverse: Any = None
    last: Any = None
    first: Any = None
    drawn: Any = None
    qpos: Any = None
    dof: Any = None
    blends: list[Blend] = field(default_factory=list)
    bushings: list[Bushing] = field(default_factory=list)
    ball: SphericalJoint | None = None

    @property
    def is_limited_spring(self) -> bool:
        """Return True if its points are drawn by springs with a limit."""
        spec = self.grip.spec
        return is_spring(spec) and (is_limited(spec) if isinstance(spec, TieSpec) else spec.max_force is not None)
