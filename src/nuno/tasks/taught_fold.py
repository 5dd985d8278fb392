"""TaughtFold: a fold as hands have shown it, in the cloth's own frame, and what it becomes on another cloth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from nuno.errors import InvalidInputError
from nuno.estimate.hand_path import HandPath
from nuno.estimate.imagined_fold import ImaginedFold, imagine_fold
from nuno.materials import Cloth
from nuno.tasks.cloth_frame import CORNERS, ClothFrame
from nuno.tasks.fold_motion import FoldMotion, bent
from nuno.validation import LONGEST_WAIT, checked, finite_array, number

if TYPE_CHECKING:
    from nuno.bodies.body import Body
    from nuno.estimate.fold_result import FoldResult
    from nuno.world.world import World

BORDER = 0.1
"""Share of a side within which a hand is taken to hold the border: what a hand in a video is off, with its radius."""
AT_A_CORNER = 0.25
"""Share of the shorter side within which a corner that was carried must end from another, to be meant for that one."""
SQUARE = 0.02
"""Sides this close to each other do not say which is the longer."""
SAME_TIME = 1e-6
"""[s] Times closer than this are one."""


@dataclass(frozen=True, eq=False)
class TaughtFold:
    """A fold of a rectangular cloth by one or two hands, each of which takes hold once.

    Attributes:
        size: (2,) float [m], sides of the cloth along u and v.
        held: (hands, 2) float, the points (u, v) that were taken, on the cloth's border.
        times: (k,) float [s], from the first hold's begin to the last one's end.
        ways: (hands, k, 3) float, places (u, v, h) of the points that are held; one that is not held yet or no more
            rests.
        releases: (hands,) float [s], when each hand lets go.
        vertices: (n, 3) float, places (u, v, h) of the cloth's vertices in the end.
        faces: (m, 3) int.
        fractions: (n, 2) float, the points (u, v) that they are.
    """

    size: np.ndarray
    held: np.ndarray
    times: np.ndarray
    ways: np.ndarray
    releases: np.ndarray
    vertices: np.ndarray = field(repr=False)
    faces: np.ndarray = field(repr=False)
    fractions: np.ndarray = field(repr=False)

    @classmethod
    def from_replay(cls, result: FoldResult) -> TaughtFold:
        """Return what a replayed video teaches: the hands' motion, and how the cloth lay in the end.

        Raises:
            InvalidInputError: a hand takes hold more than once, or not at the cloth's border.
        """
        return cls.of(result.fold, result.hands, ClothFrame(result.rectangle.corners), result.best_index)

    @classmethod
    @checked
    def from_hands(
        cls, world: World, cloth: Body, hands: Sequence[HandPath], material: Cloth, *, settle: float = 1.0,
        reach: float = 0.03,
    ) -> TaughtFold:  # fmt: skip
        """Return what hands teach that move a cloth in an imagined copy of a world.

        Args:
            world: A single world.
            cloth: A sheet in it that lies flat, static.
            hands: Their paths.
            material: What the cloth is made of.
            settle: How long it comes to rest after the hands' last time [s].
            reach: A hand that is farther than this from the cloth takes nothing [m].

        Raises:
            InvalidInputError: no hand holds, none touches the cloth, or as ``from_replay``.
            SimulationDiverged: a state stopped being finite.
        """
        frame = ClothFrame.of(cloth)
        paths = tuple(hands)
        if not paths or not all(isinstance(hand, HandPath) for hand in paths):
            raise InvalidInputError(f"hands must be one or more HandPath, got {hands!r}")
        begin = min(float(hand.times[0]) for hand in paths)
        end = max(float(hand.times[-1]) for hand in paths) + number("settle", settle, low=0.0, high=LONGEST_WAIT)
        fold = imagine_fold(world, cloth, paths, [material], begin=begin, end=end, reach=reach)
        return cls.of(fold, paths, frame)

    @classmethod
    def of(cls, fold: ImaginedFold, hands: Sequence[HandPath], frame: ClothFrame, index: int = 0) -> TaughtFold:
        """Return what an imagined fold teaches.

        Args:
            fold: The fold.
            hands: The hands that led it.
            frame: The cloth before it.
            index: Which world of it.

        Raises:
            InvalidInputError: as ``from_replay``.
        """
        holds = [hold for hold in fold.holds if hold.faces[index] >= 0]
        again = {hold.hand for hold in holds if sum(other.hand == hold.hand for other in holds) > 1}
        if not holds or again:
            said = f"hand {min(again)} takes hold more than once" if again else "no hand holds any cloth"
            raise InvalidInputError(f"each hand must take hold once to teach a fold; {said}")
        faces = np.asarray(fold.body.faces)
        before = frame.to_cloth(fold.states[0, index])
        begin = min(hold.begin for hold in holds)
        ends = [min(hold.end, float(hands[hold.hand].times[-1])) for hold in holds]
        own = np.concatenate([*(hands[hold.hand].times for hold in holds), [hold.begin for hold in holds], ends])
        times = np.unique(own[(own >= begin) & (own <= max(ends))])
        times = times[np.append(True, np.diff(times) > SAME_TIME)]
        ways, held = [], []
        for hold, end in zip(holds, ends, strict=True):
            hand = hands[hold.hand]
            point = hold.barycentric[index] @ before[faces[hold.faces[index]]]
            uv = _on_the_border(point[:2], hold.hand)
            way = frame.to_cloth(hand.at(np.clip(times, hold.begin, end)))
            ways.append(way - way[0] + (*uv, 0.0))
            held.append(uv)
        return cls(
            frame.size, np.array(held), times - begin, np.array(ways), np.array(ends) - begin,
            frame.to_cloth(fold.states[-1, index]), faces, before[:, :2],
        )  # fmt: skip

    @property
    def goals(self) -> np.ndarray:
        """(hands, 2) float, the corners (u, v) on which those that were carried are to lie: the nearest to each.

        Raises:
            InvalidInputError: the fold carries something else than corners onto corners.
        """
        found = []
        for uv in self.held:
            own = int(np.linalg.norm(self.fractions - uv, axis=1).argmin())
            away = np.linalg.norm((CORNERS - self.vertices[own, :2]) * self.size, axis=1)
            away[np.abs(CORNERS - uv).max(axis=1) < 0.5] = np.inf
            nearest = int(away.argmin())
            if np.abs(CORNERS - uv).max(axis=1).min() > 0.0 or away[nearest] > AT_A_CORNER * self.size.min():
                raise InvalidInputError(
                    f"the fold must carry corners onto corners to be squared; the point ({uv[0]:.2f}, {uv[1]:.2f}) "
                    f"ends {away[nearest]:.3f} m from the nearest other corner"
                )
            found.append(CORNERS[nearest])
        return np.array(found)

    def on(self, cloth: Body, *, forward: ArrayLike | None = None, seconds: float | None = None) -> FoldMotion:
        """Return the fold's motion on another cloth, of another size and at another place.

        Along the cloth, the ways are scaled by its sides; heights over the cloth, as the way is in the mean.

        Args:
            cloth: A sheet of a single world that lies flat.
            forward: (2,) or (3,) the horizontal direction in which the hands are to carry, such as where a robot faces;
                the fold is turned to come as near to it as the sides' lengths let it. None leaves u and v along the
                sheet's x and y.
            seconds: How long the motion takes [s]; None: as it was taught.

        Raises:
            InvalidInputError: no sheet, or it does not lie flat.
        """
        frame = ClothFrame.of(cloth, 0 if forward is None else self._quarter_turns(cloth, forward))
        times, releases = self.times, self.releases
        if seconds is not None:
            scale = number("seconds", seconds, above=0.0) / float(times[-1])
            times, releases = times * scale, releases * scale
        asked = frame.to_world(np.insert(self.held, 2, 0.0, axis=1))
        vertices = np.asarray(cloth.vertices)
        chosen = np.linalg.norm(vertices - asked[:, None], axis=-1).argmin(axis=1)
        span = self.ways[:, -1] - self.ways[:, 0]
        travel = [np.linalg.norm(span[:, :2] * size, axis=1).mean() for size in (frame.size, self.size)]
        ways = frame.to_world(bent(self.ways, height=travel[0] / max(travel[1], 1e-9)))
        ways += (vertices[chosen] - asked)[:, None]
        return FoldMotion(frame, vertices, np.asarray(cloth.faces), chosen, times, ways, releases, self)

    def _quarter_turns(self, cloth: Body, forward: ArrayLike) -> int:
        """Return which corner of a sheet is to be the first for the fold to carry forward."""
        wanted = finite_array("forward", forward, (2,), (3,))[:2]
        if np.linalg.norm(wanted) < 1e-9:
            raise InvalidInputError("forward must be a direction in the horizontal plane")
        travel = (self.ways[:, -1, :2] - self.ways[:, 0, :2]).mean(axis=0)
        best, found = -np.inf, 0
        for k in range(4):
            frame = ClothFrame.of(cloth, k)
            ratios = frame.size[0] / frame.size[1], self.size[0] / self.size[1]
            if min(abs(np.log(ratios))) > SQUARE and np.prod(np.log(ratios)) < 0.0:
                continue  # the longer side would be the shorter one
            way = travel @ frame.axes
            along = float(way[:2] @ wanted / max(np.linalg.norm(way), 1e-9))
            if along > best + 1e-6:
                best, found = along, k
        return found


def _on_the_border(uv: np.ndarray, hand: int) -> np.ndarray:
    """Return the point of the border that a hand is taken to hold."""
    near = np.abs(uv - np.round(uv)) <= BORDER
    if not near.any():
        raise InvalidInputError(
            f"hand {hand} takes the cloth at ({uv[0]:.2f}, {uv[1]:.2f}); a fold is taught by hands that take its "
            f"border, to {BORDER:.0%} of a side"
        )
    return np.clip(np.where(near, np.round(uv), uv), 0.0, 1.0)
