"""Nuno: a simulator of deformable objects that lives inside a robot's own program."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from nuno.bodies import box, capsule, cloth_mesh, cylinder, mesh, plane, sheet, sphere
from nuno.body import Body
from nuno.camera.camera import Camera
from nuno.coordinates import Coordinates
from nuno.errors import (
    BodyStateError,
    ClothNotFoundError,
    EstimationError,
    FileFormatError,
    ImageError,
    InvalidInputError,
    MeshError,
    NunoError,
    SimulationDiverged,
    UnknownNameError,
)
from nuno.grip import Grip
from nuno.materials import Cloth, Material, Rigid, Soft
from nuno.path import Path
from nuno.shape import Box, Capsule, ClothMesh, Cylinder, Plane, Sheet, Sphere, TriangleMesh
from nuno.snapshot import Snapshot
from nuno.surface import SurfacePoints
from nuno.world import World

if TYPE_CHECKING:
    from nuno.camera.table import Table
    from nuno.estimate.case import PickCase, read_case
    from nuno.estimate.pick import estimate_pick
    from nuno.estimate.pick_result import PickResult
    from nuno.estimate.similarity import similarity

__version__ = "0.1.0"

__all__ = [
    "Body",
    "BodyStateError",
    "Box",
    "Camera",
    "Capsule",
    "Cloth",
    "ClothMesh",
    "ClothNotFoundError",
    "Coordinates",
    "Cylinder",
    "EstimationError",
    "FileFormatError",
    "Grip",
    "ImageError",
    "InvalidInputError",
    "Material",
    "MeshError",
    "NunoError",
    "Path",
    "PickCase",
    "PickResult",
    "Plane",
    "Rigid",
    "Sheet",
    "SimulationDiverged",
    "Snapshot",
    "Soft",
    "Sphere",
    "SurfacePoints",
    "Table",
    "TriangleMesh",
    "UnknownNameError",
    "World",
    "box",
    "capsule",
    "cloth_mesh",
    "cylinder",
    "estimate_pick",
    "mesh",
    "plane",
    "read_case",
    "sheet",
    "similarity",
    "sphere",
]

# Names whose modules load Warp, OpenCV and the like, and so are imported on first use.
_LAZY = {
    "PickCase": "nuno.estimate.case",
    "PickResult": "nuno.estimate.pick_result",
    "Table": "nuno.camera.table",
    "estimate_pick": "nuno.estimate.pick",
    "read_case": "nuno.estimate.case",
    "similarity": "nuno.estimate.similarity",
}


def __getattr__(name: str) -> Any:
    if name in _LAZY:
        value = getattr(import_module(_LAZY[name]), name)
        globals()[name] = value
        return value
    raise AttributeError(f"module 'nuno' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted([*__all__, "__version__"])
