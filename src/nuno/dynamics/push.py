"""Pushes: forces on a body's vertices, or on a rigid body and about it, for a while or until told otherwise."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from nuno.bodies.shape_topology import vertex_shares
from nuno.errors import InvalidInputError
from nuno.validation import finite_array, number

if TYPE_CHECKING:
    from nuno.bodies.body import Body
    from nuno.bodies.body_protocols import WorldSettings


@dataclass(frozen=True, eq=False)
class Push:
    """A force on a body's vertices.

    Attributes:
        force: (worlds, n, 3) float32 [N]; of a rigid body (worlds, 6): force, and torque [N m], at the centre of mass.
        end: The world's time [s] at which it ends, or None.
    """

    force: np.ndarray
    end: float | None


def make_push(body: Body, force: ArrayLike, torque: Any, duration: float | None, world: WorldSettings) -> Push:
    """Return a push from now on; see ``World.push``.

    Raises:
        InvalidInputError: a force or torque that is not finite or of another shape, a torque on a body that is not
            rigid, or a duration that is not positive.
    """
    worlds = world.world_count
    end = None if duration is None else world.time + number("duration", duration, above=0.0)
    if body._dynamics is not None and body._dynamics.is_rigid:
        pair = [
            np.broadcast_to(finite_array(name, value, (3,), (worlds, 3)), (worlds, 3))
            for name, value in (("force", force), ("torque", np.zeros(3) if torque is None else torque))
        ]
        return Push(np.concatenate(pair, axis=1).astype(np.float32), end)
    if torque is not None:
        raise InvalidInputError(f"a torque turns rigid bodies only; {body.name!r} deforms: push its vertices")
    share = vertex_shares(body.shape)
    n = len(share)
    given = finite_array("force", force, (3,), (n, 3), (worlds, 3), (worlds, n, 3))
    if given.shape in ((3,), (worlds, 3)) and given.shape != (n, 3):
        given = given[..., None, :] * (share / share.sum())[:, None]
    return Push(np.array(np.broadcast_to(given, (worlds, n, 3)), dtype=np.float32), end)
