"""Limits of springs: grips and ties of points in MuJoCo that bear a limited force.

As of bushings (`nuno.engines.mujoco.mujoco_bushing`), what a spring will do at the end of a substep is worked out
before it, and where that is beyond the limit, its actuators have the limit along its direction in place of their law.
MuJoCo's own limit, of the force before the substep, would throw a light vertex to and fro.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.engines.mujoco.mujoco_bushings import CATCH_UP
from nuno.engines.mujoco.mujoco_springs import stiffness_of
from nuno.engines.world_view import dynamics_of

if TYPE_CHECKING:
    from nuno.engines.mujoco.mujoco_held import Held

KEPT = "springs"
"""Of a body's state, `Held.last` of all its limited springs (worlds, points, 6)."""


@dataclass(eq=False)
class Drawn:
    """The springs of a grip in a substep: those of some worlds' points (n,).

    Attributes:
        world, which: (n,) int, the worlds, and the points among the grip's.
        goal: (n, 3) [m], where the law draws them.
        beyond: (n, 1) bool, whether the limit counts in its place.
        given: (n, 3) [N], by the limit.
        velocity: (n, 3) [m/s], at the start.
    """

    world: np.ndarray
    which: np.ndarray
    goal: np.ndarray
    beyond: np.ndarray
    given: np.ndarray
    velocity: np.ndarray


def begin(held: Sequence[Held]) -> None:
    """Take over, before a frame, what the last substep was, as the bodies' states have it."""
    for own, values, at, shape in _kept(held):
        kept, points = values.get(KEPT), len(own.terms)
        own.first = np.zeros((shape[0], points, 6))
        if kept is not None and kept.shape == shape:
            own.first[:] = kept[:, at : at + points]
        own.last = own.first.copy()


def restart(held: Sequence[Held]) -> None:
    """Go back to the start of the frame."""
    for own in held:
        if own.first is not None:
            own.last, own.drawn = own.first.copy(), None


def end(held: Sequence[Held], batch: Any) -> None:
    """Note, after a frame, what its last substep was, in the bodies' states."""
    for own, values, at, shape in _kept(held):
        note(own, batch)
        if at == 0:
            values[KEPT] = np.zeros(shape)
        values[KEPT][:, at : at + len(own.terms)] = own.last


def _kept(held: Sequence[Held]) -> Iterator[tuple[Held, dict[str, np.ndarray], int, tuple[int, int, int]]]:
    """Yield each grip whose springs have limits, its body's state, where its points are there, and their shape."""
    limited = [own for own in held if own.is_limited_spring]
    for own in limited:
        dynamics = dynamics_of(own.grip.body)
        theirs = [other for other in limited if dynamics_of(other.grip.body) is dynamics]
        at = sum(len(other.terms) for other in theirs[: theirs.index(own)])
        total = sum(len(other.terms) for other in theirs)
        yield own, dynamics.values, at, (dynamics.world_count, total, 6)


def limit_springs(own: Held, batch: Any, before: np.ndarray, goal: np.ndarray, step: float) -> None:
    """Write the law of a grip's springs in a substep of ``step`` [s], or what the limit leaves of it.

    Args:
        own: The grip.
        batch: The batch.
        before: (n, 3) [m], where it leads its points at the start, of each world's points less their places at rest.
        goal: (n, 3) [m], at the end.
        step: [s].
    """
    note(own, batch)
    assert own.point is not None
    spec, stiffness = own.grip.spec, stiffness_of(own.grip.spec)
    world, point = np.nonzero(own.point >= 0)
    which = own.point[world, point]
    places, velocity = _sums(own, batch, "qpos", world, which), _sums(own, batch, "qvel", world, which)
    if spec.compliance == 0.0:
        left = before - places
        length = np.linalg.norm(left, axis=1, keepdims=True)
        goal = goal - left * (1.0 - np.minimum(1.0, CATCH_UP * step / np.maximum(length, 1e-12)))
    last, inverse = own.last[world, which], own.inverse[world, which, None]
    known = last.any(axis=1, keepdims=True)
    # what else acts on it, by how its velocity has changed
    load = np.where(known, (velocity - last[:, 3:]) / (step * inverse), 0.0) - last[:, :3]
    slope = step * stiffness
    force = stiffness * (goal - places) - slope * (velocity + step * inverse * load)
    force /= 1.0 + step * slope * inverse
    size = np.linalg.norm(force, axis=1, keepdims=True)
    limit = np.asarray(spec.max_force)[world, None]
    beyond = size > limit
    given = force * np.divide(limit, size, out=np.ones_like(size), where=beyond)
    law, rows = batch.expand("actuator_biasprm"), own.rows[which]
    law[world[:, None], rows, 0] = np.where(beyond, given, stiffness * goal)
    law[world[:, None], rows, 1] = np.where(beyond, 0.0, -stiffness)
    own.drawn = Drawn(world, which, goal, beyond, given, velocity)


def note(own: Held, batch: Any) -> None:
    """Note what a grip's springs did in the substep that was."""
    drawn, own.drawn = own.drawn, None
    if drawn is None:
        return
    # vertices go straight: the law is linear in where they have come to
    by_law = stiffness_of(own.grip.spec) * (drawn.goal - _sums(own, batch, "qpos", drawn.world, drawn.which))
    force = np.where(drawn.beyond, drawn.given, by_law)
    own.last[drawn.world, drawn.which] = np.concatenate([force, drawn.velocity], axis=1)


def _sums(own: Held, batch: Any, name: str, world: np.ndarray, which: np.ndarray) -> np.ndarray:
    """Return the weighted sums (n, 3) of vertices' coordinates or velocities."""
    address = (own.qpos if name == "qpos" else own.all_dof)[which]
    values = batch.bind(name)[world[:, None, None], address[..., None] + np.arange(3)]
    return np.asarray(np.einsum("pc,pcx->px", own.weights[which], values))
