"""Snapshots as files: one .npz, read without pickle, with a JSON header beside the arrays.

The header holds ``format``, ``units``, ``meshes`` (SHA-256 of each mesh's vertices and faces, by body) and
``world``, the snapshot as JSON in which {"array": name} stands for an array of the file, {"dict": {...}} for
a dict, and {"type": name, "fields": {...}} for one of the classes in ``TYPES``.
"""

from __future__ import annotations

import hashlib
import json
import os
import zipfile
from dataclasses import fields, is_dataclass, replace
from typing import Any

import numpy as np

from nuno.dynamics.push import Push
from nuno.engines.engine_table import ENGINES
from nuno.errors import FileFormatError, NunoError
from nuno.files.whole_file import replacing
from nuno.joints.grip import GripSpec
from nuno.joints.joint import JointSpec
from nuno.joints.tie import HoldSpec, TieSpec
from nuno.materials import Cloth, Rigid, Soft
from nuno.shapes import shape as shapes
from nuno.shapes import soft_shape
from nuno.shapes.compound import Compound
from nuno.shapes.path import Path
from nuno.world.rigid_layout import RigidLayout, RigidPlace
from nuno.world.snapshot import Snapshot
from nuno.world.snapshot_records import BodyRecord, DynamicsRecord, GripRecord

FORMAT = 6
READABLE = (1, 2, 3, 4, 5, FORMAT)  # 1 has no paths of bodies, 3 no clock of each world, 4 no engine, 5 no grips' loads
ORIGIN = 3
"""The first format that says what the places of moving rigid bodies are relative to."""
UNITS = {"length": "m", "mass": "kg", "time": "s", "force": "N", "quaternion": "wxyz", "up": "+z"}


def _kinds_of(root: Any) -> list[Any]:
    """Return the classes below one, at any depth."""
    return [each for kind in root.__subclasses__() for each in (kind, *_kinds_of(kind))]


GRIPS = (GripSpec, TieSpec, HoldSpec, JointSpec)
TYPES: dict[str, Any] = {
    kind.__name__: kind
    for kind in (
        *_kinds_of(shapes.Shape), Compound, *GRIPS, Cloth, Soft, Rigid, Path, Push, DynamicsRecord, BodyRecord,
        GripRecord, RigidLayout, RigidPlace, Snapshot,
    )
}  # fmt: skip


def write_snapshot(snapshot: Snapshot, path: str | os.PathLike[str]) -> None:
    """Write a snapshot; a file that is there is replaced at once, so that none is ever half written."""
    arrays: dict[str, np.ndarray] = {}
    header = {
        "format": FORMAT,
        "units": UNITS,
        "meshes": {body.key: mesh_hash(body.shape) for body in snapshot.bodies},
        "world": _encoded(snapshot, arrays),
    }
    with replacing(path) as partial, open(partial, "wb") as stream:
        np.savez(stream, header=np.array(json.dumps(header)), **arrays)  # type: ignore[arg-type]


def read_snapshot(path: str | os.PathLike[str]) -> Snapshot:
    """Read a snapshot.

    Raises:
        FileFormatError: no such file, damaged, no snapshot, or of an unknown or newer format.
    """
    try:
        with np.load(path, allow_pickle=False) as file:
            arrays = {name: file[name] for name in file.files}
        header = json.loads(str(arrays["header"][()]))
        version = header["format"]
    except (
        OSError,
        ValueError,
        KeyError,
        TypeError,
        EOFError,
        MemoryError,  # an array that claims to be larger than the machine
        IndexError,
        AttributeError,
        zipfile.BadZipFile,
    ) as error:
        why = "it is no .npz file" if "allow_pickle" in str(error) else error  # numpy advises to load it unsafely
        raise FileFormatError(f"cannot read {os.fspath(path)!r} as a saved world: {why}") from error
    if version not in READABLE:
        raise FileFormatError(
            f"{os.fspath(path)!r} has the format {version!r}; this version of nuno reads formats 1 to {FORMAT}"
        )
    try:
        snapshot = _decoded(header["world"], arrays)
        meshes = header["meshes"]
        if not isinstance(snapshot, Snapshot):
            raise TypeError("the header holds no world")
        if snapshot.engine not in ENGINES:
            raise TypeError(f"its states are of an engine {snapshot.engine!r} that is not known")
        moving = [body.name for body in snapshot.bodies if body.dynamics and isinstance(body.dynamics.material, Rigid)]
        if version < ORIGIN and moving:
            raise FileFormatError(
                f"{os.fspath(path)!r} has the format {version}, which does not say where the rigid bodies "
                f"{', '.join(map(repr, moving))} are; make the world anew, and save it with this version of nuno"
            )
        for body in snapshot.bodies:
            if meshes[body.key] != mesh_hash(body.shape):
                raise FileFormatError(f"the mesh of {body.name!r} in {os.fspath(path)!r} does not match its hash")
    except FileFormatError:
        raise
    except (KeyError, TypeError, ValueError, AttributeError, NunoError) as error:
        raise FileFormatError(f"{os.fspath(path)!r} is damaged: {error}") from error
    return replace(snapshot, from_file=True)


def mesh_hash(shape: shapes.Shape) -> str:
    """Return the SHA-256 of a shape's vertices and faces, or tetrahedra, as they were given."""
    if isinstance(shape, shapes.TriangleMesh | soft_shape.SoftMesh):
        vertices, faces = shape.vertices, shape.faces
    elif isinstance(shape, soft_shape.SoftTetrahedra):
        vertices, faces = shape.vertices, shape.tets
    elif getattr(shape, "tetrahedraliser", None) == soft_shape.FITTED:
        # relaxed vertices may differ in the last digit from one machine to another
        sizes = [getattr(shape, name) for name in ("radius", "height", "cell") if hasattr(shape, name)]
        vertices, faces = np.array(sizes), np.zeros((0, 3))
    else:
        vertices, faces = shape.mesh()
    digest = hashlib.sha256(np.ascontiguousarray(vertices, dtype="<f8").tobytes())
    digest.update(np.ascontiguousarray(faces, dtype="<i4").tobytes())
    return digest.hexdigest()


def _encoded(value: Any, arrays: dict[str, np.ndarray]) -> Any:
    if isinstance(value, np.ndarray):
        name = f"array_{len(arrays)}"
        arrays[name] = value
        return {"array": name}
    if is_dataclass(value) and not isinstance(value, type):
        kept = [f.name for f in fields(value) if f.init and f.metadata.get("file", True)]
        items = {name: _encoded(getattr(value, name), arrays) for name in kept}
        return {"type": type(value).__name__, "fields": items}
    if isinstance(value, tuple | list):
        return [_encoded(item, arrays) for item in value]
    if isinstance(value, dict):
        return {"dict": {name: _encoded(item, arrays) for name, item in value.items()}}
    return value.item() if isinstance(value, np.generic) else value


def _decoded(value: Any, arrays: dict[str, np.ndarray]) -> Any:
    if isinstance(value, list):
        return tuple(_decoded(item, arrays) for item in value)
    if not isinstance(value, dict):
        return value
    if "array" in value:
        return arrays[value["array"]]
    if "dict" in value:
        return {name: _decoded(item, arrays) for name, item in value["dict"].items()}
    if value.get("type") not in TYPES:
        raise FileFormatError(f"the file holds an unknown kind of object, {value.get('type')!r}")
    return TYPES[value["type"]](**{name: _decoded(item, arrays) for name, item in value["fields"].items()})
