"""Ridges: the sharp edges of rigid bodies, and the axes of round ones, which meet edges of cloth and soft bodies."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nuno.rigid.convex import BOX_PART, CYLINDER_PART, HULL
from nuno.rigid.convex_parts import RigidPart
from nuno.shapes import quaternion

CREASED = 0.05
"""Sine of the angle between the normals of two faces from which on they meet in a sharp edge, 3 degrees: across what is
flatter a chord cuts by a fortieth of half its length."""


@dataclass(frozen=True, eq=False)
class Ridges:
    """Straight lines that may stand through between the vertices of another body.

    Attributes:
        start, end: (k, 3) float [m].
        left, right: (k, 3) float, the outward normals of the faces beside each; zero where it is the axis of what is
            round.
        radius: (k,) float [m], how far that reaches about it.
        depth: (k,) float [m], half the thickness of what it belongs to: what is deeper behind it has come in elsewhere.
    """

    start: np.ndarray
    end: np.ndarray
    left: np.ndarray
    right: np.ndarray
    radius: np.ndarray
    depth: np.ndarray

    def placed(self, position: np.ndarray, turn: np.ndarray) -> Ridges:
        """Return them where their frame stands at a position [m], turned by a quaternion."""
        start, end = (position + quaternion.rotate(turn, x) for x in (self.start, self.end))
        left, right = (quaternion.rotate(turn, n) for n in (self.left, self.right))
        return Ridges(start, end, left, right, self.radius, self.depth)

    @classmethod
    def joined(cls, each: list[Ridges]) -> Ridges:
        """Return those of several as one."""
        names = ("start", "end", "left", "right", "radius", "depth")
        return cls(*(np.concatenate([getattr(one, name) for one in each]) for name in names))


def ridges_of(part: RigidPart, rim_points: int) -> Ridges:
    """Return the ridges of a convex part, in its own frame; of a sphere or capsule, none: they touch others as spheres.

    Args:
        part: A part of a rigid body that moves.
        rim_points: Corners that stand for a cylinder's rim.
    """
    if part.kind == BOX_PART:
        return _box_ridges(part.half)
    if part.kind == CYLINDER_PART:
        return _cylinder_ridges(float(part.half[0]), float(part.half[1]), rim_points)
    if part.kind == HULL:
        return _hull_ridges(part)
    return _ridges_of(np.zeros((0, 2, 3)), np.zeros((0, 2, 3)), 0.0)


def _ridges_of(ends: np.ndarray, normals: np.ndarray, depth: float) -> Ridges:
    """Ridges of ends (k, 2, 3) and normals (k, 2, 3)."""
    count = len(ends)
    return Ridges(ends[:, 0], ends[:, 1], normals[:, 0], normals[:, 1], np.zeros(count), np.full(count, depth))


def _box_ridges(half: np.ndarray) -> Ridges:
    ends, normals = [], []
    for along in range(3):
        first, second = (along + 1) % 3, (along + 2) % 3
        for one in (-1.0, 1.0):
            for other in (-1.0, 1.0):
                n = np.zeros((2, 3))
                n[0, first], n[1, second] = one, other
                side = np.zeros((2, 3))
                side[:, along] = -1.0, 1.0
                ends.append((side + n.sum(axis=0)) * half)
                normals.append(n)
    return _ridges_of(np.array(ends), np.array(normals), float(half.min()))


def _cylinder_ridges(radius: float, half_height: float, rim_points: int) -> Ridges:
    """The rims as polygons, and the axis with its mantle."""
    angle = np.arange(rim_points) * (2.0 * np.pi / rim_points)
    rim = np.stack([np.cos(angle) * radius, np.sin(angle) * radius, np.zeros(rim_points)], axis=-1)
    middle = angle + np.pi / rim_points
    out = np.stack([np.cos(middle), np.sin(middle), np.zeros(rim_points)], axis=-1)
    each = []
    for side in (-1.0, 1.0):
        up = np.array([0.0, 0.0, side])
        ring = rim + half_height * up
        ends = np.stack([ring, np.roll(ring, -1, axis=0)], axis=1)
        normals = np.stack([np.broadcast_to(up, out.shape), out], axis=1)
        each.append(_ridges_of(ends, normals, min(radius, half_height)))
    tip, none = np.array([[0.0, 0.0, half_height]]), np.zeros((1, 3))
    each.append(Ridges(-tip, tip, none, none, np.array([radius]), np.array([radius])))
    return Ridges.joined(each)


def _hull_ridges(part: RigidPart) -> Ridges:
    """The edges in which two of its faces meet at an angle; triangles of one plane are one face."""
    assert part.corners is not None and part.normals is not None
    faces: dict[tuple[int, int], list[int]] = {}
    for face, loop in enumerate(part.loops):
        for a, b in zip(loop, np.roll(loop, -1), strict=True):
            faces.setdefault((min(a, b), max(a, b)), []).append(face)
    pairs = sorted((edge, both) for edge, both in faces.items() if len(both) == 2)
    edges = np.array([edge for edge, _ in pairs], dtype=int).reshape(-1, 2)
    normals = part.normals[np.array([both for _, both in pairs], dtype=int).reshape(-1, 2)]
    creased = np.linalg.norm(np.cross(normals[:, 0], normals[:, 1]), axis=1) > CREASED
    return _ridges_of(part.corners[edges[creased]], normals[creased], float(part.half[0]))
