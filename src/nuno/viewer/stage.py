"""The stage: all that is drawn of a world, and what changed since the last look."""

from __future__ import annotations

import time
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from nuno import quaternion as quat
from nuno.coordinates import Pose
from nuno.errors import InvalidInputError
from nuno.shape import Plane
from nuno.validation import count, number
from nuno.viewer.actor import Actor, light_of
from nuno.viewer.cast import Cast, Place
from nuno.viewer.marks import FRUSTUM, DrawnCamera, all_held_points, contact_arrows, frustum
from nuno.viewer.style import Styles
from nuno.viewer.wardrobe import Wardrobe

if TYPE_CHECKING:
    from nuno.simulation import Simulation

WORLDS = 9  # of a batch that are drawn side by side where nothing else is said
SHARE = 0.05  # of the time that a viewer spends on contacts, at most
UNPLACED = np.full(7, np.nan, dtype=np.float32)
BALL, SHAFT = 0.008, 0.004  # [m] radii of the marks of held points, and of arrows


class Stage:
    """What is drawn of a world.

    ``look`` takes its state in, under its lock; ``settle`` says afterwards what changed.

    Args:
        world: The world.
        styles: How bodies are drawn, and what is marked; read at each look.
        wardrobe: What is drawn in place of bodies.
        places: Which worlds are looked at, and where they are drawn.
    """

    def __init__(self, world: Simulation, styles: Styles, wardrobe: Wardrobe, places: Sequence[Place]) -> None:
        self.world, self.styles, self.wardrobe, self.places = world, styles, wardrobe, places
        self.time = 0.0
        self._casts: dict[str, Cast] = {}
        self._looked: list[Cast] = []
        self._marks: dict[tuple[str, int], Actor] = {}
        self._seen_marks: dict[tuple[str, int], np.ndarray] = {}
        self._cameras: dict[str, tuple[DrawnCamera, list[Actor]]] = {}
        self._camera_poses: list[tuple[Actor, Pose]] = []
        self._entered: list[Actor] = []
        self._left: list[int] = []
        self._contacts_due = 0.0
        self._placed: list[Actor] = []  # whose frames and offsets the next two are
        self._inner = self._offsets = np.empty((0, 7))

    @property
    def actors(self) -> list[Actor]:
        """All that is drawn."""
        cast = [actor for cast in list(self._casts.values()) for actor in cast.actors]
        frusta = [actor for _, actors in list(self._cameras.values()) for actor in actors]
        return [*cast, *list(self._marks.values()), *frusta]

    def look(self, sparing: bool = False) -> None:
        """Take the world's present state in; the caller holds its lock.

        Args:
            sparing: Leave contacts as they were while working them out would take more than a share of the time.
        """
        self.time = self.world._time
        gone = dict(self._casts)
        for body in list(self.world._bodies.values()):
            style = self.styles.of(body)
            if not style.visible:
                continue
            cast = self._casts.get(body.key)
            if cast is None or not cast.fits(style):
                cast = Cast(body, style, self.places, self.wardrobe.of(body))
                self._casts[body.key] = cast
                self._entered += cast.actors
                self._looked.append(cast)
                continue  # the one that it replaces stays among those that are gone
            gone.pop(body.key)
            if cast.look():
                self._looked.append(cast)
        for key, cast in gone.items():
            self._left += [actor.number for actor in cast.actors]
            if self._casts[key] is cast:
                del self._casts[key]
        self._look_at_marks(sparing)
        self._look_at_cameras()

    def settle(self) -> tuple[list[int], list[Actor], list[Actor]]:
        """Return the numbers of actors that left since the last time, those that entered, and those that moved."""
        self._settle_bodies()
        for key, points in self._seen_marks.items():
            self._settle_mark(key, points)
        self._seen_marks.clear()
        for actor, pose in self._camera_poses:
            actor.place(np.concatenate([pose[0] + actor.offset, pose[1]]).astype(np.float32))
        self._camera_poses.clear()
        left = self._left
        entered = [actor for actor in self._entered if actor.number not in left]
        self._entered, self._left = [], []
        new = {actor.number for actor in entered}
        moved = [actor for actor in self.actors if actor.moved]
        for actor in moved:
            actor.moved = False
        moved = [actor for actor in moved if actor.number not in new]
        return left, entered, moved

    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the lowest and the highest coordinates, (3,) [m] each, of all bodies that are drawn but planes."""
        corners = []
        for actor in [actor for cast in list(self._casts.values()) for actor in cast.actors]:
            if len(actor.points) and not actor.shape.get("endless"):
                points = actor.points.astype(float)
                if actor.pose is not None:
                    pose = actor.pose.astype(float)
                    points = pose[:3] + quat.rotate(pose[3:], points)
                corners += [points.min(axis=0), points.max(axis=0)]
        if not corners:
            return np.full(3, -0.5), np.full(3, 0.5)
        return np.min(corners, axis=0), np.max(corners, axis=0)

    def _settle_bodies(self) -> None:
        rigid = [cast for cast in self._looked if cast.is_rigid]
        actors = [actor for cast in rigid for actor in cast.actors]
        if actors:  # all at once: a robot has fifty links
            poses = [pose for cast in rigid for pose in cast.poses()]
            places, turns = np.array([pose[0] for pose in poses]), np.array([pose[1] for pose in poses])
            if actors != self._placed:  # most often those that moved before move again
                self._placed = actors
                self._inner = np.array([actor.inner for actor in actors])
                self._offsets = np.array([actor.offset for actor in actors])
            now = np.concatenate(
                [places + quat.rotate(turns, self._inner[:, :3]) + self._offsets,
                 quat.multiply(turns, self._inner[:, 3:])], axis=1,
            ).astype(np.float32)  # fmt: skip
            before = np.array([UNPLACED if actor.pose is None else actor.pose for actor in actors])
            for k in np.flatnonzero((now != before).any(axis=1)):
                actors[k].pose, actors[k].moved = now[k], True
        for cast in self._looked:
            if not cast.is_rigid:
                cast.shift()
        self._looked.clear()

    def _look_at_marks(self, sparing: bool) -> None:
        for what, wanted in (("grips", self.styles.grips), ("contacts", self.styles.contacts)):
            if not wanted:
                self._leave([key for key in self._marks if key[0] == what], self._marks)
        if self.styles.grips:
            for place in self.places:
                self._seen_marks["grips", place.index] = all_held_points(self.world, place.index) + place.offset
        start = time.perf_counter()
        if self.styles.contacts and (start >= self._contacts_due or not sparing):
            scale = self.styles.force_scale
            found = contact_arrows(self.world, scale, [place.index for place in self.places])
            for place, ends in zip(self.places, found, strict=True):
                self._seen_marks["contacts", place.index] = ends + place.offset
            now = time.perf_counter()
            self._contacts_due = now + (now - start) / SHARE

    def _leave(self, keys: list[Any], among: dict[Any, Actor]) -> None:
        self._left += [among.pop(key).number for key in keys]

    def _settle_mark(self, key: tuple[str, int], points: np.ndarray) -> None:
        actor = self._marks.get(key)
        if actor is None:
            root = next(place.root for place in self.places if place.index == key[1])
            kind, color, size = ("balls", "#d81b9b", BALL) if key[0] == "grips" else ("arrows", "#128a3a", SHAFT)
            # a path of three: no body's, whatever its name
            path = (root, "marks", key[0])
            self._marks[key] = Actor(path, kind, points, color=light_of(color), opacity=1.0, size=size)
            self._entered.append(self._marks[key])
            return
        actor.shift(points)

    def _look_at_cameras(self) -> None:
        wanted = dict(self.styles.cameras)
        for name in [n for n, (source, _) in self._cameras.items() if wanted.get(n) is not source]:
            self._left += [actor.number for actor in self._cameras.pop(name)[1]]
        for name, source in wanted.items():
            if name not in self._cameras:
                inner = None if source.carrier is None else source.pose
                actors = [
                    Actor(
                        (place.root, "cameras", name), "lines", frustum(source.camera, source.depth),
                        offset=place.offset, inner=inner,
                        color=light_of("#1f4fa0"), opacity=1.0, lines=FRUSTUM, triangles=np.empty(0, np.uint32),
                    )
                    for place in self.places
                ]  # fmt: skip
                self._cameras[name] = (source, actors)
                self._entered += actors
            for place, actor in zip(self.places, self._cameras[name][1], strict=True):
                at = source.pose
                if source.carrier is not None:
                    carried = self.world._bodies.get(source.carrier.key, source.carrier)._pose()
                    p, q = (part[place.index] if part.ndim == 2 else part for part in carried)
                    at = p + quat.rotate(q, source.pose[0]), quat.multiply(q, source.pose[1])
                self._camera_poses.append((actor, at))


def checked_places(
    world: Simulation, worlds: int | Iterable[int] | None, spacing: float | tuple[float, float] | None
) -> list[Place]:
    """Return which worlds of a batch are looked at, and where they are drawn: side by side along y, rows along -x.

    Args:
        world: The world; the caller holds its lock.
        worlds: The number of one, or of several; None is all, but at most nine.
        spacing: [m] from one to the next, one number or those of (x, y); None is a little more than what is in them.

    Raises:
        InvalidInputError: no such world.
    """
    total = world.world_count
    if worlds is None:
        chosen = list(range(min(total, WORLDS)))
    else:
        chosen = list(worlds) if isinstance(worlds, Iterable) else [worlds]
        chosen = [count("worlds", k, low=0) for k in chosen]
    if not chosen or max(chosen) >= total or len(set(chosen)) != len(chosen):
        raise InvalidInputError(f"worlds must be different numbers from 0 to {total - 1}, got {worlds!r}")
    if len(chosen) == 1:
        return [Place(chosen[0], "world" if total == 1 else f"world {chosen[0]}", np.zeros(3))]
    if spacing is None:
        bodies = [body._vertices() for body in world._bodies.values() if not isinstance(body.shape, Plane)]
        points = [vertices.reshape(-1, 3) for vertices in bodies]
        low = np.min([p.min(axis=0) for p in points], axis=0) if points else np.zeros(3)
        high = np.max([p.max(axis=0) for p in points], axis=0) if points else np.ones(3)
        along = 1.15 * (high - low)[:2] + 0.1
    else:
        pair = spacing if isinstance(spacing, tuple) else (spacing, spacing)
        along = np.array([number("spacing", step, above=0.0) for step in pair])
    columns = int(np.ceil(np.sqrt(len(chosen))))
    return [
        Place(index, f"world {index}", np.array([-(k // columns) * along[0], (k % columns) * along[1], 0.0]))
        for k, index in enumerate(chosen)
    ]
