"""The table of convex parts on the device: rows are written when a body comes, and freed when it goes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import warp as wp

from nuno.rigid.convex import HULL, SURFACE, Parts
from nuno.rigid.convex_parts import RigidPart

RIDGE = np.radians(3.0)
"""[rad] An edge that is bent by less is taken for flat."""
POOLS = (("corner", wp.vec3), ("core", wp.vec3), ("normal", wp.vec3), ("loop_start", int), ("loop", int))


class PartTable:
    """The parts of all bodies.

    Args:
        device: Where the table lives.
        worlds: Worlds of the batch; only meshes may differ between them.
        capacity: Rows that there is room for at first.
    """

    def __init__(self, device: str, worlds: int, capacity: int) -> None:
        self.device, self.worlds = device, worlds
        self.parts = Parts()
        self.rows: list[RigidPart | None] = []
        self._meshes: dict[int, list[Any]] = {}
        self._ridges: dict[int, list[Any]] = {}
        self._pool_sizes = dict.fromkeys((name for name, _ in POOLS), 0)
        self.parts.capacity = 0
        self._grow(capacity)
        for name, kind in POOLS:
            setattr(self.parts, name, wp.zeros(64, dtype=kind, device=device))

    def add(
        self, slot: int, parts: Sequence[RigidPart], centre: np.ndarray, rows: Sequence[int] | None = None
    ) -> list[int]:
        """Write the parts of a body, whose frame's origin is at ``centre`` (3,) [m] of its shape; return their rows.

        Free ``rows`` may be given, one for each part; None takes the first free ones.
        """
        rows = [self._free_row() for _ in parts] if rows is None else self.take_rows(rows)
        for row, part in zip(rows, parts, strict=True):
            self._write(row, slot, part, centre)
        return rows

    def take_rows(self, rows: Sequence[int]) -> list[int]:
        """Take free rows; return them as a list."""
        while len(self.rows) <= max(rows, default=-1):
            self.rows.append(None)
        while len(self.rows) > self.parts.capacity:
            self._grow(2 * self.parts.capacity)
        for row in rows:
            assert self.rows[row] is None
            self.rows[row] = _TAKEN
        self.parts.count = len(self.rows)
        return list(rows)

    def set_ranks(self, rows: Sequence[int]) -> None:
        """Give parts in these rows the ranks 0, 1, 2 ..., all others later ones."""
        ranks = np.arange(self.parts.capacity, 2 * self.parts.capacity, dtype=np.int32)
        ranks[list(rows)] = np.arange(len(rows))
        self.parts.rank.assign(ranks)

    def remove(self, rows: Sequence[int]) -> None:
        """Free the rows of a body."""
        for row in rows:
            self.rows[row] = None
            self._meshes.pop(row, None)
            self._ridges.pop(row, None)
            self._put("slot", row, -1)

    def set_vertices(self, row: int, vertices: np.ndarray) -> None:
        """Move the vertices of a mesh, (n, 3) or (worlds, n, 3) [m]."""
        part = self.rows[row]
        assert part is not None and part.vertices is not None
        for mesh, points in zip(self._meshes[row], _per_world(vertices), strict=True):
            mesh.points.assign(points.astype(np.float32))
            mesh.refit()
        self._find_ridges(row, vertices)
        flat = vertices.reshape(-1, 3)
        self._put("low", row, flat.min(axis=0) - part.rim)
        self._put("high", row, flat.max(axis=0) + part.rim)

    def _free_row(self) -> int:
        for row, part in enumerate(self.rows):
            if part is None:
                self.rows[row] = _TAKEN
                return row
        self.rows.append(_TAKEN)
        if len(self.rows) > self.parts.capacity:
            self._grow(2 * self.parts.capacity)
        self.parts.count = len(self.rows)
        return len(self.rows) - 1

    def _write(self, row: int, slot: int, part: RigidPart, centre: np.ndarray) -> None:
        self.rows[row] = part
        place = (np.zeros(3) if part.position is None else part.position) - centre
        turn = np.array([1.0, 0.0, 0.0, 0.0]) if part.quaternion is None else part.quaternion
        for name, value in (
            ("slot", slot), ("rank", row), ("kind", part.kind), ("half", part.half), ("inset", part.inset),
            ("rim", part.rim), ("place", place), ("turn", np.roll(turn, -1)), ("low", part.low), ("high", part.high),
            ("radius", part.radius), ("smallest", _smallest(part)),
        ):  # fmt: skip
            self._put(name, row, value)
        if part.kind == HULL:
            assert part.corners is not None and part.cores is not None and part.normals is not None
            first = self._append("corner", part.corners)
            self._put("corners", row, (first, first + len(part.corners)))
            start = self._append("core", part.cores)
            self._put("cores", row, (start, start + len(part.cores)))
            face = self._append("normal", part.normals)
            self._put("faces", row, (face, face + len(part.normals)))
            ends = self._append("loop", np.concatenate(part.loops) + first) + np.cumsum(
                [0, *(len(loop) for loop in part.loops)]
            )
            # starts stand at the faces' own numbers; one face's end is the next one's start
            self._place("loop_start", face, ends)
        elif part.vertices is not None:
            self._make_mesh(row, part)

    def _make_mesh(self, row: int, part: RigidPart) -> None:
        assert part.vertices is not None and part.faces is not None
        indices = wp.array(part.faces.ravel(), dtype=int, device=self.device)
        self._meshes[row] = [
            wp.Mesh(points=wp.array(points.astype(np.float32), dtype=wp.vec3, device=self.device), indices=indices)
            for points in _per_world(part.vertices)
        ]
        self._point_to("mesh", row, [mesh.id for mesh in self._meshes[row]])
        self._find_ridges(row, part.vertices)

    def _find_ridges(self, row: int, vertices: np.ndarray) -> None:
        part = self.rows[row]
        assert part is not None and part.faces is not None
        found = [
            wp.array(ridges(points, part.faces, part.kind == SURFACE), dtype=int, device=self.device)
            for points in _per_world(vertices)
        ]
        self._ridges[row] = found
        self._point_to("edges", row, [array.ptr for array in found])

    def _point_to(self, name: str, row: int, addresses: list[int]) -> None:
        table = getattr(self.parts, name).reshape((self.worlds, self.parts.capacity))
        values = addresses if len(addresses) > 1 else addresses * self.worlds
        table[:, row].assign(np.array(values, dtype=np.uint64))

    def _append(self, name: str, values: np.ndarray) -> int:
        return self._place(name, self._pool_sizes[name], values)

    def _place(self, name: str, first: int, values: np.ndarray) -> int:
        array = getattr(self.parts, name)
        needed = first + len(values)
        if needed > array.shape[0]:
            wider = wp.zeros(max(needed, 2 * array.shape[0]), dtype=array.dtype, device=self.device)
            wp.copy(wider, array, count=array.shape[0])
            setattr(self.parts, name, wider)
            array = wider
        array[first:needed].assign(np.asarray(values))
        self._pool_sizes[name] = max(self._pool_sizes[name], needed)
        return first

    def _put(self, name: str, row: int, value: Any) -> None:
        array = getattr(self.parts, name)
        array[row : row + 1].assign(np.asarray(value).reshape(1, -1) if np.ndim(value) else np.array([value]))

    def _grow(self, capacity: int) -> None:
        old = self.parts.capacity
        kinds = dict(
            slot=int, rank=int, kind=int, half=wp.vec3, inset=float, rim=float, place=wp.vec3, turn=wp.quat,
            low=wp.vec3, high=wp.vec3, radius=float, smallest=float, corners=wp.vec2i, cores=wp.vec2i, faces=wp.vec2i,
        )  # fmt: skip
        for name, kind in kinds.items():
            wider = wp.zeros(capacity, dtype=kind, device=self.device)
            if name == "slot":
                wider.fill_(-1)
            if old:
                wp.copy(wider, getattr(self.parts, name), count=old)
            setattr(self.parts, name, wider)
        for name in ("mesh", "edges"):
            addresses = wp.zeros((self.worlds, capacity), dtype=wp.uint64, device=self.device)
            if old:
                wp.copy(addresses[:, :old], getattr(self.parts, name).reshape((self.worlds, old)))
            setattr(self.parts, name, addresses.flatten())
        self.parts.mesh_stride = self.parts.capacity = capacity


_TAKEN: Any = object()


def _smallest(part: RigidPart) -> float:
    """The smallest half side [m]: what distances that should be small are small against."""
    return 0.5 * float((part.high - part.low).min()) if part.vertices is None else 1.0


def ridges(vertices: np.ndarray, faces: np.ndarray, solid: bool) -> np.ndarray:
    """Return (m,) int32: bits of each face's edges (ab, bc, ca) that stick out by over `RIDGE`, or end the mesh.

    Of an open mesh an edge counts that is bent to either side.
    """
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)
    edges = np.stack([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]], axis=1).reshape(-1, 2)
    keys = np.sort(edges, axis=1).astype(np.int64)
    _, which, met = np.unique(keys[:, 0] << 32 | keys[:, 1], return_inverse=True, return_counts=True)
    order = np.argsort(which, kind="stable")
    out = met[which] != 2
    first, second = order[:-1], order[1:]
    pair = (which[first] == which[second]) & ~out[first]
    first, second = first[pair], second[pair]
    here, there = first // 3, second // 3
    opposite = faces[there, (second % 3 + 2) % 3]
    level = np.einsum("ij,ij->i", normals[here], vertices[opposite] - vertices[edges[first, 0]])
    bent = np.einsum("ij,ij->i", normals[here], normals[there]) < np.cos(RIDGE)
    creased = bent & (level < 0.0) if solid else bent
    out[first], out[second] = creased, creased
    return (out.reshape(-1, 3) * np.array([1, 2, 4])).sum(axis=1).astype(np.int32)


def _per_world(vertices: np.ndarray) -> list[np.ndarray]:
    return [vertices] if vertices.ndim == 2 else list(vertices)
