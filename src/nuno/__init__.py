"""Nuno: a simulator of deformable objects that lives inside a robot's own program."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from nuno.bodies import (
    box,
    capsule,
    cloth_mesh,
    compound,
    cylinder,
    mesh,
    plane,
    sheet,
    soft_box,
    soft_capsule,
    soft_cylinder,
    soft_mesh,
    soft_sphere,
    soft_tetrahedra,
    sphere,
)
from nuno.body import Body
from nuno.camera.camera import Camera
from nuno.compound import Compound
from nuno.coordinates import Coordinates
from nuno.drawing import Drawing, draw
from nuno.errors import (
    BodyStateError,
    ClothNotFoundError,
    EstimationError,
    FileFormatError,
    ImageError,
    InvalidInputError,
    MeshError,
    MissingPackageError,
    NunoError,
    SimulationDiverged,
    UnknownNameError,
)
from nuno.export import export_body
from nuno.grip import Grip
from nuno.materials import Cloth, Material, Rigid, Soft
from nuno.path import Path
from nuno.recording import Recording
from nuno.shape import Box, Capsule, ClothMesh, Cylinder, Plane, Sheet, Sphere, TriangleMesh
from nuno.snapshot import Snapshot
from nuno.soft_shape import SoftBox, SoftCapsule, SoftCylinder, SoftMesh, SoftSphere, SoftTetrahedra
from nuno.surface import SurfacePoints
from nuno.world import World

if TYPE_CHECKING:
    from nuno.camera.table import Table
    from nuno.contact_points import ContactPoints
    from nuno.elements import ElementState, elements
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
    "Compound",
    "ContactPoints",
    "Coordinates",
    "Cylinder",
    "Drawing",
    "ElementState",
    "EstimationError",
    "FileFormatError",
    "Grip",
    "ImageError",
    "InvalidInputError",
    "Material",
    "MeshError",
    "MissingPackageError",
    "NunoError",
    "Path",
    "PickCase",
    "PickResult",
    "Plane",
    "Recording",
    "Rigid",
    "Sheet",
    "SimulationDiverged",
    "Snapshot",
    "Soft",
    "SoftBox",
    "SoftCapsule",
    "SoftCylinder",
    "SoftMesh",
    "SoftSphere",
    "SoftTetrahedra",
    "Sphere",
    "SurfacePoints",
    "Table",
    "TriangleMesh",
    "UnknownNameError",
    "World",
    "box",
    "capsule",
    "cloth_mesh",
    "compound",
    "cylinder",
    "draw",
    "elements",
    "estimate_pick",
    "export_body",
    "mesh",
    "plane",
    "read_case",
    "sheet",
    "similarity",
    "soft_box",
    "soft_capsule",
    "soft_cylinder",
    "soft_mesh",
    "soft_sphere",
    "soft_tetrahedra",
    "sphere",
]

# Names whose modules load Warp, OpenCV and the like, and so are imported on first use.
_LAZY = {
    "ElementState": "nuno.elements",
    "ContactPoints": "nuno.contact_points",
    "elements": "nuno.elements",
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
