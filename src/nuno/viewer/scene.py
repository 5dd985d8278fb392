"""The scene: all that is drawn of a world, and what changed since the last look."""

from __future__ import annotations

import time
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.errors import InvalidInputError
from nuno.shapes import quaternion as quat
from nuno.shapes.coordinates import Pose
from nuno.shapes.shape import Plane
from nuno.validation import count, number
from nuno.viewer.body_objects import BodyObjects, Place
from nuno.viewer.marks import (
    FRUSTUM,
    DrawnCamera,
    all_held_points,
    contact_arrows,
    frustum,
    frustum_colors,
    grip_arrows,
)
from nuno.viewer.scene_object import SceneObject, light_of
from nuno.viewer.style import Styles
from nuno.viewer.vertex_values import vertex_contacts
from nuno.viewer.visual_meshes import VisualMeshes

if TYPE_CHECKING:
    from nuno.bodies.body import Body
    from nuno.world.simulation import Simulation

WORLDS = 9  # of a batch that are drawn side by side where nothing else is said
SHARE = 0.05  # of the time that a viewer spends on contacts, at most
UNPLACED = np.full(7, np.nan, dtype=np.float32)
MARK_RADIUS, SHAFT = 0.008, 0.004  # [m] radii of the marks of held points, and of arrows
MARKS = {
    "grips": ("balls", "#d81b9b", MARK_RADIUS),
    "contacts": ("arrows", "#128a3a", SHAFT),
    "grip forces": ("arrows", "#c2410c", SHAFT),
}


class Scene:
    """The scene: all that is drawn of a world.

    ``look`` takes its state in, under its lock; ``settle`` says afterwards what changed.

    Args:
        world: The world.
        styles: How bodies are drawn, and what is marked; read at each look.
        visual_meshes: What is drawn in place of bodies.
        places: Which worlds are looked at, and where they are drawn.
    """

    def __init__(self, world: Simulation, styles: Styles, visual_meshes: VisualMeshes, places: Sequence[Place]) -> None:
        self.world, self.styles, self.visual_meshes, self.places = world, styles, visual_meshes, places
        self.time = 0.0
        self._body_objects: dict[str, BodyObjects] = {}
        self._looked: list[BodyObjects] = []
        self._marks: dict[tuple[str, int], SceneObject] = {}
        self._seen_marks: dict[tuple[str, int], np.ndarray] = {}
        self._cameras: dict[str, tuple[DrawnCamera, list[SceneObject]]] = {}
        self._camera_poses: list[tuple[SceneObject, Pose]] = []
        self._entered: list[SceneObject] = []
        self._left: list[int] = []
        self._contacts_due = 0.0
        self._values_due: dict[str, float] = {}  # of contact forces at vertices, by body
        self._contact_values: dict[str, np.ndarray] = {}
        self._placed: list[SceneObject] = []  # whose frames and offsets the next two are
        self._inner = self._offsets = np.empty((0, 7))

    @property
    def objects(self) -> list[SceneObject]:
        """Return all that is drawn."""
        body_objects = [obj for body_objects in list(self._body_objects.values()) for obj in body_objects.objects]
        frusta = [obj for _, objects in list(self._cameras.values()) for obj in objects]
        return [*body_objects, *list(self._marks.values()), *frusta]

    def look(self, sparing: bool = False) -> None:
        """Take the world's present state in; the caller holds its lock.

        Args:
            sparing: Leave contacts as they were while working them out would take more than a share of the time.
        """
        self.time = self.world._time
        left = dict(self._body_objects)
        for body in list(self.world._bodies.values()):
            style = self.styles.of(body)
            if not style.visible:
                continue
            body_objects = self._body_objects.get(body.key)
            if style.color_by == "contact":
                self._look_at_contact_values(body, sparing)
            if body_objects is None or not body_objects.fits(style):
                shown = self.visual_meshes.of(body)
                body_objects = BodyObjects(body, style, self.places, shown, self.styles.edges)
                self._body_objects[body.key] = body_objects
                self._entered += body_objects.objects
                self._looked.append(body_objects)
                continue  # the one that it replaces stays among those that are gone
            left.pop(body.key)
            if body_objects.look():
                self._looked.append(body_objects)
        for key, body_objects in left.items():
            self._left += [obj.number for obj in body_objects.objects]
            if self._body_objects[key] is body_objects:
                del self._body_objects[key]
        self._look_at_marks(sparing)
        self._look_at_cameras()

    def settle(self) -> tuple[list[int], list[SceneObject], list[SceneObject], list[SceneObject]]:
        """Return what changed since the last time.

        Returns:
            The numbers of the scene objects that left; those that entered, that moved, and whose colours changed.
        """
        self._settle_bodies()
        for key, points in self._seen_marks.items():
            self._settle_mark(key, points)
        self._seen_marks.clear()
        for obj, pose in self._camera_poses:
            obj.place(np.concatenate([pose[0] + obj.offset, pose[1]]).astype(np.float32))
        self._camera_poses.clear()
        left = self._left
        entered = [obj for obj in self._entered if obj.number not in left]
        self._entered, self._left = [], []
        new = {obj.number for obj in entered}
        moved = [obj for obj in self.objects if obj.moved]
        for obj in moved:
            obj.moved = False
        moved = [obj for obj in moved if obj.number not in new]
        recolored = [obj for obj in self.objects if obj.recolored]
        for obj in recolored:
            obj.recolored = False
        return left, entered, moved, [obj for obj in recolored if obj.number not in new]

    def body_of(self, number: int) -> tuple[Body, int] | None:
        """Return the body that a scene object shows, and the world that it is in; None where it shows none."""
        for body_objects in list(self._body_objects.values()):
            for obj, index in zip(body_objects.objects, body_objects.indices, strict=True):
                if obj.number == number:
                    return body_objects.body, index
        return None

    def numbers_of(self, body: Body, index: int) -> list[int]:
        """Return the numbers of the scene objects that show a body in one world."""
        found = self._body_objects.get(body.key)
        if found is None:
            return []
        return [obj.number for obj, k in zip(found.objects, found.indices, strict=True) if k == index]

    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the lowest and the highest coordinates, (3,) [m] each, of all bodies that are drawn but planes."""
        corners = []
        for obj in [obj for body_objects in list(self._body_objects.values()) for obj in body_objects.objects]:
            if len(obj.points) and not obj.shape.get("endless"):
                points = obj.points.astype(float)
                if obj.pose is not None:
                    pose = obj.pose.astype(float)
                    points = pose[:3] + quat.rotate(pose[3:], points)
                corners += [points.min(axis=0), points.max(axis=0)]
        if not corners:
            return np.full(3, -0.5), np.full(3, 0.5)
        return np.min(corners, axis=0), np.max(corners, axis=0)

    def _settle_bodies(self) -> None:
        rigid = [body_objects for body_objects in self._looked if body_objects.is_rigid]
        objects = [obj for body_objects in rigid for obj in body_objects.objects]
        if objects:  # all at once: a robot has fifty links
            poses = [pose for body_objects in rigid for pose in body_objects.poses()]
            places, turns = np.array([pose[0] for pose in poses]), np.array([pose[1] for pose in poses])
            if objects != self._placed:  # most often those that moved before move again
                self._placed = objects
                self._inner = np.array([obj.inner for obj in objects])
                self._offsets = np.array([obj.offset for obj in objects])
            now = np.concatenate(
                [places + quat.rotate(turns, self._inner[:, :3]) + self._offsets,
                 quat.multiply(turns, self._inner[:, 3:])], axis=1,
            ).astype(np.float32)  # fmt: skip
            before = np.array([UNPLACED if obj.pose is None else obj.pose for obj in objects])
            for k in np.flatnonzero((now != before).any(axis=1)):
                objects[k].pose, objects[k].moved = now[k], True
        for body_objects in self._looked:
            if not body_objects.is_rigid:
                body_objects.shift()
            if body_objects.style.color_by != "contact":
                body_objects.tint()
        for key, values in self._contact_values.items():
            if key in self._body_objects:
                self._body_objects[key].tint(values)
        self._looked.clear()
        self._contact_values.clear()

    def _look_at_contact_values(self, body: Body, sparing: bool) -> None:
        start = time.perf_counter()
        if start >= self._values_due.get(body.key, 0.0) or not sparing:
            self._contact_values[body.key] = vertex_contacts(self.world, body)
            now = time.perf_counter()
            self._values_due[body.key] = now + (now - start) / SHARE

    def _look_at_marks(self, sparing: bool) -> None:
        for what, wanted in (
            ("grips", self.styles.grips), ("contacts", self.styles.contacts), ("grip forces", self.styles.grip_forces),
        ):  # fmt: skip
            if not wanted:
                self._leave([key for key in self._marks if key[0] == what], self._marks)
        if self.styles.grips:
            for place in self.places:
                self._seen_marks["grips", place.index] = all_held_points(self.world, place.index) + place.offset
        start = time.perf_counter()
        arrows = {"contacts": contact_arrows, "grip forces": grip_arrows}
        wanted_arrows = [
            what
            for what, wanted in (("contacts", self.styles.contacts), ("grip forces", self.styles.grip_forces))
            if wanted
        ]
        if wanted_arrows and (start >= self._contacts_due or not sparing):
            indices = [place.index for place in self.places]
            for what in wanted_arrows:
                found = arrows[what](self.world, self.styles.force_scale, indices)
                for place, ends in zip(self.places, found, strict=True):
                    self._seen_marks[what, place.index] = ends + place.offset
            now = time.perf_counter()
            self._contacts_due = now + (now - start) / SHARE

    def _leave(self, keys: list[Any], among: dict[Any, SceneObject]) -> None:
        self._left += [among.pop(key).number for key in keys]

    def _settle_mark(self, key: tuple[str, int], points: np.ndarray) -> None:
        obj = self._marks.get(key)
        if obj is None:
            root = next(place.root for place in self.places if place.index == key[1])
            kind, color, size = MARKS[key[0]]
            # a path of three: no body's, whatever its name
            path = (root, "marks", key[0])
            self._marks[key] = SceneObject(path, kind, points, color=light_of(color), opacity=1.0, size=size)
            self._entered.append(self._marks[key])
            return
        obj.shift(points)

    def _look_at_cameras(self) -> None:
        wanted = dict(self.styles.cameras)
        for name in [n for n, (source, _) in self._cameras.items() if wanted.get(n) is not source]:
            self._left += [obj.number for obj in self._cameras.pop(name)[1]]
        for name, source in wanted.items():
            if name not in self._cameras:
                inner = None if source.carrier is None else source.pose
                objects = [
                    SceneObject(
                        (place.root, "cameras", name), "lines", frustum(source.camera, source.depth),
                        offset=place.offset, inner=inner,
                        color=light_of("#1f4fa0"), opacity=1.0, lines=FRUSTUM, triangles=np.empty(0, np.uint32),
                    )
                    for place in self.places
                ]  # fmt: skip
                for obj in objects:
                    obj.colors = frustum_colors()
                self._cameras[name] = (source, objects)
                self._entered += objects
            for place, obj in zip(self.places, self._cameras[name][1], strict=True):
                at = source.pose
                if source.carrier is not None:
                    carried = self.world._bodies.get(source.carrier.key, source.carrier).pose()
                    p, q = (part[place.index] if part.ndim == 2 else part for part in carried)
                    at = p + quat.rotate(q, source.pose[0]), quat.multiply(q, source.pose[1])
                self._camera_poses.append((obj, at))


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
