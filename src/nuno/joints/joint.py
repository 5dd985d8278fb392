"""Joints of rigid bodies as handles: what they tell, and what may be changed while they hold."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from nuno.errors import BodyStateError, InvalidInputError
from nuno.joints.grip import Grip
from nuno.joints.joint_drives import (
    DRIVES,
    Motor,
    Spring,
    drive_table,
    friction_drives,
    limit_drives,
    motor_drives,
    motor_table,
    spring_drives,
)
from nuno.joints.joint_motion import positions_of, velocities_of
from nuno.shapes import quaternion as quat
from nuno.shapes.coordinates import compose

if TYPE_CHECKING:
    from nuno.bodies.body import Body
    from nuno.joints.grip import GripWorld

KINDS = ("fixed", "hinge", "slider", "ball")


@dataclass(frozen=True, eq=False)
class JointSpec:
    """A joint as the solver takes it. Its frames are the same where it was made; their z axis is the free one.

    Attributes:
        kind: One of `KINDS`.
        place: (worlds, 3) float64 [m], in the body's frame.
        turn: (worlds, 4) float64, in the body's frame.
        other_place: (worlds, 3) float64 [m], in the other body's frame or the world's.
        other_turn: (worlds, 4) float64, likewise.
        drives: (worlds, 11) float64, in the order of `DRIVES`.
        max_force: (worlds,) float64 [N], the most that it bears, and of turns [N m].
        ignored: Keys of the bodies that the first one passes through.
        compliance: [m/N].
    """

    kind: str
    place: np.ndarray
    turn: np.ndarray
    other_place: np.ndarray
    other_turn: np.ndarray
    drives: np.ndarray
    max_force: np.ndarray
    ignored: tuple[str, ...] = ()
    compliance: float = 0.0


class Joint(Grip):
    """A joint of a rigid body with another or with the world, made by ``nuno.hinge`` and its like.

    It goes with ``release``, or when one of its bodies is detached or removed.

    Attributes:
        key: The same for the copies of the joint in imagined worlds and in files.
        body: The first body.
        target: The other, or None: the world.
    """

    noun: ClassVar[str] = "joint"

    def __repr__(self) -> str:
        other = "the world" if self.target is None else repr(self.target.name)
        return f"<{self.kind} of {self.body.name!r} and {other}, {'active' if self.active else 'released'}>"

    @property
    def kind(self) -> str:
        """The kind: "fixed", "hinge", "slider" or "ball"."""
        return str(self.spec.kind)

    @property
    def position(self) -> Any:
        """Return how far ``body`` is from where the joint was made, against the other: [rad] or, of a slider, [m].

        A number, in a batch (worlds,); a hinge's is from -pi to pi. Of a ball joint the rotation vector (3,), in a
        batch (worlds, 3) [rad], in the other's frame; of a fixed joint 0.

        Raises:
            BodyStateError: the joint was released.
        """
        with self._live().lock:
            pose, other = self._poses()
            if self.kind in ("hinge", "slider"):
                return self._given(positions_of(self.kind == "slider", pose, other))
            turn = quat.multiply(quat.inverse(other[1]), pose[1])
            turn = np.where(turn[:, :1] < 0.0, -turn, turn)
            if self.kind == "ball":
                sine = np.linalg.norm(turn[:, 1:], axis=1, keepdims=True)
                angle = 2.0 * np.arctan2(sine, turn[:, :1])
                local = turn[:, 1:] * np.divide(angle, sine, out=np.full_like(sine, 2.0), where=sine > 0.0)
                found = quat.rotate(self.spec.other_turn, local)
            else:
                found = np.zeros(len(turn))
            return self._given(found)

    @property
    def velocity(self) -> Any:
        """Return the rate of ``position``, in its units a second; of a ball joint the angular velocity, in world axes.

        Raises:
            BodyStateError: the joint was released.
        """
        with self._live().lock:
            pose, other = self._poses()
            own, others = self._motion(self.body, pose[0]), self._motion(self.target, pose[0])
            if self.kind == "ball":
                return self._given(own[1] - others[1])
            if self.kind == "fixed":
                return self._given(np.zeros(len(pose[0])))
            return self._given(velocities_of(self.kind == "slider", own[0] - others[0], own[1] - others[1], other))

    @property
    def effort(self) -> Any:
        """Return what motor, spring, friction and stops do to ``body`` along the free direction, [N m] or [N].

        A number, in a batch (worlds,); the mean over the last frame, zero before the first. Of a ball joint what keeps
        it in its cone; of a fixed joint 0.

        Raises:
            BodyStateError: the joint was released.
        """
        world = self._live()
        with world.lock:
            return self._given(world.engine.effort(self))

    @property
    def limits(self) -> tuple[Any, Any]:
        """The lowest and highest position [rad] or [m], numbers or (worlds,); infinite where there is no stop.

        Of a ball joint 0 and how far its axis may lean [rad].
        """
        return self._value("lower"), self._value("upper")

    @limits.setter
    def limits(self, value: Any) -> None:
        self._set(limit_drives, value)

    @property
    def friction(self) -> Any:
        """The effort [N m] or [N] up to which it does not move, a number or (worlds,)."""
        return self._value("friction")

    @friction.setter
    def friction(self, value: Any) -> None:
        self._set(friction_drives, value)

    @property
    def motor(self) -> Motor | None:
        """The motor, or None."""
        effort = self._value("max_effort")
        if not np.any(effort):
            return None
        stiffness, damping = self._value("stiffness"), self._value("damping")
        goes = np.any(stiffness > 0.0)
        return Motor(
            self._value("velocity"), self._value("position") if goes else None, stiffness,
            None if np.any(np.isinf(damping)) else damping, effort,
        )  # fmt: skip

    @motor.setter
    def motor(self, value: Motor | None) -> None:
        self._set(motor_drives, value)

    @property
    def spring(self) -> Spring | None:
        """The spring, or None."""
        stiffness, damping = self._value("spring"), self._value("spring_damping")
        return Spring(stiffness, self._value("rest"), damping) if np.any(stiffness) or np.any(damping) else None

    @spring.setter
    def spring(self, value: Spring | None) -> None:
        self._set(spring_drives, value)

    def _live(self) -> GripWorld:
        if self._world is None:
            raise BodyStateError(f"the {self.kind} of {self.body.name!r} was released")
        return self._world

    def _given(self, values: np.ndarray) -> Any:
        if len(values) > 1:
            return values
        return values[0] if values.ndim > 1 else float(values[0])

    def _value(self, name: str) -> Any:
        column = self.spec.drives[:, DRIVES.index(name)]
        return float(column[0]) if (column == column[0]).all() else column.copy()

    def _set(self, numbers: Callable[[str, Any], dict[str, Any]], value: Any) -> None:
        world = self._live()
        _change_drives(
            world, [self], lambda: [drive_table(world.world_count, numbers(self.kind, value), self.spec.drives)]
        )

    def _poses(self) -> tuple[Any, Any]:
        """The joint's frame in the body and in the other, (worlds, 3) and (worlds, 4) each, in the world's frame."""
        spec, worlds = self.spec, self._live().world_count
        poses = []
        for body, local in (
            (self.body, (spec.place, spec.turn)), (self.target, (spec.other_place, spec.other_turn)),
        ):  # fmt: skip
            pose = local if body is None else compose(body.pose(), local)
            poses.append(tuple(np.broadcast_to(a, (worlds, a.shape[-1])) for a in pose))
        return poses[0], poses[1]

    def _motion(self, body: Body | None, point: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Velocity [m/s] of a body's point and its angular velocity [rad/s], (worlds, 3) each."""
        return self._live().engine.velocity_at(body, point)


def set_motors(
    joints: Sequence[Joint], positions: np.ndarray, velocities: np.ndarray, stiffness: np.ndarray,
    damping: np.ndarray, max_effort: np.ndarray, effort: np.ndarray,
) -> None:  # fmt: skip
    """Set motors of hinges and sliders of one world at once, as `Joint.motor` sets each; see `Motor`.

    Args:
        joints: Which.
        positions: (joints,) or (worlds, joints), as all that follow.
        velocities: Likewise.
        stiffness: Above 0.
        damping: At least 0.
        max_effort: At least 0, may be endless.
        effort: Besides what the gains ask for.

    Raises:
        InvalidInputError: a value that no motor can have.
        BodyStateError: a joint was released.
    """
    if not joints:
        return
    worlds = {joint._live() for joint in joints}
    world = worlds.pop()
    if worlds:
        raise InvalidInputError("the joints are in several worlds")
    motors = motor_table(positions, velocities, stiffness, damping, max_effort, effort)

    def drives() -> np.ndarray:
        tables = np.stack([joint.spec.drives for joint in joints])  # (joints, worlds, ...)
        for name, values in motors.items():
            tables[:, :, DRIVES.index(name)] = np.broadcast_to(values, (world.world_count, len(joints))).T
        return tables

    _change_drives(world, joints, drives)


def _change_drives(world: GripWorld, joints: Sequence[Joint], made: Callable[[], Iterable[np.ndarray]]) -> None:
    """Give joints the drives (worlds, 11) that ``made`` returns, one a joint."""
    with world._change("set on a joint"):
        for joint, drives in zip(joints, made(), strict=True):
            changed = replace(joint.spec, drives=drives)
            world.engine.allow_grip(changed, joint.target is not None and joint.target.is_dynamic)
            joint.spec = changed
            world.engine.drives_changed(joint)
