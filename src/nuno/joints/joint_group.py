"""JointGroup: hinges and sliders of rigid bodies that are read and driven together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.errors import InvalidInputError
from nuno.joints.joint import Joint, efforts_of
from nuno.joints.joint_drives import DRIVES
from nuno.shapes import quaternion as quat

if TYPE_CHECKING:
    from nuno.bodies.body import Body

STIFFNESS = DRIVES.index("stiffness")
"""First of the columns of a motor: stiffness, damping, position, velocity and the largest effort."""


class JointGroup:
    """Hinges and sliders of one world: what each of them tells, of all at once.

    A robot's thirty joints are read in a tenth of the time that they take one by one.

    Args:
        joints: The joints, n of them, each of a dynamic body.

    Raises:
        InvalidInputError: a joint of another kind.
    """

    def __init__(self, joints: Sequence[Joint]) -> None:
        kinds = [joint.kind for joint in joints]
        if not set(kinds) <= {"hinge", "slider"}:
            raise InvalidInputError(f"a group of joints takes hinges and sliders, got {sorted(set(kinds))}")
        self.joints = tuple(joints)
        own = _dynamics_of(joints[0].body)
        self._solver, self._worlds = own.solver, own.world_count
        self._slides = np.array([kind == "slider" for kind in kinds])
        self._bodies = [joint.body for joint in joints]
        self._others = [joint.target for joint in joints]
        self._attached = [_dynamics_of(body) for body in (*self._bodies, *self._others)]
        specs = [joint.spec for joint in joints]
        self._local = self._frames(self._bodies, [(spec.place, spec.turn) for spec in specs])
        self._other_local = self._frames(self._others, [(spec.other_place, spec.other_turn) for spec in specs])

    def is_current(self) -> bool:
        """Return True if all bodies still have the dynamics that they had."""
        now = [_dynamics_of(body) for body in (*self._bodies, *self._others)]
        return all(a is b for a, b in zip(now, self._attached, strict=True))

    def read(self) -> tuple[np.ndarray, np.ndarray]:
        """Return ``Joint.position`` and ``Joint.velocity`` of all, (worlds, n) each."""
        place, turn, velocity, spin, middle = self._motion(self._bodies, self._local)
        other_place, other_turn, other_velocity, other_spin, other_middle = self._motion(
            self._others, self._other_local
        )
        turned = quat.multiply(quat.inverse(other_turn), turn)
        turned = np.where(turned[..., :1] < 0.0, -turned, turned)
        angles = 2.0 * np.arctan2(turned[..., 3], turned[..., 0])
        ways = quat.rotate(quat.inverse(other_turn), place - other_place)[..., 2]
        axis = quat.rotate(other_turn, np.broadcast_to((0.0, 0.0, 1.0), place.shape))
        at, other_at = place - middle, place - other_middle
        passing = velocity + np.cross(spin, at) - other_velocity - np.cross(other_spin, other_at)
        rate = np.where(self._slides[:, None], passing, spin - other_spin) * axis
        return np.where(self._slides, ways, angles), rate[..., 0] + rate[..., 1] + rate[..., 2]

    def efforts(self) -> np.ndarray:
        """Return ``Joint.effort`` of all, (worlds, n)."""
        return efforts_of(self.joints)

    def drive(
        self, positions: np.ndarray, velocities: np.ndarray, stiffness: np.ndarray, damping: np.ndarray,
        most: np.ndarray, effort: np.ndarray,
    ) -> None:  # fmt: skip
        """Give each joint a ``Motor``, from (n,) or (worlds, n) each.

        Raises:
            InvalidInputError: not finite, a stiffness that is not positive, or a negative damping or limit.
        """
        # not a number compares as False
        if not (np.all(stiffness > 0.0) and np.all(damping >= 0.0) and np.all(most >= 0.0)):
            raise InvalidInputError("motors need a positive stiffness, and no damping or limit may be negative")
        columns = [stiffness, damping, positions + effort / stiffness, velocities, most]
        table = np.stack([np.broadcast_to(own, (self._worlds, len(self.joints))) for own in columns], axis=-1)
        if not np.isfinite(table[..., :4]).all():
            raise InvalidInputError("motors need finite positions, velocities, gains and efforts")
        for n, joint in enumerate(self.joints):
            drives = joint.spec.drives.copy()
            drives[:, STIFFNESS : STIFFNESS + 5] = table[:, n]
            joint.spec = replace(joint.spec, drives=drives)

    def _frames(self, bodies: Sequence[Body | None], places: Sequence[Any]) -> tuple[np.ndarray, np.ndarray]:
        """Return the joints' frames in the solver's frames of bodies, (worlds, n, 3) and (worlds, n, 4)."""
        local: list[Any] = [
            (place if own is None else place - own.centre, turn)
            for own, (place, turn) in zip(map(_dynamics_of, bodies), places, strict=True)
        ]
        stacked = [
            np.stack([np.broadcast_to(own[k], (self._worlds, own[k].shape[-1])) for own in local], 1) for k in (0, 1)
        ]
        return stacked[0], stacked[1]

    def _motion(self, bodies: Sequence[Body | None], local: tuple[np.ndarray, np.ndarray]) -> tuple[np.ndarray, ...]:
        """Return place and turn of the joints' frames in the world, and velocity, spin and place of their bodies."""
        own = [_dynamics_of(body) for body in bodies]
        rows = [k for k, dynamics in enumerate(own) if dynamics is not None]
        slots = np.array([own[k].slot for k in rows], dtype=int)
        shape = (self._worlds, len(bodies))
        middle, velocity, spin = (np.zeros((*shape, 3)) for _ in range(3))
        turn = np.broadcast_to(quat.IDENTITY, (*shape, 4)).copy()
        middle[:, rows], turn[:, rows], velocity[:, rows], spin[:, rows] = self._solver.motions_of(slots)
        for k, body in enumerate(bodies):
            if body is not None and own[k] is None:
                middle[:, k], turn[:, k] = body.pose()
        return middle + quat.rotate(turn, local[0]), quat.multiply(turn, local[1]), velocity, spin, middle


def _dynamics_of(body: Body | None) -> Any:
    return None if body is None else body._dynamics
