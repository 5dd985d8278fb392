"""The tree of bodies that hinges and sliders make in MuJoCo, and the bodies' states as coordinates of its joints.

Each body hangs on the other one of its first hinge or slider by a joint of MuJoCo's own, which cannot give way. A
joint that would close a loop, or whose body air slows down, has a helper in its place, which is welded to the body and
takes a share of its mass. One that bears a limited force has a light helper, at which a bushing holds the body.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.engines.mujoco.mujoco_bushing import is_limited
from nuno.engines.world_view import attached, dynamics_of
from nuno.joints.joint import Joint
from nuno.joints.joint_motion import positions_of, velocities_of
from nuno.shapes import quaternion as quat

if TYPE_CHECKING:
    from nuno.bodies.body import Body
    from nuno.engines.world_view import EngineWorld

KINDS = ("hinge", "slider")
"""Of joints that are MuJoCo's own; the others are equality constraints."""
PARTS = ("place", "turn", "other_place", "other_turn")
"""Of a joint's frames in its two bodies."""

CARRIER = "carrier"
"""Of a body that hangs on one that follows a path, the velocity and spin (worlds, 6) that that one had, which may have
others by now."""


def is_of_tree(grip: Any) -> bool:
    """Return True if a grip is a hinge or slider."""
    return isinstance(grip, Joint) and grip.kind in KINDS


def hinges_and_sliders(world: EngineWorld) -> list[Joint]:
    """Return the hinges and sliders of a world."""
    return [grip for dynamics in attached(world) for grip in dynamics.grips if is_of_tree(grip)]


def plan_tree(world: EngineWorld) -> dict[str, Joint]:
    """Return the joint by which each body hangs in the tree, by the body's key."""
    found: dict[str, Joint] = {}
    for body in world.bodies:
        dynamics = dynamics_of(body)
        if dynamics is None or not dynamics.is_rigid or np.any(dynamics.material.air_drag):
            continue
        for grip in dynamics.grips:
            if is_of_tree(grip) and not is_limited(grip.spec) and not _is_below(grip.target, body, found):
                found[body.key] = grip
                break
    return found


def _is_below(body: Body | None, other: Body, tree: dict[str, Joint]) -> bool:
    while body is not None and body is not other:
        body = tree[body.key].target if body.key in tree else None
    return body is other


def depth_of(key: str, tree: dict[str, Joint]) -> int:
    """Return how many joints are between a body and what its tree stands on."""
    depth = 0
    while key in tree:
        target = tree[key].target
        if target is None:
            return depth + 1
        key, depth = target.key, depth + 1
    return depth


def frames_of(joint: Joint) -> tuple[bytes, ...]:
    """Return the numbers of a joint's two frames, to tell whether it is still the same."""
    return tuple(getattr(joint.spec, name).tobytes() for name in PARTS)


def rest_pose(spec: Any) -> tuple[np.ndarray, np.ndarray]:
    """Return where the body is in the other's frame as the joint is at 0, (worlds, 3) [m] and (worlds, 4)."""
    turn = quat.multiply(spec.other_turn, quat.inverse(spec.turn))
    return spec.other_place - quat.rotate(turn, spec.place), turn


def axis_of(spec: Any) -> np.ndarray:
    """Return the axis in the body's frame, (worlds, 3)."""
    return np.asarray(quat.rotate(spec.turn, np.broadcast_to((0.0, 0.0, 1.0), spec.place.shape)))


def inertias(tree: dict[str, Joint]) -> dict[Joint, np.ndarray]:
    """Return of each joint of a tree what it carries as its bodies are now, by joint, (worlds,) [kg m2; kg].

    That is the inertia about its axis of its body and all that hang on that, of a slider their mass.
    """
    axes: dict[str, tuple[Joint, np.ndarray, np.ndarray]] = {}
    found: dict[Joint, Any] = {}
    for key, joint in tree.items():
        place, turn = joint.body.pose()
        axes[key] = joint, place + quat.rotate(turn, joint.spec.place), quat.rotate(turn, axis_of(joint.spec))
        found[joint] = 0.0
    for joint in tree.values():
        dynamics: Any = dynamics_of(joint.body)
        mass, middle = np.asarray(dynamics.mass), dynamics.middle()
        turn = np.broadcast_to(joint.body.pose()[1], (len(middle), 4))
        above: str | None = joint.body.key
        while above in axes:  # it is carried by all joints above it
            carrier, point, axis = axes[above]
            if carrier.kind == "slider":
                found[carrier] = found[carrier] + mass
            else:
                local, arm = quat.rotate(quat.inverse(turn), axis), np.cross(axis, middle - point)
                about = np.einsum("wx,wxy,wy->w", local, np.broadcast_to(dynamics.inertia, (len(local), 3, 3)), local)
                found[carrier] = found[carrier] + about + mass * np.einsum("wx,wx->w", arm, arm)
            above = None if carrier.target is None else carrier.target.key
    return found


class JointStates:
    """Coordinates of joints from the bodies' states, and back.

    Args:
        world: The world.
        joints: All hinges and sliders.
        depths: (n,), of those whose body hangs by them; -1 of the others.
    """

    def __init__(self, world: EngineWorld, joints: list[Joint], depths: list[int]) -> None:
        self._world, self._joints = world, joints
        bodies: dict[Body | None, int] = {None: 0}
        for joint in joints:
            for body in (joint.body, joint.target):
                bodies.setdefault(body, len(bodies))
        self._bodies = list(bodies)
        self._own = np.array([bodies[joint.body] for joint in joints], dtype=int)
        self._other = np.array([bodies[joint.target] for joint in joints], dtype=int)
        self._frames = [np.stack([getattr(joint.spec, name) for joint in joints], axis=1) for name in PARTS]
        self.slides = np.array([joint.kind == "slider" for joint in joints])
        order = np.array(depths)
        self._levels = [np.flatnonzero(order == depth) for depth in range(1, order.max(initial=0) + 1)]

    def _motion(self, body: Body | None) -> tuple[np.ndarray, ...]:
        """Place, turn, velocity of the frame's origin, and spin, (worlds, 3 or 4) each."""
        worlds = self._world.world_count
        still = np.zeros((worlds, 3))
        if body is None:
            return still, np.tile(quat.IDENTITY, (worlds, 1)), still, still
        dynamics = dynamics_of(body)
        if dynamics is None:
            place, turn = (np.broadcast_to(part, (worlds, part.shape[-1])) for part in body.pose())
            return place, turn, *self._world.engine.velocity_at(body, place)
        values = dynamics.values
        arm = values["place"] - dynamics.middle()
        return values["place"], values["turn"], values["velocity"] + np.cross(values["spin"], arm), values["spin"]

    def _motions(self, moved: dict[str, tuple[np.ndarray, ...]]) -> list[np.ndarray]:
        own = [
            moved[body.key] if body is not None and body.key in moved else self._motion(body) for body in self._bodies
        ]
        return [np.stack(parts, axis=1) for parts in zip(*own, strict=True)]

    def carriers(self) -> dict[str, np.ndarray]:
        """Return how fast each body that follows a path went in the last step, `CARRIER`, by its key."""
        known = [(joint.target, dynamics_of(joint.body).values.get(CARRIER)) for joint in self._joints]
        return {target.key: own for target, own in known if target is not None and own is not None}

    def coordinates(self, moved: dict[str, tuple[np.ndarray, ...]]) -> tuple[np.ndarray, np.ndarray]:
        """Return positions and velocities of the joints, (worlds, n) each [rad, rad/s; m, m/s].

        Args:
            moved: By key, the place, turn, velocity and spin of static bodies that follow a path.
        """
        places, turns, velocities, spins = self._motions(moved)
        place, turn, other_place, other_turn = self._frames
        own, other = self._own, self._other
        arm, lever = quat.rotate(turns[:, own], place), quat.rotate(turns[:, other], other_place)
        frame = places[:, own] + arm, quat.multiply(turns[:, own], turn)
        its = places[:, other] + lever, quat.multiply(turns[:, other], other_turn)
        speed = (
            velocities[:, own] + np.cross(spins[:, own], arm)
            - velocities[:, other] - np.cross(spins[:, other], frame[0] - places[:, other])
        )  # fmt: skip
        spin = spins[:, own] - spins[:, other]
        return positions_of(self.slides, frame, its), velocities_of(self.slides, speed, spin, its)

    def set_bodies(
        self, positions: np.ndarray, velocities: np.ndarray, moved: dict[str, tuple[np.ndarray, ...]]
    ) -> None:  # fmt: skip
        """Set the states of all bodies that hang in the tree, from the joints'; the others' are set.

        Args:
            positions: (worlds, n) [rad; m].
            velocities: (worlds, n) [rad/s; m/s].
            moved: As of `coordinates`, after the step. It is kept with the bodies, for the next step to begin from.
        """
        for joint in self._joints:
            values = dynamics_of(joint.body).values
            values.pop(CARRIER, None)
            if joint.target is not None and joint.target.key in moved:
                values[CARRIER] = np.concatenate(moved[joint.target.key][2:], axis=-1)
        places, turns, speeds, spins = self._motions(moved)
        for rows in self._levels:
            place, turn, other_place, other_turn = (part[:, rows] for part in self._frames)
            own, other, slides = self._own[rows], self._other[rows], self.slides[rows][:, None]
            q, rate = positions[:, rows][..., None], velocities[:, rows][..., None]
            lever = quat.rotate(turns[:, other], other_place)
            frame_turn = quat.multiply(turns[:, other], other_turn)
            axis = quat.rotate(frame_turn, np.broadcast_to((0.0, 0.0, 1.0), lever.shape))
            shift = np.where(slides, q * axis, 0.0)
            half = np.where(slides, 0.0, 0.5 * q)
            none = np.zeros_like(half)
            about = np.concatenate([np.cos(half), none, none, np.sin(half)], axis=-1)
            turned = quat.multiply(quat.multiply(frame_turn, about), quat.inverse(turn))
            arm = quat.rotate(turned, place)
            spin = spins[:, other] + np.where(slides, 0.0, rate * axis)
            speed = (
                speeds[:, other] + np.cross(spins[:, other], lever + shift) + np.where(slides, rate * axis, 0.0)
                - np.cross(spin, arm)
            )  # fmt: skip
            places[:, own] = places[:, other] + lever + shift - arm
            turns[:, own], speeds[:, own], spins[:, own] = turned, speed, spin
            for k in own:
                dynamics = dynamics_of(self._bodies[k])
                values = dynamics.values
                values["place"], values["turn"], values["spin"] = (part[:, k].copy() for part in (places, turns, spins))
                values["velocity"] = speeds[:, k] + np.cross(values["spin"], dynamics.middle() - values["place"])
