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
    RobotModelError,
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
    from nuno.estimate.fold import replay_fold
    from nuno.estimate.fold_case import FoldCase, read_fold_case
    from nuno.estimate.fold_result import FoldResult
    from nuno.estimate.hand_path import HandPath
    from nuno.estimate.hand_tracking import HandTrack, track_hands
    from nuno.estimate.layers import Layers, find_layers
    from nuno.estimate.pick import estimate_pick
    from nuno.estimate.pick_result import PickResult
    from nuno.estimate.similarity import similarity
    from nuno.robot.humanoid import Humanoid
    from nuno.robot.links import Links
    from nuno.robot.reach import Reach

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
    "FoldCase",
    "FoldResult",
    "Grip",
    "HandPath",
    "HandTrack",
    "Humanoid",
    "ImageError",
    "InvalidInputError",
    "Layers",
    "Links",
    "Material",
    "MeshError",
    "MissingPackageError",
    "NunoError",
    "Path",
    "PickCase",
    "PickResult",
    "Plane",
    "Reach",
    "Recording",
    "Rigid",
    "RobotModelError",
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
    "find_layers",
    "mesh",
    "plane",
    "read_case",
    "read_fold_case",
    "replay_fold",
    "sheet",
    "similarity",
    "soft_box",
    "soft_capsule",
    "soft_cylinder",
    "soft_mesh",
    "soft_sphere",
    "soft_tetrahedra",
    "sphere",
    "track_hands",
]

# Names whose modules load Warp, OpenCV and the like, and so are imported on first use.
_LAZY = {
    "FoldCase": "nuno.estimate.fold_case",
    "FoldResult": "nuno.estimate.fold_result",
    "HandPath": "nuno.estimate.hand_path",
    "HandTrack": "nuno.estimate.hand_tracking",
    "track_hands": "nuno.estimate.hand_tracking",
    "Layers": "nuno.estimate.layers",
    "find_layers": "nuno.estimate.layers",
    "read_fold_case": "nuno.estimate.fold_case",
    "replay_fold": "nuno.estimate.fold",
    "ElementState": "nuno.elements",
    "ContactPoints": "nuno.contact_points",
    "elements": "nuno.elements",
    "PickCase": "nuno.estimate.case",
    "PickResult": "nuno.estimate.pick_result",
    "Table": "nuno.camera.table",
    "estimate_pick": "nuno.estimate.pick",
    "read_case": "nuno.estimate.case",
    "similarity": "nuno.estimate.similarity",
    "Humanoid": "nuno.robot.humanoid",
    "Links": "nuno.robot.links",
    "Reach": "nuno.robot.reach",
}


def __getattr__(name: str) -> Any:
    if name in _LAZY:
        value = getattr(import_module(_LAZY[name]), name)
        globals()[name] = value
        return value
    raise AttributeError(f"module 'nuno' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted([*__all__, "__version__"])
