"""LinkSweep: where a robot's links are along a motion, and where the first of them goes into something static.

Conservative advancement (Mirtich 1996; Zhang et al., "Interactive continuous collision detection for non-convex
polyhedra", The Visual Computer 22, 2006) on the signed distance of a pair: no point of a link moves farther than its
middle does, plus its turn times the radius of the ball around it; so the pair is looked at again no sooner than that
has used up the distance. Nothing thin is passed over, however fast the motion.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from nuno.robot.coal_shapes import LinkHulls
from nuno.robot.pinocchio import coal, pin

if TYPE_CHECKING:
    from nuno.bodies.body import Body
    from nuno.robot.static_shapes import Obstacle, StaticShapes

DEEP = 5e-3
"""[m] Up to which links may go into something: a hand that rests on a table, hulls that are larger than the links."""
DEEPER = 2e-3
"""[m] Likewise, beyond where it began, of a link that is in something when the motion begins."""
MIN_ADVANCE = 1e-3
"""[m] By which a pair is looked at anew at least."""


Inside = dict[tuple[int, "Body"], float]
"""By link and body, how deep [m] a link may go that is in the body already."""


class Sweep:
    """The links of a robot along a motion.

    Args:
        hulls: The links' hulls.
        times: (k,) float [s], of the world's clock.
        axes: (k, joints, 3, 3) float, of Pinocchio's joints; between two times they turn evenly.
        places: (k, joints, 3) float [m]; between two times the links' middles go straight on.
    """

    def __init__(self, hulls: LinkHulls, times: np.ndarray, axes: np.ndarray, places: np.ndarray) -> None:
        self.hulls, self.times = hulls, times
        self.axes = axes[:, hulls.joints]
        self.middles = np.einsum("klij,lj->kli", self.axes, hulls.centres) + places[:, hulls.joints]
        cosine = 0.5 * (np.einsum("klij,klij->kl", self.axes[:-1], self.axes[1:]) - 1.0)
        turns = np.arccos(np.clip(cosine, -1.0, 1.0))
        steps = np.linalg.norm(np.diff(self.middles, axis=0), axis=2) + turns * hulls.radii
        self.ways = np.concatenate([np.zeros((1, len(hulls.radii))), np.cumsum(steps, axis=0)])
        self.low = (self.middles - hulls.radii[:, None]).min(axis=0)
        self.high = (self.middles + hulls.radii[:, None]).max(axis=0)

    def pose(self, link: int, k: int, share: float) -> tuple[np.ndarray, np.ndarray]:
        """Return axes (3, 3) and middle (3,) of a link, a share of the way from the k-th time to the next."""
        axes, middle = self.axes[k, link], self.middles[k, link]
        if share == 0.0:
            return axes, middle
        turned = axes @ pin.exp3(share * pin.log3(axes.T @ self.axes[k + 1, link]))
        return turned, middle + share * (self.middles[k + 1, link] - middle)


class _Pair:
    """A link and an obstacle along a sweep."""

    def __init__(self, sweep: Sweep, link: int, obstacle: Obstacle, poses: tuple[np.ndarray, np.ndarray]) -> None:
        self.sweep, self.link, self.obstacle = sweep, link, obstacle
        self._hull = sweep.hulls.hulls[link]
        self._places, self._axes = poses
        self.way = sweep.ways[:, link]
        if len(self._places) > 1:
            cosine = 0.5 * (np.einsum("kij,kij->k", self._axes[:-1], self._axes[1:]) - 1.0)
            far = float(np.linalg.norm(obstacle.middle) + np.linalg.norm(obstacle.half))
            steps = np.linalg.norm(np.diff(self._places, axis=0), axis=1)
            steps = steps + np.arccos(np.clip(cosine, -1.0, 1.0)) * far
            self.way = self.way + np.concatenate([[0.0], np.cumsum(steps)])
        self._request, self._result = coal.DistanceRequest(), coal.DistanceResult()

    def distance(self, k: int, share: float) -> tuple[float, np.ndarray]:
        """Return how far the two are from each other [m], negative in each other, and a point (3,) between them."""
        hull = coal.Transform3s(*self.sweep.pose(self.link, k, share))
        place, axes = self._places[min(k, len(self._places) - 1)], self._axes[min(k, len(self._axes) - 1)]
        if share > 0.0 and len(self._places) > 1:
            place = place + share * (self._places[k + 1] - place)
            axes = axes @ pin.exp3(share * pin.log3(axes.T @ self._axes[k + 1]))
        best, point = np.inf, np.zeros(3)
        for part in self.obstacle.parts:
            there = coal.Transform3s(axes @ part.rotation, place + axes @ part.position)
            self._result.clear()
            found = coal.distance(self._hull, hull, part.geometry, there, self._request, self._result)
            if found < best:
                best, point = float(found), np.array(self._result.getNearestPoint1())
        return best, point

    def allowed(self, inside: Inside) -> float:
        """Return how deep [m] the link may go, deeper where it is in the obstacle already, and take note of that."""
        depth, pair = -self.distance(0, 0.0)[0], (self.link, self.obstacle.body)
        if depth > DEEP + MIN_ADVANCE:
            return inside.setdefault(pair, depth + DEEPER)
        inside.pop(pair, None)
        return DEEP if depth <= DEEP else DEEP + MIN_ADVANCE

    def entry(self, allowed: float, first: int, last: int) -> tuple[int, float, np.ndarray] | None:
        """Return after which time the link is first deeper than allowed in the obstacle, where (3,); else None.

        Between the two is the share of the way to the next time at which that is found.

        Args:
            allowed: [m].
            first: The number of the time to begin at.
            last: Of the time to end at.
        """
        at, end = float(self.way[first]), float(self.way[last])
        k = first
        while True:
            k = min(k + int(np.searchsorted(self.way[k + 1 : last + 1], at, side="right")), last)
            step = 0.0 if k == last else float(self.way[k + 1] - self.way[k])
            share = (at - float(self.way[k])) / step if step > 0.0 else 0.0
            found, point = self.distance(k, share)
            if found < -allowed:
                return (k, share, point) if share > 0.0 or k == first else (k - 1, 1.0, point)
            if at >= end:
                return None
            at = min(at + max(found + allowed, MIN_ADVANCE), end)


def first_entry(
    sweep: Sweep, shapes: StaticShapes, world: int = 0, inside: Inside | None = None
) -> tuple[int, int, Obstacle, np.ndarray] | None:
    """Return after which time a link first goes too deep into an obstacle, which, into which, and where (3,) [m].

    Between that time and the next it goes too deep. A sweep that begins later, at the same times, finds the same.

    Args:
        sweep: The sweep.
        shapes: What stands in the world.
        world: Which of a batch.
        inside: Links that are too deep in a body already, and how deep they may go [m]; kept from sweep to sweep, or
            motion after motion would go deeper and deeper.
    """
    known: Inside = {} if inside is None else inside
    best: tuple[int, int, Obstacle, np.ndarray] | None = None
    earliest, last = np.inf, len(sweep.times) - 1
    for obstacle in shapes.obstacles:
        poses = obstacle.poses(sweep.times, world)
        for link in _near(sweep, obstacle, *poses).tolist():
            pair = _Pair(sweep, link, obstacle, poses)
            allowed = pair.allowed(known)
            found = pair.entry(allowed, 0, last)
            if found is None:
                continue
            # steps fall elsewhere where a sweep begins elsewhere: each span of time by itself decides
            for own in range(max(found[0] - 1, 0), min(found[0] + 2, last)):
                if (alone := pair.entry(allowed, own, own + 1)) is not None:
                    found = alone
                    break
            k, share, point = found
            if k + share < earliest:
                best, earliest, last = (k, link, obstacle, point), k + share, min(k + 1, last)
    return best


def spare_way(sweep: Sweep, shapes: StaticShapes, world: int = 0) -> float:
    """Return how far [m] the links that moved in a sweep may move on until any may touch anything that stands."""
    moved, spare = sweep.ways[-1] > 0.0, np.inf
    if not moved.any():
        return 0.0
    last, radii = sweep.middles[-1, moved], sweep.hulls.radii[moved]
    for obstacle in shapes.obstacles:
        if obstacle.path is not None:
            return 0.0
        collides = obstacle.collides[moved]
        if not collides.any():
            continue
        places, axes = obstacle.poses(sweep.times[-1:], world)
        local = (last - places[0]) @ axes[0]
        if obstacle.is_plane:
            apart = local[:, 2]
        else:
            apart = np.linalg.norm(np.maximum(np.abs(local - obstacle.middle) - obstacle.half, 0.0), axis=1)
        spare = min(spare, float((apart - radii)[collides].min()))
    return max(spare, 0.0)


def _near(sweep: Sweep, obstacle: Obstacle, places: np.ndarray, axes: np.ndarray) -> np.ndarray:
    """Return which links may touch an obstacle, by balls and boxes around both."""
    if obstacle.is_plane:
        normals = axes[:, :, 2]
        heights = np.einsum(
            "kli,ki->kl", sweep.middles - places[:, None], np.broadcast_to(normals, (len(sweep.times), 3))
        )
        near = (heights - sweep.hulls.radii).min(axis=0) < -DEEP
        return np.flatnonzero(near & obstacle.collides)
    centres = places + np.einsum("kij,j->ki", axes, obstacle.middle)
    reach = np.einsum("kij,j->ki", np.abs(axes), obstacle.half)
    low, high = (centres - reach).min(axis=0), (centres + reach).max(axis=0)
    near = (sweep.high > low).all(axis=1) & (sweep.low < high).all(axis=1)
    return np.flatnonzero(near & obstacle.collides)
