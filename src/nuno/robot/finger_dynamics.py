"""FingerDynamics: fingers of a robot with dynamics, on sliders with motors that press with a limited force."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.joints.joint import set_motors
from nuno.joints.joint_motion import positions_of
from nuno.materials import Rigid
from nuno.shapes import quaternion as quat
from nuno.world.make_joints import slider

if TYPE_CHECKING:
    from nuno.bodies.body import Body
    from nuno.joints.joint import Joint
    from nuno.robot.fingers import Finger
    from nuno.robot.links import Links
    from nuno.world.world import World

AHEAD = 2.2e-3
"""[m] How far ahead of where a finger is it is led when it presses with all its force: 0.13 m/s from frame to frame."""
DAMPED = 5e-3
"""[s] In which a finger's motor settles: its damping over its stiffness."""
ENDLESS = 1e3
"""[N] Force of fingers whose joint has no effort limit."""
TURNING = 0.6
"""Share of the inertia of what carries a hand that its fingers are given. They turn with it, so only the sum counts
for the motion; but the solver is slow to meet contact that would turn a light finger by itself."""
OPENS = 2e-3
"""[m] By how much a finger is wanted more open than it is where that is to open it."""
BEARS = 1e4
"""[N] Force that a finger bears across its way."""


def possible_inertia(inertia: np.ndarray, mass: float) -> np.ndarray:
    """Return the nearest inertia (3, 3) that a mass can have: positive moments, none above the sum of the others."""
    moments, axes = np.linalg.eigh(0.5 * (inertia + inertia.T))
    spread = np.maximum(0.5 * moments.sum() - moments, 1e-9 + 1e-7 * mass)
    return np.asarray(axes @ np.diag(spread.sum() - spread) @ axes.T)


class FingerDynamics:
    """The sliding fingers of a robot, as bodies of their own.

    A hand's fingers are led to where its joint is wanted, and no further beyond where they are than their effort
    takes: on what is between them they press with that force. The fingers of a hand keep to its middle together, as
    those of a linkage do.

    Args:
        links: One body for each joint and each finger.
        efforts: (n,) of the joints' motors [N m; N], infinite where there is no limit.

    Attributes:
        fingers: The fingers.
        bodies: Theirs.
        joints: Their sliders while attached.
        limits: The most that the fingers of each hand can press with [N], by its name.
        closed: Whether each hand was told to close, (worlds,) bool: it presses on what stops it until it is told to
            open, or its joint is wanted clearly more open than it is; a vector of all joints' angles as they are does
            not loosen it.
        forces: The most that the fingers of each hand press with now [N], (worlds,); the limits at first.
    """

    def __init__(self, links: Links, efforts: np.ndarray) -> None:
        self._links, self.world = links, links.world
        own = links.finger_bodies
        self.fingers: tuple[Finger, ...] = own.fingers
        self.bodies: tuple[Body, ...] = tuple(links.bodies[numbers[0]] for numbers in own.bodies)
        self.joints: tuple[Joint, ...] = ()
        limits = {finger.hand: float(efforts[finger.row] * finger.force_of_effort) for finger in self.fingers}
        self.limits = {hand: min(force, ENDLESS) for hand, force in limits.items()}
        self._loosen()
        self._turning: dict[int, np.ndarray] = {}  # by joint, what each finger is given of the inertia it carries

    def _loosen(self) -> None:
        count = self.world.world_count
        self.forces = {hand: np.full(count, most) for hand, most in self.limits.items()}
        self.closed = {hand: np.zeros(count, dtype=bool) for hand in self.limits}

    def command(self, hand: str, effort: float, closed: bool, world: int = 0) -> None:
        """Let a hand press with an effort [N] at most in one world, and as one that was told to close or to open."""
        if hand in self.limits:
            self.forces[hand][world], self.closed[hand][world] = min(effort, self.limits[hand]), closed

    def left(self, joint: int, inertia: Any) -> Any:
        """Return what is left without fingers of the inertia that a joint carries, as Pinocchio has it."""
        fingers = [finger for finger in self.fingers if finger.joint == joint]
        if not fingers:
            return inertia
        left = inertia.copy()
        for finger in fingers:
            left -= finger.inertia
        self._turning[joint] = TURNING * np.array(left.inertia) / len(fingers)
        left.inertia = (1.0 - TURNING) * np.array(left.inertia)
        return left

    def attach(self, friction: float) -> None:
        """Give the fingers dynamics where they are, as the links that carry them have theirs already."""
        world, angles = self.world, self._links.robot.angle_vector()
        made = []
        for finger, body in zip(self.fingers, self.bodies, strict=True):
            mass = max(float(finger.inertia.mass), 1e-3)
            inertia = possible_inertia(np.array(finger.inertia.inertia) + self._turning[finger.joint], mass)
            world.attach(
                body, Rigid(mass=mass, inertia=inertia, centre_of_mass=finger.inertia.lever, friction=friction)
            )
            carrier = self._links.bodies[finger.joint - 1]
            axis = quat.rotate(np.asarray(carrier.pose()[1]), finger.inward)
            position, limits = float(finger.slide(angles)), (0.0, finger.far)
            point = np.asarray(body.centre_of_mass)
            joint = slider(body, carrier, axis=axis, point=point, limits=limits, position=position, max_force=BEARS)
            made.append(joint)
        self.joints = tuple(made)

    def slides(self) -> np.ndarray:
        """Return how far the fingers of each hand are from where they are open, (worlds, k) [m], one a finger.

        The same of all of one hand, their mean.
        """
        joints, count = self.joints, len(self.joints)
        carriers: list[Any] = [joint.target for joint in joints]
        if all(joint.active for joint in joints) and all(body.is_dynamic for body in carriers):  # read at once
            places, turns, _, _ = self.world.rigid_motion([*(joint.body for joint in joints), *carriers])
            place, turn, other_place, other_turn = (
                np.stack([getattr(joint.spec, name) for joint in joints], axis=1)
                for name in ("place", "turn", "other_place", "other_turn")
            )
            own, other = (places[:, :count], turns[:, :count]), (places[:, count:], turns[:, count:])
            now = positions_of(True, _frames(own, place, turn), _frames(other, other_place, other_turn))
        else:
            now = np.stack([np.broadcast_to(joint.position, (self.world.world_count,)) for joint in joints], axis=1)
        hands = np.array([[a.hand == b.hand for b in self.fingers] for a in self.fingers], dtype=float)
        return np.asarray(now @ hands / hands.sum(axis=0))

    def lead(self, wanted: np.ndarray) -> dict[int, np.ndarray]:
        """Set the motors for a frame; return where fingers have the hands' joints, (worlds,), by the joints' places.

        Args:
            wanted: (n,) or (worlds, n), where all joints are wanted.
        """
        if not self.joints:
            return {}
        slides, forces = self.slides(), np.stack([self.forces[finger.hand] for finger in self.fingers], axis=1)
        goals = np.empty(slides.shape)
        for k, finger in enumerate(self.fingers):
            goal = finger.slide(wanted)
            presses = (goal >= finger.far) | (self.closed[finger.hand] & (goal > slides[:, k] - OPENS))
            goals[:, k] = np.where(presses, finger.far + AHEAD, goal)
        stiffness, still = forces / AHEAD, np.zeros(len(self.fingers))
        goals = np.clip(goals, slides - AHEAD, slides + AHEAD)
        set_motors(self.joints, goals, still, stiffness, DAMPED * stiffness, forces, still)
        return {finger.row: finger.angle(slides[:, k]) for k, finger in enumerate(self.fingers)}

    def imagined(self, world: World, bodies: Sequence[Body], joints: Mapping[str, Any]) -> FingerDynamics:
        """Return the same for copies in a batch, none of which was told anything yet.

        Args:
            world: The batch.
            bodies: The copies of the links' bodies.
            joints: The copies of the joints, by key.
        """
        made = copy.copy(self)
        made.world = world
        made.bodies = tuple(bodies[own[0]] for own in self._links.finger_bodies.bodies)
        made.joints = tuple(joints[joint.key] for joint in self.joints)
        made._loosen()
        return made


def _frames(
    pose: tuple[np.ndarray, np.ndarray], place: np.ndarray, turn: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """Return frames in bodies, (worlds, k, 3 or 4) each, in the world's frame."""
    return pose[0] + quat.rotate(pose[1], place), quat.multiply(pose[1], turn)
