"""GLB: meshes that move, as one binary file of glTF 2.0 (Khronos, section 4.4 and 5)."""

from __future__ import annotations

import json
import struct
from dataclasses import dataclass
from typing import Any

import numpy as np

FLOAT, UNSIGNED = 5126, 5125  # component types
VERTICES, INDICES = 34962, 34963  # what a view of the buffer is for
UPRIGHT = (-(0.5**0.5), 0.0, 0.0, 0.5**0.5)  # (x, y, z, w), a quarter turn about x: z up becomes glTF's y up


@dataclass(frozen=True, eq=False)
class MovingMesh:
    """A mesh with fixed faces.

    Attributes:
        name: Its name.
        color: (3,) float in [0, 1], red, green and blue as light (linear).
        vertices: (t, n, 3) float [m], at each time, or (1, n, 3) where it stands still; z up.
        faces: (m, 3) int.
    """

    name: str
    color: np.ndarray
    vertices: np.ndarray
    faces: np.ndarray


def glb_bytes(meshes: list[MovingMesh], times: np.ndarray) -> bytes:
    """Return a GLB file of meshes that move: each frame is a morph target, one faded into the next.

    Args:
        meshes: The meshes.
        times: (t,) float [s], increasing, from 0.
    """
    file = _File()
    nodes: list[dict[str, Any]] = []
    channels: list[dict[str, Any]] = []
    samplers: list[dict[str, Any]] = []
    clock: int | None = None
    for number, mesh in enumerate(meshes):
        first = mesh.vertices[0].astype(np.float32)
        # what is added to the first frame, counted from that frame as float32 keeps it
        targets = (mesh.vertices[1:] - first).astype(np.float32)
        primitive: dict[str, Any] = {
            "attributes": {"POSITION": file.vectors(first)},
            "indices": file.indices(mesh.faces),
            "material": number,
        }
        entry: dict[str, Any] = {"name": mesh.name, "primitives": [primitive]}
        if len(targets):
            primitive["targets"] = [{"POSITION": file.vectors(target)} for target in targets]
            entry["weights"] = [0.0] * len(targets)
            if clock is None:
                clock = file.scalars(times, bounded=True)
            samplers.append({"input": clock, "interpolation": "LINEAR", "output": file.scalars(_fading(len(times)))})
            channels.append({"sampler": len(samplers) - 1, "target": {"node": number + 1, "path": "weights"}})
        file.meshes.append(entry)
        file.materials.append(_material(mesh))
        nodes.append({"name": mesh.name, "mesh": number})
    top = {"name": "world", "rotation": UPRIGHT, "children": list(range(1, len(nodes) + 1))}
    document: dict[str, Any] = {"scene": 0, "scenes": [{"nodes": [0]}], "nodes": [top, *nodes]}
    if channels:
        document["animations"] = [{"name": "recording", "samplers": samplers, "channels": channels}]
    return file.closed(document)


def _fading(count: int) -> np.ndarray:
    """Return the weights of all targets at each time: none at the first, then one after the other."""
    return np.eye(count, dtype=np.float32)[:, 1:].ravel()


def _material(mesh: MovingMesh) -> dict[str, Any]:
    color = [*(float(value) for value in mesh.color), 1.0]
    surface = {"baseColorFactor": color, "metallicFactor": 0.0, "roughnessFactor": 0.9}
    return {"name": mesh.name, "pbrMetallicRoughness": surface, "doubleSided": True}  # a cloth is seen from behind, too


class _File:
    """The binary chunk as it grows, with what describes it: views of the buffer, and accessors."""

    def __init__(self) -> None:
        self.data = bytearray()
        self.views: list[dict[str, int]] = []
        self.accessors: list[dict[str, Any]] = []
        self.meshes: list[dict[str, Any]] = []
        self.materials: list[dict[str, Any]] = []

    def vectors(self, values: np.ndarray) -> int:
        """Add (n, 3) float, as vertices or as what is added to them, and return the accessor."""
        bounds = {"min": values.min(axis=0).tolist(), "max": values.max(axis=0).tolist()}
        return self._add(values, "<f4", {"componentType": FLOAT, "type": "VEC3", **bounds}, VERTICES)

    def scalars(self, values: np.ndarray, bounded: bool = False) -> int:
        """Add (n,) float and return the accessor."""
        kept = np.asarray(values, dtype=np.float32)
        bounds = {"min": [float(kept.min())], "max": [float(kept.max())]} if bounded else {}
        return self._add(kept, "<f4", {"componentType": FLOAT, "type": "SCALAR", **bounds}, None)

    def indices(self, faces: np.ndarray) -> int:
        """Add (m, 3) int and return the accessor."""
        return self._add(faces.ravel(), "<u4", {"componentType": UNSIGNED, "type": "SCALAR"}, INDICES)

    def _add(self, values: np.ndarray, dtype: str, accessor: dict[str, Any], target: int | None) -> int:
        raw = np.ascontiguousarray(values, dtype=dtype).tobytes()
        view = {"buffer": 0, "byteOffset": len(self.data), "byteLength": len(raw)}
        self.views.append(view if target is None else {**view, "target": target})
        self.accessors.append({"bufferView": len(self.views) - 1, "count": len(values), **accessor})
        self.data += raw  # every number has four bytes: all views start on a multiple of four, as they must
        return len(self.accessors) - 1

    def closed(self, document: dict[str, Any]) -> bytes:
        """Return the file: a header and two chunks, JSON and binary."""
        whole = {
            "asset": {"version": "2.0", "generator": "nuno"}, **document, "meshes": self.meshes,
            "materials": self.materials, "accessors": self.accessors, "bufferViews": self.views,
            "buffers": [{"byteLength": len(self.data)}],
        }  # fmt: skip
        text = json.dumps(whole, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        chunks = struct.pack("<II", len(text), 0x4E4F534A) + text  # "JSON"
        chunks += struct.pack("<II", len(self.data), 0x004E4942) + bytes(self.data)  # "BIN"
        return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks
