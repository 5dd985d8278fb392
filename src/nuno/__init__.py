"""Nuno: a simulator of deformable objects that lives inside a robot's own program."""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

from nuno.bodies.body import Body
from nuno.bodies.export import export_body
from nuno.bodies.garment import Garment, garment
from nuno.bodies.make_bodies import (
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
from nuno.bodies.resolution import Resolution
from nuno.camera.camera import Camera
from nuno.errors import (
    BoardNotFoundError,
    BodyStateError,
    CalibrationError,
    ClothNotFoundError,
    ConnectionLostError,
    EngineCapabilityError,
    EstimationError,
    FileFormatError,
    FileWriteError,
    ImageError,
    ImageQualityError,
    InvalidInputError,
    MeshError,
    MessageError,
    MissingPackageError,
    NotConnectedError,
    NotEnoughMemoryError,
    NunoError,
    ReachError,
    RefusedError,
    ResultsInUseError,
    ResultsMismatchError,
    RobotModelError,
    RobotTimeoutError,
    SimulationDiverged,
    UnknownNameError,
    ViewerError,
    WalkError,
    WorkerLostError,
)
from nuno.joints.grip import Grip
from nuno.joints.joint import Joint
from nuno.joints.joint_drives import Motor, Spring
from nuno.materials import Cloth, Material, Rigid, Soft
from nuno.shapes.compound import Compound
from nuno.shapes.coordinates import Coordinates
from nuno.shapes.path import Path
from nuno.shapes.shape import Box, Capsule, ClothMesh, Cylinder, Plane, Sheet, Sphere, TriangleMesh
from nuno.shapes.soft_shape import SoftBox, SoftCapsule, SoftCylinder, SoftMesh, SoftSphere, SoftTetrahedra
from nuno.shapes.surface import SurfacePoints
from nuno.world.drawing import Drawing, draw
from nuno.world.make_joints import ball_joint, fixed_joint, hinge, slider
from nuno.world.recording import Recording
from nuno.world.snapshot import Snapshot
from nuno.world.world import World

if TYPE_CHECKING:
    from nuno.bodies.element_state import ElementState, elements
    from nuno.camera.calibration import Calibration, calibrate_camera, camera_above_table
    from nuno.camera.calibration_board import CalibrationBoard
    from nuno.camera.find_shape import FoundShape, find_shape
    from nuno.camera.image_quality import ImageQuality, image_quality
    from nuno.camera.marker_pose import find_marker
    from nuno.camera.picture import Chequer, Lamp, Picture, take_picture
    from nuno.camera.segmentation import segment_after, segment_before
    from nuno.camera.table import Table
    from nuno.camera.usb_camera import UsbCamera
    from nuno.engines.engine_registry import engine_capabilities
    from nuno.estimate.capture_case import Capture, capture_case
    from nuno.estimate.capture_live import take_capture
    from nuno.estimate.case import PickCase, read_case
    from nuno.estimate.fit_material import MaterialFit, fit_material
    from nuno.estimate.fold import replay_fold
    from nuno.estimate.fold_case import FoldCase, read_fold_case
    from nuno.estimate.fold_result import FoldResult
    from nuno.estimate.footage import Footage
    from nuno.estimate.hand_path import HandPath
    from nuno.estimate.hand_tracking import HandTrack, track_hands
    from nuno.estimate.hold import estimate_hold
    from nuno.estimate.hold_result import HoldResult
    from nuno.estimate.imagined_holds import HoldGuess, Holds, imagine_holds
    from nuno.estimate.layers import Layers, find_layers
    from nuno.estimate.pick import estimate_pick
    from nuno.estimate.pick_result import PickResult
    from nuno.estimate.similarity import similarity
    from nuno.mesh.fitted import fitted_tetrahedra
    from nuno.mesh.lattice import lattice_tetrahedra
    from nuno.mesh.tetrahedra import Tetrahedra, boundary_faces, box_tetrahedra
    from nuno.robot.describe_robot import describe_robot
    from nuno.robot.footsteps import Footstep
    from nuno.robot.goal import Goal, Tolerances
    from nuno.robot.hands import Hand
    from nuno.robot.head_cameras import HeadCameras
    from nuno.robot.humanoid import Humanoid
    from nuno.robot.interface import RobotInterface
    from nuno.robot.links import Links
    from nuno.robot.reach import Reach
    from nuno.robot.ros1.ros1_driver import Ros1Driver
    from nuno.robot.ros2.ros2_server import Ros2Server
    from nuno.robot.sensor_model import SensorModel
    from nuno.robot.sensors import Readings, Sensors
    from nuno.robot.servo import ServoCommand
    from nuno.robot.simulated_robot import SimulatedRobot
    from nuno.robot.stereo import StereoPoints, StereoTrack, locate_marker, track_hands_in_stereo, triangulate
    from nuno.robot.stride import Stride
    from nuno.robot.trajectory import JointTrajectory
    from nuno.robot.walk import Walk
    from nuno.robot.walking import continue_walk, plan_walk, plan_walk_footsteps, plan_walk_velocity, stop_walk
    from nuno.robot.wire.client import WireRobot
    from nuno.robot.wire.names import Names
    from nuno.robot.wire.server import RobotServer
    from nuno.scenes.load_scene import LoadedScene, load_scene
    from nuno.scenes.save_scene import save_scene
    from nuno.scenes.scene_report import SceneReport
    from nuno.search.knots import Knots
    from nuno.search.minimise import Minimum, minimise
    from nuno.search.planner import Plan, plan
    from nuno.search.replanner import Replanned, replan
    from nuno.search.sampler import Uniform
    from nuno.search.sweep import SweepResult, read_sweep, sweep
    from nuno.search.trial import Trial, each
    from nuno.shapes.shape import Hull
    from nuno.tasks.arm_tracks import ArmTracks
    from nuno.tasks.carry_mat import carry_mat
    from nuno.tasks.carry_result import CarryResult, CarryTrial
    from nuno.tasks.improve_fold import ImprovedFold, improve_fold
    from nuno.tasks.lift import LiftResult, lift_soft_cube
    from nuno.tasks.pick_towel import TowelPicker
    from nuno.tasks.play_fold import PlayedFold, play_fold
    from nuno.tasks.taught_fold import TaughtFold
    from nuno.tracking.follow import follow
    from nuno.tracking.followed import Followed
    from nuno.tracking.follower import Follower
    from nuno.viewer.compare_engines import EngineComparison, compare_engines
    from nuno.viewer.film import Film
    from nuno.viewer.viewer import Viewer
    from nuno.world.contact_points import ContactPoints

__version__ = "0.1.0"

__all__ = [
    "ArmTracks", "BoardNotFoundError", "Body", "BodyStateError", "Box", "Calibration", "CalibrationBoard",
    "CalibrationError", "Camera", "Capsule", "Capture", "CarryResult", "CarryTrial", "Chequer", "Cloth", "ClothMesh",
    "ClothNotFoundError", "Compound", "ConnectionLostError", "ContactPoints", "Coordinates", "Cylinder", "Drawing",
    "ElementState", "EngineCapabilityError", "EngineComparison", "EstimationError", "FileFormatError", "FileWriteError",
    "Film", "FoldCase", "FoldResult", "Followed", "Follower", "Footage", "Footstep", "FoundShape", "Garment", "Goal",
    "Grip", "Hand", "HandPath", "HandTrack", "HeadCameras", "HoldGuess", "HoldResult", "Holds", "Hull", "Humanoid",
    "ImageError", "ImageQuality", "ImageQualityError", "ImprovedFold", "InvalidInputError", "Joint", "JointTrajectory",
    "Knots", "Lamp", "Layers", "LiftResult", "Links", "LoadedScene", "Material", "MaterialFit", "MeshError",
    "MessageError", "Minimum", "MissingPackageError", "Motor", "Names", "NotConnectedError", "NotEnoughMemoryError",
    "NunoError", "Path", "PickCase", "PickResult", "Picture", "Plan", "Plane", "PlayedFold", "Reach", "ReachError",
    "Readings", "Recording", "RefusedError", "Replanned", "Resolution", "ResultsInUseError", "ResultsMismatchError",
    "Rigid", "RobotInterface", "RobotModelError", "RobotServer", "RobotTimeoutError", "Ros1Driver", "Ros2Server",
    "SceneReport", "SensorModel", "Sensors", "ServoCommand", "Sheet", "SimulatedRobot", "SimulationDiverged",
    "Snapshot", "Soft", "SoftBox", "SoftCapsule", "SoftCylinder", "SoftMesh", "SoftSphere", "SoftTetrahedra", "Sphere",
    "Spring", "StereoPoints", "StereoTrack", "Stride", "SurfacePoints", "SweepResult", "Table", "TaughtFold",
    "Tetrahedra", "Tolerances", "TowelPicker", "Trial", "TriangleMesh", "Uniform", "UnknownNameError", "UsbCamera",
    "Viewer", "ViewerError", "Walk", "WalkError", "WireRobot", "WorkerLostError", "World", "ball_joint",
    "boundary_faces", "box", "box_tetrahedra", "calibrate_camera", "camera_above_table", "capsule", "capture_case",
    "carry_mat", "cloth_mesh", "compare_engines", "compound", "continue_walk", "cylinder", "describe_robot", "draw",
    "each", "elements", "engine_capabilities", "estimate_hold", "estimate_pick", "export_body", "find_layers",
    "find_marker", "find_shape", "fit_material", "fitted_tetrahedra", "fixed_joint", "follow", "garment", "hinge",
    "image_quality", "imagine_holds", "improve_fold", "lattice_tetrahedra", "lift_soft_cube", "load_scene",
    "locate_marker", "mesh", "minimise", "plan", "plan_walk", "plan_walk_footsteps", "plan_walk_velocity", "plane",
    "play_fold", "read_case", "read_fold_case", "read_sweep", "replan", "replay_fold", "save_scene", "segment_after",
    "segment_before", "sheet", "similarity", "slider", "soft_box", "soft_capsule", "soft_cylinder", "soft_mesh",
    "soft_sphere", "soft_tetrahedra", "sphere", "stop_walk", "sweep", "take_capture", "take_picture", "track_hands",
    "track_hands_in_stereo", "triangulate",
]  # fmt: skip

# Names whose modules load Warp, OpenCV and the like, and so are imported on first use.
_LAZY = {
    name: module
    for module, names in {
        "nuno.bodies.element_state": "ElementState elements",
        "nuno.camera.calibration": "Calibration calibrate_camera camera_above_table",
        "nuno.camera.calibration_board": "CalibrationBoard",
        "nuno.camera.find_shape": "FoundShape find_shape",
        "nuno.camera.image_quality": "ImageQuality image_quality",
        "nuno.camera.lamp": "Lamp",
        "nuno.camera.marker_pose": "find_marker",
        "nuno.camera.picture": "Chequer Picture take_picture",
        "nuno.camera.segmentation": "segment_after segment_before",
        "nuno.camera.table": "Table",
        "nuno.camera.usb_camera": "UsbCamera",
        "nuno.estimate.capture_case": "Capture capture_case",
        "nuno.estimate.capture_live": "take_capture",
        "nuno.engines.engine_registry": "engine_capabilities",
        "nuno.estimate.case": "PickCase read_case",
        "nuno.estimate.fit_material": "MaterialFit fit_material",
        "nuno.estimate.fold": "replay_fold",
        "nuno.estimate.fold_case": "FoldCase read_fold_case",
        "nuno.estimate.fold_result": "FoldResult",
        "nuno.estimate.footage": "Footage",
        "nuno.estimate.hand_path": "HandPath",
        "nuno.estimate.hand_tracking": "HandTrack track_hands",
        "nuno.estimate.hold": "estimate_hold",
        "nuno.estimate.hold_result": "HoldResult",
        "nuno.estimate.imagined_holds": "HoldGuess Holds imagine_holds",
        "nuno.estimate.layers": "Layers find_layers",
        "nuno.estimate.pick": "estimate_pick",
        "nuno.estimate.pick_result": "PickResult",
        "nuno.estimate.similarity": "similarity",
        "nuno.mesh.fitted": "fitted_tetrahedra",
        "nuno.mesh.lattice": "lattice_tetrahedra",
        "nuno.mesh.tetrahedra": "Tetrahedra boundary_faces box_tetrahedra",
        "nuno.robot.describe_robot": "describe_robot",
        "nuno.robot.footsteps": "Footstep",
        "nuno.robot.goal": "Goal Tolerances",
        "nuno.robot.hands": "Hand",
        "nuno.robot.head_cameras": "HeadCameras",
        "nuno.robot.humanoid": "Humanoid",
        "nuno.robot.interface": "RobotInterface",
        "nuno.robot.links": "Links",
        "nuno.robot.reach": "Reach",
        "nuno.robot.ros1.ros1_driver": "Ros1Driver",
        "nuno.robot.ros2.ros2_server": "Ros2Server",
        "nuno.robot.sensor_model": "SensorModel",
        "nuno.robot.sensors": "Readings Sensors",
        "nuno.robot.servo": "ServoCommand",
        "nuno.robot.simulated_robot": "SimulatedRobot",
        "nuno.robot.stereo": "StereoPoints StereoTrack locate_marker track_hands_in_stereo triangulate",
        "nuno.robot.stride": "Stride",
        "nuno.robot.trajectory": "JointTrajectory",
        "nuno.robot.walk": "Walk",
        "nuno.robot.walking": "continue_walk plan_walk plan_walk_footsteps plan_walk_velocity stop_walk",
        "nuno.robot.wire.client": "WireRobot",
        "nuno.robot.wire.names": "Names",
        "nuno.robot.wire.server": "RobotServer",
        "nuno.scenes.load_scene": "LoadedScene load_scene",
        "nuno.scenes.save_scene": "save_scene",
        "nuno.scenes.scene_report": "SceneReport",
        "nuno.search.knots": "Knots",
        "nuno.search.minimise": "Minimum minimise",
        "nuno.search.planner": "Plan plan",
        "nuno.search.replanner": "Replanned replan",
        "nuno.search.sampler": "Uniform",
        "nuno.search.sweep": "SweepResult read_sweep sweep",
        "nuno.search.trial": "Trial each",
        "nuno.shapes.shape": "Hull",
        "nuno.tasks.arm_tracks": "ArmTracks",
        "nuno.tasks.carry_mat": "carry_mat",
        "nuno.tasks.carry_result": "CarryResult CarryTrial",
        "nuno.tasks.improve_fold": "ImprovedFold improve_fold",
        "nuno.tasks.lift": "LiftResult lift_soft_cube",
        "nuno.tasks.pick_towel": "TowelPicker",
        "nuno.tasks.play_fold": "PlayedFold play_fold",
        "nuno.tasks.taught_fold": "TaughtFold",
        "nuno.viewer.compare_engines": "EngineComparison compare_engines",
        "nuno.tracking.follow": "follow",
        "nuno.tracking.followed": "Followed",
        "nuno.tracking.follower": "Follower",
        "nuno.viewer.film": "Film",
        "nuno.viewer.viewer": "Viewer",
        "nuno.world.contact_points": "ContactPoints",
    }.items()
    for name in names.split()
}


def __getattr__(name: str) -> Any:
    if name in _LAZY:
        value = getattr(import_module(_LAZY[name]), name)
        globals()[name] = value
        return value
    if not name.startswith("_") and find_spec(f"nuno.{name}") is not None:  # a package such as nuno.envs
        return import_module(f"nuno.{name}")
    raise AttributeError(f"module 'nuno' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted([*__all__, "__version__"])
