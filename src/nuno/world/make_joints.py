"""Making joints of rigid bodies: one function for each kind."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from nuno.bodies.body import Body
from nuno.errors import BodyStateError, InvalidInputError
from nuno.joints.joint import Joint, JointSpec
from nuno.joints.joint_drives import (
    Motor,
    Spring,
    drive_table,
    friction_drives,
    limit_drives,
    motor_drives,
    spring_drives,
)
from nuno.joints.tie import force_limit
from nuno.shapes import quaternion as quat
from nuno.shapes.coordinates import compose, invert
from nuno.validation import checked, finite_array
from nuno.world.simulation import Simulation


@checked
def hinge(
    a: Body, b: Body | None, *, point: ArrayLike, axis: ArrayLike, limits: Any = None, friction: Any = 0.0,
    motor: Motor | None = None, spring: Spring | None = None, max_force: Any = None, contact: bool = False,
    position: Any = 0.0,
) -> Joint:  # fmt: skip
    """Join a rigid body to another so that it turns about an axis, from now on: a door, a lid, a clothes-peg.

    Its ``position`` [rad] is 0 as the two are now, or what is given. It grows as ``a`` turns anticlockwise about
    ``axis`` against ``b``.
    ``friction``, ``limits``, ``motor`` and ``spring`` may be changed at any time.

    Args:
        a: A dynamic rigid body.
        b: Another, a static body, which may move, or None: the world.
        point: (3,) or (worlds, 3) [m], where the axis is, in the world's frame.
        axis: (3,) or (worlds, 3), its direction in the world's frame.
        limits: (lower, upper) [rad], each a number or (worlds,), within -pi and pi; None lets it turn round and round.
        friction: The torque [N m] up to which it sticks, and that brakes it as it turns, a number or (worlds,).
        motor: A motor, or None.
        spring: A spring, or None.
        max_force: [N], the most that it bears, and of turns as much [N m]; None is 10 kN, or 1,000 m/s2 times the mass
            of the heavier body.
        contact: Whether ``a`` and ``b`` touch each other.
        position: What its position is now [rad], a number or (worlds,) within -pi and pi.

    Raises:
        BodyStateError: ``a`` is static or in no world, or ``b`` is not in the same.
        InvalidInputError: a body that deforms, the same body twice, or a value that cannot be used.
    """
    values = {**limit_drives("hinge", limits), **friction_drives("hinge", friction), **motor_drives("hinge", motor),
              **spring_drives("hinge", spring)}  # fmt: skip
    return _join("hinge", a, b, point, axis, values, max_force, contact, position)


@checked
def slider(
    a: Body, b: Body | None, *, axis: ArrayLike, point: ArrayLike | None = None, limits: Any = None,
    friction: Any = 0.0, motor: Motor | None = None, spring: Spring | None = None, max_force: Any = None,
    contact: bool = False, position: Any = 0.0,
) -> Joint:  # fmt: skip
    """Join a rigid body to another so that it slides along an axis and does not turn, from now on: a drawer.

    Its ``position`` [m] is 0 as the two are now, or what is given. It grows as ``a`` goes along ``axis`` against ``b``.

    Args:
        a: A dynamic rigid body.
        b: Another, a static body, which may move, or None: the world.
        axis: (3,) or (worlds, 3), the direction in the world's frame.
        point: (3,) or (worlds, 3) [m], where ``wrench`` is told; None is the position of ``a``.
        limits: (lower, upper) [m], each a number or (worlds,), or None.
        friction: The force [N] up to which it sticks, and that brakes it as it slides, a number or (worlds,).
        motor: A motor, or None.
        spring: A spring, or None.
        max_force: See ``hinge``.
        contact: Whether ``a`` and ``b`` touch each other.
        position: What its position is now [m], a number or (worlds,).

    Raises:
        BodyStateError: ``a`` is static or in no world, or ``b`` is not in the same.
        InvalidInputError: a body that deforms, the same body twice, or a value that cannot be used.
    """
    values = {**limit_drives("slider", limits), **friction_drives("slider", friction), **motor_drives("slider", motor),
              **spring_drives("slider", spring)}  # fmt: skip
    return _join("slider", a, b, point, axis, values, max_force, contact, position)


@checked
def ball_joint(
    a: Body, b: Body | None, *, point: ArrayLike, limit: Any = None, axis: ArrayLike | None = None,
    friction: Any = 0.0, spring: Spring | None = None, max_force: Any = None, contact: bool = False,
) -> Joint:  # fmt: skip
    """Join a rigid body to another at a point about which it turns freely, from now on.

    Args:
        a: A dynamic rigid body.
        b: Another, a static body, which may move, or None: the world.
        point: (3,) or (worlds, 3) [m], in the world's frame.
        limit: How far [rad] ``axis`` may lean from where it is now, a number or (worlds,) below 3, or None.
        axis: (3,) or (worlds, 3), a direction of ``a`` in the world's frame; None is from the point to its position.
        friction: The torque [N m] up to which it sticks, and that brakes it as it turns, a number or (worlds,).
        spring: A spring that turns it back to where it is now, or None.
        max_force: See ``hinge``.
        contact: Whether ``a`` and ``b`` touch each other.

    Raises:
        BodyStateError: ``a`` is static or in no world, or ``b`` is not in the same.
        InvalidInputError: a body that deforms, the same body twice, or a value that cannot be used.
    """
    values = {**limit_drives("ball", limit), **friction_drives("ball", friction), **spring_drives("ball", spring)}
    return _join("ball", a, b, point, axis, values, max_force, contact)


@checked
def fixed_joint(a: Body, b: Body | None, *, max_force: Any = None, contact: bool = False) -> Joint:
    """Join a rigid body to another so that they move as one, from now on; as accurate as the other joints.

    Args:
        a: A dynamic rigid body.
        b: Another, a static body, which may move, or None: the world.
        max_force: See ``hinge``.
        contact: Whether ``a`` and ``b`` touch each other.

    Raises:
        BodyStateError: ``a`` is static or in no world, or ``b`` is not in the same.
        InvalidInputError: a body that deforms, the same body twice, or a value that cannot be used.
    """
    return _join("fixed", a, b, None, None, {}, max_force, contact)


def _join(
    kind: str, a: Body, b: Body | None, point: Any, axis: Any, values: dict[str, Any], max_force: Any, contact: bool,
    position: Any = 0.0,
) -> Joint:  # fmt: skip
    for body in (a, b):
        if not isinstance(body, Body) and not (body is None and body is b):
            raise InvalidInputError(f"a joint needs two bodies, or one and None, got {type(body).__name__}")
    world = a._world
    if not isinstance(world, Simulation):
        raise BodyStateError(f"{a.name!r} is in no world; add and attach it before it is joined")
    with world._change("join"):
        other = None if b is None else world._own(b)
        if other is a:
            raise InvalidInputError(f"{a.name!r} cannot be joined to itself")
        for body in (a, other):
            if body is not None and body._dynamics is not None and not body._dynamics.is_rigid:
                raise InvalidInputError(f"{body.name!r} deforms; weld or grip its points instead")
        if not a.is_dynamic:
            raise BodyStateError(f"{a.name!r} is static; attach it before it is joined, or give the other body first")
        worlds = world.world_count
        pose = tuple(np.broadcast_to(p, (worlds, p.shape[-1])) for p in a.pose())
        place = pose[0] if point is None else _rows("point", point, worlds)
        if axis is None:
            axis = (0.0, 0.0, 1.0)
            if kind == "ball":
                axis = np.where(np.linalg.norm(pose[0] - place, axis=1, keepdims=True) > 1e-9, pose[0] - place, axis)
        direction = _rows("axis", axis, worlds)
        if (np.linalg.norm(direction, axis=1) < 1e-9).any():
            raise InvalidInputError(f"axis must be a direction (3,) of some length, got {axis!r}")
        frame = (place, _frames(direction))
        local = compose(invert(a.pose()), frame)
        others = frame if other is None else compose(invert(other.pose()), frame)
        place, turn, other_place, other_turn = (
            np.array(np.broadcast_to(p, (worlds, p.shape[-1]))) for p in (*local, *others)
        )
        at = np.broadcast_to(finite_array("position", position, (), (worlds,)), (worlds,))
        if kind == "hinge":
            if (np.abs(at) > np.pi).any():
                raise InvalidInputError(f"a hinge's position must lie within -pi and pi, got {position!r}")
            about = np.zeros((worlds, 4))
            about[:, 0], about[:, 3] = np.cos(0.5 * at), np.sin(0.5 * at)
            turn = np.where(at[:, None] == 0.0, turn, quat.multiply(turn, about))
        elif at.any():  # a slider's other place is that much further back
            along = quat.rotate(other_turn, np.broadcast_to((0.0, 0.0, 1.0), (worlds, 3)))
            other_place = other_place - at[:, None] * along
        ignored = () if contact or other is None else (other.key,)
        limit = force_limit(max_force, worlds, a, other)
        spec = JointSpec(kind, place, turn, other_place, other_turn, drive_table(worlds, values), limit, ignored)
        joint = Joint(a, spec, other)
        world._hold(joint)
    return joint


def _frames(axis: np.ndarray) -> np.ndarray:
    """Turns (worlds, 4) that bring the z axis to directions (worlds, 3)."""
    z = axis / np.linalg.norm(axis, axis=1, keepdims=True)
    cosine = z[:, 2:]
    turn = np.concatenate([1.0 + cosine, -z[:, 1:2], z[:, :1], np.zeros_like(cosine)], axis=1)
    turn = np.where(cosine < -1.0 + 1e-9, (0.0, 1.0, 0.0, 0.0), turn)
    return turn / np.linalg.norm(turn, axis=1, keepdims=True)


def _rows(name: str, value: Any, worlds: int) -> np.ndarray:
    return np.broadcast_to(finite_array(name, value, (3,), (worlds, 3)), (worlds, 3))
