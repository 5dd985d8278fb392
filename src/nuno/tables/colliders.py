"""Static and moving shapes as tables for the contact kernels."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from nuno.contact.particle.distances import FORMULAS, HULL, PLANE, SHELL_MESH, SOLID_MESH
from nuno.contact.particle.kinematic_pose import FRAMES, SLOT_SIZE
from nuno.contact.particle.shape_contact import COLUMNS
from nuno.errors import BodyStateError
from nuno.plans.recorded_launches import RecordedLaunches
from nuno.shapes import quaternion as quat
from nuno.shapes.shape import UNBOUNDED, Hull, Shape
from nuno.state.cloth_state import Shapes
from nuno.tables.hull_tables import HullTable, hull_table, put_hulls
from nuno.tables.kinematic_motion import Schedule, is_kinematic
from nuno.tables.path_batch import BatchMotion, by_frame
from nuno.tables.pose_keys import write_pose_keys

if TYPE_CHECKING:
    from nuno.bodies.body import Body

BLOCK_SIZE = 256
"""Threads of a CUDA block."""
ENDLESS = 2**30
"""Substeps of the frame in which all stand still."""


def rotation_matrices(quaternions: np.ndarray) -> np.ndarray:
    """(..., 3, 3) rotation matrices of unit quaternions (..., 4) as (w, x, y, z)."""
    w, x, y, z = np.moveaxis(np.asarray(quaternions, dtype=float), -1, 0)
    return np.stack(
        [
            np.stack([1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)], axis=-1),
            np.stack([2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)], axis=-1),
            np.stack([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)], axis=-1),
        ],
        axis=-2,
    )


class Colliders:
    """The static bodies as the kernels see them.

    A body that follows a path, or a body that does, has a slot of key poses, which `follow` sets for each run without
    making any table anew.

    Attributes:
        shapes: The Warp struct.
        count: Number of shapes.
        keys: The keys of their bodies, in the table's order.
        kinematic: Bodies with a slot, in the slots' order.
        min_radius: The least with which any ball, capsule or other convex shape is curved [m]; 0 for those with edges.
    """

    def __init__(
        self, shapes: Shapes, keys: Sequence[str], meshes: list[Any], kinematic: Sequence[Body],
        centres: Sequence[np.ndarray], min_radius: float,
    ) -> None:  # fmt: skip
        self.shapes, self.count, self.keys = shapes, len(keys), tuple(keys)
        self.kinematic, self.min_radius = tuple(kinematic), min_radius
        self._meshes = meshes
        # (worlds, kinematic, 3) [m], where the kinematic bodies' meshes have their origins in the bodies' frames
        self._centres = np.stack(centres, axis=1) if centres else np.zeros((1, 0, 3))
        self._times = np.zeros(0)
        self._launches = RecordedLaunches(shapes.pose.device, BLOCK_SIZE)
        self._rows: dict[bytes, Any] = {}
        # keys of a path batch's bodies, their slots and rows
        self._batch: tuple[Any, ...] | None = None

    @classmethod
    def from_bodies(
        cls,
        bodies: Sequence[Body],
        world_count: int = 1,
        device: str = "cpu",
        *,
        pair_friction: Mapping[str, float] | None = None,
    ) -> Colliders:
        """Build the tables.

        Args:
            bodies: Static bodies; poses may be per world.
            world_count: Worlds in the batch.
            device: Where the tables live.
            pair_friction: By body name, a friction coefficient against the touching body that overrides the
                geometric mean.
        """
        pair_friction = pair_friction or {}
        per_world = any(_differs(body, pair_friction.get(body.name)) for body in bodies)
        worlds = world_count if per_world else 1
        meshes: list[Any] = []
        kinematic: list[Body] = []
        centres: list[np.ndarray] = []
        kinds = np.full(max(1, len(bodies)), PLANE, dtype=np.int32)
        curvature = np.full(max(1, len(bodies)), np.inf, dtype=np.float32)
        slots = np.full(max(1, len(bodies)), -1, dtype=np.int32)
        table = np.zeros((worlds, max(1, len(bodies)), COLUMNS), dtype=np.float32)
        ids = np.zeros((worlds, max(1, len(bodies))), dtype=np.uint64)
        hulls: dict[int, HullTable] = {}
        for k, body in enumerate(bodies):
            row = table[:, k]
            row[:, 15] = body.friction
            row[:, 16] = pair_friction.get(body.name, -1.0)
            position, quaternion = body.position, np.asarray(body.quaternion)
            formula, centre = body.shape.formula, np.zeros(3)
            if isinstance(body.shape, Hull) and not body.is_deformed:
                kinds[k], curvature[k] = HULL, 0.0
                hulls[k] = hull = hull_table(body.shape)
                centre, row[:, 12:15] = hull.middle, hull.half
                row[:, 18] = np.linalg.norm(row[:, 12:15], axis=1)
                position = position + quat.rotate(quaternion, centre)
            elif formula is None:
                kinds[k] = SOLID_MESH if body.is_solid else SHELL_MESH
                made, centre, row[:, 12:15] = _meshes_of(body, device)
                meshes += made
                ids[:, k] = [mesh.id for mesh in made] if len(made) > 1 else made[0].id
                row[:, 17] = 0.0 if body.is_solid else 0.5 * body.thickness
                row[:, 18] = np.linalg.norm(row[:, 12:15], axis=1)
                position = position + quat.rotate(quaternion, centre)
            else:
                kinds[k], curvature[k] = FORMULAS[body.shape.kind], formula.curvature
                row[:, 12:15], row[:, 18] = formula.sizes, formula.reach
            row[:, :3] = position
            row[:, 3:12] = rotation_matrices(quaternion).reshape(-1, 9)
            if is_kinematic(body):
                slots[k] = len(kinematic)
                kinematic.append(body)
                centres.append(np.broadcast_to(centre, (worlds, 3)))
        shapes = Shapes()
        shapes.count = len(bodies)
        shapes.stride = table.shape[1] * COLUMNS if worlds > 1 else 0
        shapes.mesh_stride = ids.shape[1] if worlds > 1 else 0
        size = max(1, len(kinematic)) * SLOT_SIZE
        shapes.pose_stride = size if worlds > 1 else 0
        shapes.kind = wp.array(kinds, dtype=int, device=device)
        shapes.table = wp.array(table.ravel(), dtype=float, device=device)
        shapes.mesh = wp.array(ids.ravel(), dtype=wp.uint64, device=device)
        put_hulls(shapes, hulls, len(bodies), device)
        shapes.slot = wp.array(slots, dtype=int, device=device)
        shapes.pose = wp.zeros(worlds * size if kinematic else 1, dtype=float, device=device)
        shapes.timing = wp.zeros(2, dtype=int, device=device)
        shapes.shape_speed = wp.zeros(worlds, dtype=float, device=device)
        keys = [body.key for body in bodies]
        return cls(shapes, keys, meshes, kinematic, centres, float(curvature.min()))

    def follow(self, schedule: Schedule) -> None:
        """Take where the kinematic bodies are during the next run; arrays keep their places on the device."""
        if not self.kinematic:
            return
        frames = len(schedule.times) // 2
        if not 1 <= frames < FRAMES:
            raise ValueError(f"a run may have 1 to {FRAMES - 1} frames, got {frames}")
        self.shapes.shape_speed.zero_()
        if slots := [self._slots[key] for key in schedule.alone if key in self._slots]:
            self._follow_alone(schedule, np.array(slots))
        for motion in schedule.path_batches:
            self._follow_batch(motion)
        self._times = schedule.times

    def _follow_alone(self, schedule: Schedule, slots: np.ndarray) -> None:
        """Take where bodies on paths of their own are: (n,) of these."""
        place = np.empty((len(slots), self._worlds, len(schedule.times), 3))
        turn = np.empty((len(slots), self._worlds, len(schedule.times), 4))
        for k, slot in enumerate(slots):
            place[k], turn[k] = schedule.alone[self.kinematic[slot].key]
        instants = np.arange(len(schedule.times))
        between = by_frame(instants, instants, np.zeros(len(instants)), schedule.times)
        for own, alike in _alike_or_not(place, turn):
            which = slice(0, 1) if alike else slice(None)
            rows = self._rows_of(slots[own])
            poses = self._on_device(place[own, which], wp.vec3d), self._on_device(turn[own, which], wp.vec4d)
            self._write_keys(*poses, between, rows)

    def _rows_of(self, slots: np.ndarray) -> Any:
        """The ``rows`` of `write_pose_keys` for bodies in some slots, one after the other; made once."""
        key = slots.tobytes()
        if key not in self._rows:
            self._rows[key] = self._on_device(np.stack([slots, np.arange(len(slots))], axis=1).astype(np.int32), int)
        return self._rows[key]

    def _follow_batch(self, motion: BatchMotion) -> None:
        """Take where the bodies of a path batch are."""
        keys = motion.path_batch.keys
        if self._batch is None or self._batch[0] is not keys:
            pairs = [(self._slots[key], row) for row, key in enumerate(keys) if key in self._slots]
            self._batch = keys, self._on_device(np.array(pairs, dtype=np.int32).reshape(-1, 2), int)
        poses = motion.path_batch.on_device(self.shapes.pose.device)
        self._write_keys(*poses, motion.by_frame, self._batch[1])

    def _write_keys(self, positions: Any, quaternions: Any, between: np.ndarray, rows: Any) -> None:
        """Write key poses of some bodies, and raise the worlds' speeds: the arguments of `write_pose_keys`."""
        self._launches.launch(
            write_pose_keys, (self._worlds, len(rows)),
            [
                positions, quaternions, self._on_device(between, wp.float64), rows, self._middles, self._bounds,
                len(self.kinematic) * SLOT_SIZE, self.shapes.pose, self.shapes.shape_speed,
            ],
        )  # fmt: skip

    def _on_device(self, values: np.ndarray, kind: Any) -> Any:
        return wp.array(np.ascontiguousarray(values), dtype=kind, device=self.shapes.pose.device, copy=False)

    @cached_property
    def _slots(self) -> dict[str, int]:
        return {body.key: slot for slot, body in enumerate(self.kinematic)}

    @cached_property
    def _worlds(self) -> int:
        return len(self.shapes.pose) // (len(self.kinematic) * SLOT_SIZE)

    @cached_property
    def _middles(self) -> Any:
        """(worlds or 1, kinematic) [m], where the bodies' meshes have their origins in the bodies' frames."""
        return self._on_device(self._centres, wp.vec3d)

    @cached_property
    def _bounds(self) -> Any:
        """Bounding radii of the kinematic bodies [m]; 0 for a plane, of which no bound is needed."""
        slots = self.shapes.slot.numpy()
        rows = np.argsort(slots)[len(slots) - len(self.kinematic) :]
        radii = self.shapes.table.numpy().reshape(-1, len(slots), COLUMNS)[0, rows, 18]
        return self._on_device(np.where(radii < UNBOUNDED, radii, 0.0), wp.float64)

    def begin(self, time: float, dt: float) -> None:
        """Be told that a launch begins at ``time`` with substeps of ``dt`` [s]."""
        if self.kinematic and len(self._times) > 1:
            starts = self._times[::2]
            first = int(np.argmin(np.abs(starts - time)))
            # at the end all stand still, for however long: that frame has no end
            span = round((starts[first + 1] - starts[first]) / dt) if first + 1 < len(starts) else ENDLESS
            self.shapes.timing.assign(np.array([first, max(1, span)], dtype=np.int32))


def _alike_or_not(place: np.ndarray, turn: np.ndarray) -> list[tuple[Any, bool]]:
    """Return which bodies (n, worlds, times, ...) are in the same place in all worlds and which are not, if any are."""
    if place.shape[1] == 1:
        return [(slice(None), False)]
    alike = (place == place[:, :1]).all(axis=(1, 2, 3)) & (turn == turn[:, :1]).all(axis=(1, 2, 3))
    return [(np.flatnonzero(own), same) for own, same in ((alike, True), (~alike, False)) if own.any()]


@lru_cache(maxsize=256)
def _rigid_mesh(shape: Shape, device: str) -> tuple[Any, np.ndarray, np.ndarray]:
    """A shape's triangles on a device about the middle of their bounding box; the middle, and the half sides."""
    return _centred(*shape.mesh(), device)


def _centred(points: np.ndarray, faces: np.ndarray, device: str) -> tuple[Any, np.ndarray, np.ndarray]:
    low, high = points.min(axis=0), points.max(axis=0)
    middle = 0.5 * (low + high)
    mesh = wp.Mesh(
        points=wp.array((points - middle).astype(np.float32), dtype=wp.vec3, device=device),
        indices=wp.array(np.asarray(faces, np.int32).ravel(), dtype=int, device=device),
    )
    return mesh, middle, 0.5 * (high - low)


def _meshes_of(body: Body, device: str) -> tuple[list[Any], np.ndarray, np.ndarray]:
    """Meshes of a body, one or one a world, their frames' origins in the body's frame and half sides, (..., 3)."""
    if len(body.faces) == 0:
        raise BodyStateError(f"{body.name!r} has neither a known shape nor faces to collide with")
    if not body.is_deformed:
        mesh, middle, half = _rigid_mesh(body.shape, device)
        return [mesh], middle, half
    points = body.local_vertices()
    made = [_centred(p, body.faces, device) for p in points.reshape(-1, *points.shape[-2:])]
    middles, halves = np.stack([m for _, m, _ in made]), np.stack([h for _, _, h in made])
    return [mesh for mesh, _, _ in made], middles if len(made) > 1 else middles[0], halves


def _differs(body: Body, pair: Any) -> bool:
    """Return True if anything about a body is given per world."""
    posed = np.ndim(body.position) == 2 or np.ndim(body.quaternion) == 2
    rubs = np.ndim(body.friction) == 1 or np.ndim(pair if pair is not None else 0.0) == 1
    curved = body.is_deformed and np.ndim(body.surface()[0]) == 3 and len(body.surface()[0]) > 1
    return posed or rubs or curved
