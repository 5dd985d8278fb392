"""A bushing: a spring and damper of all directions between two frames in MuJoCo, which bears a limited force.

By bushings a rigid body is held that gives way, slides, or whose grip, weld or joint bears a limited force, and points
of a cloth or soft body that are tied to a rigid one. Each is three actuators of how far a site is from another, and
three of how it is turned, with an affine law that the ``discrete`` integrator takes as it is at the substep's end.
MuJoCo limits each actuator by itself, before the substep. So it is worked out here what the force at the substep's end
will be, from the masses of the two bodies and from what else acted on them in the substep before. Where that is beyond
the limit, the actuators have the limit along its direction in place of their law.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from nuno.joints.joint import JointSpec
from nuno.joints.tie import MAX_FORCE, HoldSpec, TieSpec

KEPT_NUMBERS = 12
"""Of `Bushing.last`."""


def is_limited(spec: Any) -> bool:
    """Return True if a grip, weld or joint bears less than any that nothing is said of."""
    return isinstance(spec, HoldSpec | TieSpec | JointSpec) and bool(np.min(spec.max_force) < MAX_FORCE)


def is_loose(spec: Any) -> bool:
    """Return True if what holds a rigid body, or holds points to one, gives way, lets it slide, or has a limit."""
    if isinstance(spec, TieSpec) and spec.places is None:
        return False
    gives = isinstance(spec, HoldSpec | TieSpec) and spec.compliance > 0.0
    return gives or getattr(spec, "free", None) is not None or is_limited(spec)


@dataclass(eq=False)
class Linear:
    """A bushing in a substep, of places or of turns.

    Attributes:
        jacobian: (3, nv), of how fast the frames go apart along `axes` by the velocities of all coordinates.
        axes: (3, 3), as columns.
        held: (3,), 1, and 0 along a free one.
        slips: (3,) [m/s, rad/s], how fast they go apart at its start.
        drawn: (3,) [m, rad], how far the spring sees them apart.
        given: (3,) [N, N m], its force where the limit sets it.
    """

    jacobian: np.ndarray
    axes: np.ndarray
    held: np.ndarray
    slips: np.ndarray
    drawn: np.ndarray
    given: np.ndarray | None = None


@dataclass(eq=False)
class Bushing:
    """A bushing between a frame of a body and one of another.

    Attributes:
        name: Of its site and the first part of its actuators' names.
        bodies: The names of the body and the other one, "world" for none.
        frames: Places and turns (worlds, 3 or 4) of the frame in the body, and of that in the other.
        turns: Whether it holds turns, and not points alone.
        stiffness, damping: Of places [N/m], [N s/m] and turns [N m/rad], [N m s/rad].
        limit: (worlds,) [N], and of turns [N m]; None is none.
        free: (3,), the direction of the world along which the body slides; None is none.
        gives: Whether it is a spring that was asked for.
        worlds: (worlds,) bool, where it is there.
        dynamics: Of the body.
        other_moves: Whether the other one is moved by what holds the body.
        last: (worlds, 12), of the last substep the force [N], how fast the frames went apart [m/s], the torque [N m]
            and how fast they turned [rad/s], in the world's axes; zeros are nothing known.
        first: `last` of the frame before.
        linear: Of each world what the substep is made of, of places and of turns.
        site, other_site, turn_site, number: The numbers of its sites and actuators in the model.
    """

    name: str
    bodies: tuple[str, str]
    frames: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]
    turns: bool
    stiffness: np.ndarray
    damping: np.ndarray
    limit: np.ndarray | None
    free: np.ndarray | None
    gives: bool
    worlds: np.ndarray
    dynamics: Any
    other_moves: bool
    last: np.ndarray = field(default_factory=lambda: np.zeros((0, KEPT_NUMBERS)))
    first: np.ndarray = field(default_factory=lambda: np.zeros((0, KEPT_NUMBERS)))
    linear: dict[int, list[Linear]] = field(default_factory=dict)
    site: int = -1
    other_site: int = -1
    turn_site: int = -1
    number: Any = None

    @property
    def changes(self) -> bool:
        """Return True if it is followed from substep to substep: its law changes, or places do not tell its force."""
        return self.limit is not None or self.free is not None or not self.gives


def limited(
    drawn: np.ndarray, slips: np.ndarray, load: np.ndarray, inverse: np.ndarray, stiffness: np.ndarray,
    slope: np.ndarray, limit: float, step: float,
) -> np.ndarray | None:  # fmt: skip
    """Return the force (3,) of a bushing in a substep where that is its limit's; None where its law's is within it.

    Of the law f = -k (x + h v') - d v' that is f = -(1 + h (h k + d) W)^-1 (k x + (h k + d) (v + h W l)).

    Args:
        drawn: (3,), how far the spring sees the frames apart: x.
        slips: (3,), how fast they go apart: v.
        load: (3,), what else acts on the body: l.
        inverse: (3, 3), the inverse mass W.
        stiffness: (3,), k.
        slope: (3,), h k + d.
        limit: The size that the force has at most.
        step: [s], h.
    """
    matrix = np.eye(3) + step * slope[:, None] * inverse
    force = -np.linalg.solve(matrix, stiffness * drawn + slope * (slips + step * inverse @ load))
    size = float(np.linalg.norm(force))
    return None if size <= limit else np.asarray(force * (limit / size))


def inverse_mass(
    own: Bushing, kind: int, bodies: tuple[int, int], model: Any, data: Any, places: tuple[np.ndarray, np.ndarray]
) -> np.ndarray:
    """Return the inverse mass (3, 3) [1/kg], or inertia [1/(kg m2)], that a bushing feels of its bodies by themselves.

    Args:
        own: The bushing.
        kind: 0 for places, 1 for turns.
        bodies: Their numbers in the model.
        model: The model.
        data: With their frames worked out.
        places: (3,) [m] each, where it holds them.
    """
    total = np.zeros((3, 3))
    for body, place, moves in zip(bodies, places, (True, own.other_moves), strict=True):
        if not moves:
            continue
        axes = data.ximat[body].reshape(3, 3)
        spin = axes @ np.diag(1.0 / np.maximum(model.body_inertia[body], 1e-12)) @ axes.T
        if kind == 1:
            total += spin
            continue
        arm = np.cross(np.eye(3), place - data.xipos[body])  # a force f along the rows has the torques -arm f
        total += np.eye(3) / model.body_mass[body] + arm @ spin @ arm.T
    return total


def basis_of(axis: np.ndarray) -> np.ndarray:
    """Return axes (3, 3), as columns, of which the first is along a direction (3,)."""
    across = np.cross(axis, np.eye(3)[np.abs(axis).argmin()])
    across /= np.linalg.norm(across)
    return np.stack([axis, across, np.cross(axis, across)], axis=1)
