"""Fingers: parts of a hand that the model fixes, and that slide towards each other as the hand's joint closes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.errors import InvalidInputError, RobotModelError
from nuno.robot.pinocchio import pin
from nuno.robot.placement import frame_called

if TYPE_CHECKING:
    from nuno.robot.description import HandOnFrame
    from nuno.robot.robot_model import RobotModel

CLOSING = 1
"""The axis of a hand's frame along which its fingers close."""


@dataclass(frozen=True, eq=False)
class Finger:
    """A finger that slides.

    Attributes:
        hand: The hand's name.
        links: Links that it consists of.
        joint: Pinocchio's index of the joint that carries the hand.
        row: The hand's joint, by its place in ``joint_names``.
        inward: (3,) float, unit vector along which it closes, in the frame of the joint.
        grasp: The hand's description.
        inertia: Pinocchio's, of its links, in the frame of the joint.
    """

    hand: str
    links: tuple[str, ...]
    joint: int
    row: int
    inward: np.ndarray
    grasp: HandOnFrame
    inertia: Any

    @property
    def far(self) -> float:
        """Return how far it slides from where it is open until it meets the other [m]."""
        return 0.5 * self.grasp.width

    @property
    def force_of_effort(self) -> float:
        """Return how hard it presses by an effort of 1 [N/(N m); 1 for slides]: the joint does the fingers' work."""
        return abs(self.grasp.closed - self.grasp.open) / self.grasp.width

    def slide(self, angles: np.ndarray) -> np.ndarray:
        """Return how far it is from where it is open [m], by the joints' positions (n,) or (worlds, n)."""
        grasp = self.grasp
        share = (angles[..., self.row] - grasp.open) / (grasp.closed - grasp.open)
        return np.asarray(self.far * np.clip(share, 0.0, 1.0))

    def angle(self, slide: np.ndarray) -> np.ndarray:
        """Return the position of the hand's joint when the finger is so far from where it is open [m]."""
        return np.asarray(self.grasp.open + (self.grasp.closed - self.grasp.open) * slide / self.far)


def fingers_of(robot: RobotModel) -> tuple[Finger, ...]:
    """Return the fingers of all hands of a robot whose description tells them, hand by hand.

    Raises:
        InvalidInputError: fingers of a hand without a joint or width, or that another joint carries than the hand.
        RobotModelError: no link of such a name.
    """
    found, model = [], robot.model
    for name, grasp in robot.description.hands.items():
        if not grasp.fingers:
            continue
        if grasp.joint is None or grasp.width <= 0.0 or grasp.open == grasp.closed:
            raise InvalidInputError(f"the fingers of {name!r} need the joint that closes them, and how wide they open")
        frame = model.frames[robot.frame_index(name)]
        axis = frame.placement.rotation[:, CLOSING]
        for links in grasp.fingers:
            inertia, place = _inertia_and_place(robot, name, links)
            aside = float((place - frame.placement.translation) @ axis)
            if abs(aside) < 1e-6:
                raise InvalidInputError(f"the finger {links[0]!r} of {name!r} lies in the middle of the hand")
            inward = -np.sign(aside) * axis
            found.append(
                Finger(
                    name, tuple(links), int(frame.parentJoint), robot.joint_index(grasp.joint), inward, grasp, inertia
                )
            )
    return tuple(found)


def _inertia_and_place(robot: RobotModel, hand: str, links: Sequence[str]) -> tuple[Any, np.ndarray]:
    """Return the inertia of a finger's links, and its centre of mass (3,) [m] in the frame of the joint that bears it.

    Without any mass its place is the mean of the links' origins.
    """
    model = robot.model
    frame = model.frames[robot.frame_index(hand)]
    inertia, places = pin.Inertia.Zero(), []  # Pinocchio has a link's at the frame of the joint that fixes it
    for link in links:
        number = frame_called(model, link)
        if number >= model.nframes:
            raise RobotModelError(f"{robot.name!r} has no link {link!r} to be a finger of {hand!r}")
        own = model.frames[number]
        if own.parentJoint != frame.parentJoint:
            raise InvalidInputError(
                f"the finger {link!r} of {hand!r} moves with {model.names[own.parentJoint]!r}; only links that "
                f"are fixed to {model.names[frame.parentJoint]!r} slide"
            )
        for each in (own, model.frames[own.parentFrame]):
            if each.inertia.mass > 0.0:
                inertia += each.placement.act(each.inertia)
        places.append(own.placement.translation)
    return inertia, inertia.lever if inertia.mass > 0.0 else np.mean(places, axis=0)


class FingerBodies:
    """The fingers of a robot among the bodies of its links.

    Args:
        robot: The robot.
        links: Names of the links that the bodies are of.

    Attributes:
        fingers: The fingers.
        bodies: Of each finger, the numbers of its bodies.
    """

    def __init__(self, robot: RobotModel, links: Sequence[str]) -> None:
        self.fingers = fingers_of(robot)
        self.bodies = [[k for k, link in enumerate(links) if link in finger.links] for finger in self.fingers]
        pairs = [(k, finger) for finger, own in zip(self.fingers, self.bodies, strict=True) for k in own]
        self._rows = np.array([k for k, _ in pairs], dtype=int)
        self._inward = np.array([finger.inward for _, finger in pairs]).reshape(-1, 3)
        self._moved = [finger for _, finger in pairs]
        self._joints = sorted({finger.row for finger in self._moved})
        self._cached: tuple[list[float], np.ndarray] | None = None  # joints' positions, and offsets

    def offset(self, offsets: np.ndarray, angles: np.ndarray) -> np.ndarray:
        """Return where bodies are in the frames of their joints (..., n, 3) [m], from where they are with open hands.

        Args:
            offsets: (n, 3) [m], with open hands.
            angles: (dof,) of the robot's joints, or (worlds, dof).
        """
        if not self._moved:
            return offsets
        if angles.ndim > 1 and (angles[:, self._joints] == angles[0, self._joints]).all():
            angles = angles[0]  # in all worlds alike
        if angles.ndim > 1:
            all_moved = np.repeat(offsets[None], len(angles), axis=0)
            slides = np.stack([finger.slide(angles) for finger in self._moved], axis=-1)
            all_moved[:, self._rows] += slides[..., None] * self._inward
            return all_moved
        now, cached = [angles[row] for row in self._joints], self._cached
        if cached is not None and cached[0] == now:
            return cached[1]
        moved = offsets.copy()
        moved[self._rows] += np.array([finger.slide(angles) for finger in self._moved])[:, None] * self._inward
        self._cached = now, moved
        return moved

    def of_hand(self, hand: str) -> list[list[int]]:
        """Return the numbers of the bodies of each finger of a hand; empty where its fingers do not slide."""
        return [own for finger, own in zip(self.fingers, self.bodies, strict=True) if finger.hand == hand]
