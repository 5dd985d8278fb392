"""Limbs of a robot that nothing is known of but its URDF: arms, legs and heads, by the tree of joints and by names."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from nuno.robot.humanoid import Humanoid

FIRST = 2
"""Pinocchio's index of the first joint after the universe and the free one."""
HAND_REACH = 0.15
"""Of the robot's size: joints that branch, and carry none farther away than this, are a hand's wrist."""
LOW = 0.04
"""Of the robot's height: limbs that end so near to its lowest point may be legs."""
MIDDLE = 0.02
"""Of the robot's size: limbs that are no farther from its middle have no side."""
WORDS = {
    "head": {"head", "neck", "eye", "eyes", "skull", "face", "cervical"},
    "wheel": {"wheel", "caster", "rotor", "propeller", "roller"},
    "leg": {"leg", "hip", "thigh", "knee", "calf", "shank", "ankle", "foot", "sole", "haa", "hfe", "kfe", "hy", "hx"},
    "arm": {"arm", "shoulder", "elbow", "forearm", "wrist", "hand", "gripper", "finger", "palm"},
}
"""Words in names of joints and links that tell what a limb is; those that come first count before others."""
FINGERS = {"finger", "fingers", "gripper", "thumb", "pinky", "jaw", "knuckle"}
SIDES = {
    "left": {"l", "left", "fl", "lf", "rl", "lh", "hl", "bl"},
    "right": {"r", "right", "fr", "rf", "rr", "rh", "hr", "br"},
}


@dataclass(frozen=True, eq=False)
class Limb:
    """A chain of joints that ends in a hand, a foot or a head.

    Attributes:
        kind: "arm", "leg" or "head".
        side: "left", "right", or "" in the middle.
        chain: Pinocchio's indices of the joints from the base to the last that carries the end.
        own: Those of them that carry no other limb.
        beyond: Joints that the end carries: fingers, eyes.
        forward: How far ahead of the base the first of its own joints is [m].
    """

    kind: str
    side: str
    chain: tuple[int, ...]
    own: tuple[int, ...]
    beyond: tuple[int, ...]
    forward: float

    @property
    def end(self) -> int:
        """Pinocchio's index of the last joint."""
        return self.chain[-1]


def find_limbs(robot: Humanoid, points: dict[int, np.ndarray]) -> list[Limb]:
    """Return the limbs of a robot as its tree of joints, its names and its shape where it stands suggest them.

    Args:
        robot: In the posture that it is looked at in, x forward, z up.
        points: Corners of its shapes by joint, (k, 3) float each [m] in the world.
    """
    model = robot.model
    places = np.array([own.translation for own in robot.update().oMi])
    every = np.concatenate([places[1:], *points.values()])
    low, high = every.min(axis=0), every.max(axis=0)
    size = float(np.linalg.norm(np.ptp(places[1:], axis=0)))
    below = {j: [k for k in model.subtrees[j] if k != j] for j in range(1, model.njoints)}
    ends = dict.fromkeys(_end_of(model, leaf, places, below, HAND_REACH * size)
                         for leaf in range(FIRST, model.njoints) if not below[leaf])  # fmt: skip
    chains = {end: tuple(j for j in model.supports[end] if j >= FIRST) for end in ends if end >= FIRST}
    found = []
    for end, chain in chains.items():
        others = {j for other, joints in chains.items() if other != end for j in joints}
        own = tuple(j for j in chain if j not in others) or chain[-1:]
        beyond = tuple(below[end])
        shape = np.concatenate([places[[end]], *(points[j] for j in (end, *beyond) if j in points)])
        is_low = float(shape[:, 2].min() - low[2]) <= LOW * float(high[2] - low[2])
        kind = _kind(model, own, beyond, is_low and len(chains) > 1)
        if kind is not None:
            sideways = float(shape[:, 1].mean() - places[1, 1])
            side = _named_side(model, own) or _side(sideways, MIDDLE * size)
            forward = float(places[own[0], 0] - places[1, 0])
            found.append(Limb(kind, side, chain, own, beyond, forward))
    for k, limb in enumerate(found):
        if sum(own.kind == limb.kind for own in found) == 1:  # a single arm may lean to either side
            found[k] = replace(limb, side=_named_side(model, limb.own))
    return found


def tokens(names: Iterable[str]) -> set[str]:
    """Return the words in names, in small letters: "LHipYaw" has "l", "hip" and "yaw"; "rleg" has "r" and "leg" too."""
    found = set()
    limbs = set().union(*WORDS.values())
    for name in names:
        for part in re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+", name):
            word = part.lower()
            found.add(word)
            if word[0] in "lr" and word[1:] in limbs:
                found |= {word[0], word[1:]}
    return found


def _end_of(model: Any, leaf: int, places: np.ndarray, below: dict[int, list[int]], reach: float) -> int:
    """Return the joint that carries the hand, foot or head that a leaf of the tree is part of."""
    path = [j for j in model.supports[leaf] if j >= FIRST]
    for j in path:  # from the base outwards: the highest that branches within a hand's reach
        branches = sum(model.parents[k] == j for k in below[j]) > 1
        if branches and np.linalg.norm(places[below[j]] - places[j], axis=1).max() <= reach:
            return j
    while len(path) > 1 and tokens([model.names[path[-1]]]) & FINGERS:
        path.pop()
    return path[-1]


def _kind(model: Any, own: tuple[int, ...], beyond: tuple[int, ...], is_low: bool) -> str | None:
    words = tokens(model.names[j] for j in (*own, *beyond))
    for kind, known in WORDS.items():
        if words & known:
            if kind == "wheel" or (kind == "leg" and not is_low and words & WORDS["arm"]):
                return None if kind == "wheel" else "arm"
            return kind
    if is_low:
        return "leg"
    return "arm" if len(own) >= 3 else None


def _named_side(model: Any, own: tuple[int, ...]) -> str:
    words = tokens(model.names[j] for j in own)
    named = [side for side, known in SIDES.items() if words & known]
    return named[0] if len(named) == 1 else ""


def _side(sideways: float, middle: float) -> str:
    if abs(sideways) <= middle:
        return ""
    return "left" if sideways > 0.0 else "right"
