"""A valid call of every public name, of which hostile ones are made by changing one argument."""

from functools import cached_property

import numpy as np

import nuno

TRIANGLES = (np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]]), np.array([[0, 1, 2], [1, 3, 2]]))
TETRAHEDRON = (np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]), np.array([[0, 1, 2, 3]]))
CUBE = (
    np.array([[x, y, z] for x in (0.0, 1) for y in (0.0, 1) for z in (0.0, 1)]),
    np.array(
        [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4],
         [1, 5, 7], [1, 7, 3]]
    ),
)  # fmt: skip
IMAGE = np.zeros((48, 64, 3), np.uint8)
POINT = (0.0, 0.0, 0.1)


class Scene:
    """A small world with a body of every kind, and what belongs to it; nothing in it is run."""

    def __init__(self):
        self.world = world = nuno.World(device="cpu")
        self.floor = world.add(nuno.plane(name="floor"))
        self.table = world.add(nuno.box((0.4, 0.4, 0.02), name="table", position=(0, 0, 0.2)))
        self.towel = world.add(nuno.sheet((0.2, 0.1), (4, 2), name="towel", position=(0, 0, 0.5)))
        self.cube = world.add(nuno.soft_box((0.1, 0.1, 0.1), (1, 1, 1), name="cube", position=(0.5, 0, 0.3)))
        self.brick = world.add(nuno.box((0.1, 0.1, 0.1), name="brick", position=(-0.5, 0, 0.3)))
        self.lid = world.add(nuno.box((0.1, 0.1, 0.02), name="lid", position=(-0.5, 0, 0.5)))
        self.still = world.add(nuno.sheet((0.2, 0.1), (4, 2), name="still", position=(0, 0.5, 0.5)))
        for body in (self.towel, self.cube, self.brick, self.lid):
            world.attach(body)
        self.grip = world.grip(self.towel, [0], to=self.towel.vertices[0], compliance=1e-3)
        self.hinge = nuno.hinge(self.lid, self.brick, point=(-0.5, 0, 0.4), axis=(1, 0, 0))
        self.camera = nuno.Camera(64, 48, 60.0, 60.0, 32.0, 24.0)
        aside = np.eye(4)
        aside[0, 3] = 0.1
        self.beside = nuno.Camera(64, 48, 60.0, 60.0, 32.0, 24.0, aside)
        self.path = nuno.Path([0.0, 1.0], [POINT, (0, 0, 0.2)])
        self.points = nuno.SurfacePoints([0], [[1.0, 0.0, 0.0]])
        self.hand = nuno.HandPath([0.0, 1.0], [POINT, POINT], [True, False])
        self.table_of = nuno.Table(0.0)

    @cached_property
    def snapshot(self):
        """What is saved of it."""
        return self.world.save()

    @cached_property
    def futures(self):
        """Two copies of it."""
        return self.world.imagine(2)

    @cached_property
    def recording(self):
        """One frame of it."""
        recording = nuno.Recording(self.world)
        recording.add()
        return recording

    @cached_property
    def film(self):
        """The recording as a film."""
        return nuno.Film.of(self.recording)

    @cached_property
    def result(self):
        """Two trials of a sweep."""
        trials = [nuno.Trial(k, {"y": np.array(float(k))}) for k in range(2)]
        return nuno.SweepResult({"x": np.arange(2.0)}, trials)

    @cached_property
    def follower(self):
        """One of the towel."""
        return nuno.follow(self.world, self.towel, self.camera)

    @cached_property
    def viewer(self):
        """Nobody looks at it."""
        return nuno.Viewer(self.world)

    @cached_property
    def picture(self):
        """One of it."""
        return nuno.take_picture(self.world, self.camera)

    @cached_property
    def sock(self):
        """A coarse garment."""
        return nuno.garment("sock", cell=0.04)

    @cached_property
    def holds(self):
        """It, held by two points."""
        shape = (1, 2, len(self.sock.vertices), 3)
        hanging = np.broadcast_to(self.sock.vertices, shape).astype(np.float32)
        return nuno.Holds(self.sock, np.array([0, 1]), (nuno.HoldGuess(1e-4),), hanging, np.ones((1, 2), bool), "cpu")

    @cached_property
    def hold(self):
        """By which of them it is held."""
        return nuno.estimate_hold(self.sock, np.ones((48, 64), bool), self.camera, POINT, holds=self.holds)

    @cached_property
    def layers(self):
        """The towel's layers."""
        u, v = np.meshgrid(np.linspace(0, 1, 5), np.linspace(0, 1, 3))
        fractions = np.stack([u.ravel(), v.ravel()], axis=1)
        return nuno.find_layers(self.towel.vertices, self.towel.faces, fractions)


def falling():
    """A saved world in which a ball falls."""
    world = nuno.World(device="cpu")
    world.attach(world.add(nuno.sphere(0.1)))
    return world.save()


class Robots:
    """A robot, its driver, and what is planned for it."""

    @cached_property
    def robot(self):
        """Talos."""
        return nuno.Humanoid("talos")

    @cached_property
    def links(self):
        """Another one in a world."""
        return self.robot.copy().enter(nuno.World(device="cpu"))

    @cached_property
    def driver(self):
        """Its driver."""
        return nuno.SimulatedRobot(self.links.robot, self.links.world, links=self.links)

    @cached_property
    def walk(self):
        """A short walk."""
        return nuno.plan_walk(self.robot, 0.1, check_collisions=False)

    @cached_property
    def sensors(self):
        """Its sensors."""
        return nuno.Sensors(self.robot)

    @cached_property
    def hand(self):
        """Its left hand."""
        return nuno.Hand(self.links, "left_hand")

    @cached_property
    def cameras(self):
        """Its cameras."""
        return nuno.HeadCameras(self.links)

    @cached_property
    def trajectory(self):
        """A motion of its head."""
        return nuno.JointTrajectory(("head_1_joint",), [0.0, 1.0], [[0.0], [0.1]])


def trial(world, params):
    """Return nothing of interest."""
    return {"loss": params["x"]}


BOUNDS = {"x": (0.0, 1.0)}
STEREO = {
    "left_images": lambda s: {0: IMAGE}, "right_images": lambda s: {0: IMAGE}, "frame_times": lambda s: [0.0],
    "left": lambda s: s.camera, "right": lambda s: s.beside, "start": lambda s: [POINT],
}  # fmt: skip
RIGID_JOINT = {"a": lambda s: s.world.find("brick"), "b": lambda s: None}
# The arguments that a call needs; a function gets the scene or the robots
CALLS = {
    "Body": {"shape": nuno.Box((1, 1, 1))},
    "Box": {"size": (1.0, 1.0, 1.0)},
    "CalibrationBoard": {},
    "CalibrationBoard.find": {"image": IMAGE}, "CalibrationBoard.save": {"path": "board.pdf"},
    "CalibrationBoard.picture": {},
    "Camera.look_at": {"eye": (0.0, 0.0, 1.0), "target": (0.0, 1.0, 0.0), "fov": 1.0},
    "Camera": {"width": 8, "height": 8, "fx": 8.0, "fy": 8.0, "cx": 4.0, "cy": 4.0},
    "Capsule": {"radius": 0.1, "height": 0.2},
    "Chequer": {"size": 0.1},
    "Cloth": {},
    "ClothMesh": {"vertices": TRIANGLES[0], "faces": TRIANGLES[1]},
    "Compound": {"parts": (nuno.Box((1, 1, 1)),)},
    "Coordinates": {},
    "Cylinder": {"radius": 0.1, "height": 0.2},
    "Film.of": {"recording": lambda s: s.recording},
    "Footage": {
        "world": lambda s: s.world, "cloth": "still", "move": lambda s: (lambda world: None),
        "camera": lambda s: s.camera, "times": [0.0], "masks": np.ones((1, 48, 64), bool),
    },
    "Footstep": {"foot": 0, "x": 0.0, "y": 0.0, "yaw": 0.0},
    "Hull": {"vertices": CUBE[0], "faces": CUBE[1]},
    "Hull.of": {"points": CUBE[0]},
    "HoldGuess": {"bending_rigidity": 1e-4},
    "HandPath": {"times": [0.0, 1.0], "positions": [POINT, POINT], "held": [True, False]},
    "JointTrajectory": {"names": ("a",), "times": [0.0, 1.0], "positions": [[0.0], [1.0]]},
    "Knots": {"now": [0.0, 0.0, 0.0], "values": [POINT], "seconds": 1.0},
    "Knots.at": {"times": [0.0, 0.5]}, "Knots.later": {"seconds": 0.5}, "Knots.path": {"begin": 0.0},
    "Lamp": {},
    "Motor": {},
    "Names": {},
    "Path": {"times": [0.0, 1.0], "positions": [POINT, POINT]},
    "PickCase": {
        "camera": lambda s: s.camera, "before": IMAGE, "after": IMAGE, "table_height": 0.0, "hand": POINT,
        "table_half_extents": None, "table_centre": None, "table_thickness": 0.04,
    },
    "Plane": {},
    "Recording": {"world": lambda s: s.world},
    "Recording.from_frames": {"times": [0.0], "bodies": lambda s: s.recording.bodies},
    "Recording.of": {"world": lambda s: s.world, "seconds": 0.0},
    "Rigid": {},
    "SensorModel": {},
    "ServoCommand": {"names": ("head_1_joint",), "q": [0.0]},
    "Sheet": {"size": (1.0, 1.0), "cells": (2, 2)},
    "Soft": {},
    "SoftBox": {"size": (1.0, 1.0, 1.0), "cells": (1, 1, 1)},
    "SoftCapsule": {"radius": 0.1, "height": 0.1, "cell": 0.1},
    "SoftCylinder": {"radius": 0.1, "height": 0.1, "cell": 0.1},
    "SoftMesh": {"vertices": CUBE[0], "faces": CUBE[1], "cell": 0.5},
    "SoftSphere": {"radius": 0.1, "cell": 0.1},
    "SoftTetrahedra": {"vertices": TETRAHEDRON[0], "tets": TETRAHEDRON[1]},
    "Sphere": {"radius": 0.1},
    "Spring": {"stiffness": 1.0},
    "Stride": {"step_length": 0.1, "side_step": 0.1, "turn_step": 0.1, "lift": 0.05, "stance": 0.2},
    "SurfacePoints": {"faces": [0], "barycentric": [[1.0, 0.0, 0.0]]},
    "Table": {"height": 0.0},
    "Tetrahedra": None,
    "Tolerances": {},
    "TriangleMesh": {"vertices": TRIANGLES[0], "faces": TRIANGLES[1]},
    "Uniform": {"bounds": BOUNDS},
    "World": {"device": "cpu"},
    "ball_joint": {**RIGID_JOINT, "point": POINT},
    "boundary_faces": {"tets": TETRAHEDRON[1]},
    "box": {"size": (1.0, 1.0, 1.0)},
    "box_tetrahedra": {"size": (1.0, 1.0, 1.0), "cells": (1, 1, 1)},
    "calibrate_camera": {"images": [IMAGE], "board": lambda s: nuno.CalibrationBoard()},
    "camera_above_table": {"image": IMAGE, "camera": lambda s: s.camera, "board": lambda s: nuno.CalibrationBoard()},
    "capsule": {"radius": 0.1, "height": 0.2},
    "capture_case": {
        "folder": "case", "before": IMAGE, "after": IMAGE, "board_on_table": IMAGE, "camera": lambda s: s.camera,
        "hand": POINT,
    },
    "carry_mat": {},
    "cloth_mesh": {"source": TRIANGLES},
    "compound": {"parts": (nuno.Box((1, 1, 1)),)},
    "continue_walk": {"walk": lambda r: r.walk, "time": 1.0},
    "cylinder": {"radius": 0.1, "height": 0.2},
    "draw": {"body": lambda s: s.towel},
    "each": {"trial": lambda s: trial},
    "elements": {"body": lambda s: s.cube},
    "engine_capabilities": {"engine": "nuno"},
    "estimate_pick": {
        "before": IMAGE, "after": IMAGE, "camera": lambda s: s.camera, "table_height": 0.0, "hand": POINT,
        "progress": False,
    },
    "estimate_hold": {
        "garment": lambda s: s.sock, "images": np.ones((48, 64), bool), "cameras": lambda s: s.camera, "hand": POINT,
        "holds": lambda s: s.holds, "progress": False,
    },
    "export_body": {"path": "out.obj", "body": lambda s: s.towel},
    "find_layers": {
        "vertices": TRIANGLES[0], "faces": TRIANGLES[1], "fractions": [[0, 0], [1, 0], [0, 1], [1, 1]],
    },
    "find_marker": {"image": IMAGE, "camera": lambda s: s.camera, "marker": 0, "size": 0.05},
    "find_shape": {"image": IMAGE, "outline": [[0.0, 0.0], [30.0, 0.0], [30.0, 20.0], [0.0, 20.0]]},
    "fit_material": {"seen": None},
    "fitted_tetrahedra": {"vertices": CUBE[0], "faces": CUBE[1], "cell": 0.5},
    "fixed_joint": RIGID_JOINT,
    "garment": {"name": "sock", "cell": 0.04},
    "imagine_holds": {"garment": lambda s: s.sock, "candidates": [0, 1], "device": "cpu", "progress": False},
    "follow": {"world": lambda s: s.world, "body": lambda s: s.towel, "camera": lambda s: s.camera},
    "hinge": {**RIGID_JOINT, "point": POINT, "axis": (1, 0, 0)},
    "image_quality": {"image": IMAGE},
    "improve_fold": {"motion": None, "cloth": lambda s: s.still},
    "lattice_tetrahedra": {"vertices": CUBE[0], "faces": CUBE[1], "cell": 0.5},
    "lift_soft_cube": {"device": "cpu"},
    "load_scene": {"path": "no.xml", "world": lambda s: nuno.World(device="cpu")},
    "locate_marker": {
        "left_image": IMAGE, "right_image": IMAGE, "left": lambda s: s.camera, "right": lambda s: s.beside, "marker": 0,
    },
    "mesh": {"source": TRIANGLES},
    "minimise": {"trial": lambda s: trial, "bounds": BOUNDS, "progress": False},
    "compare_engines": {"scene": lambda s: falling(), "engines": ("nuno", "mujoco"), "seconds": 0.02},
    "plan": {
        "world": lambda s: s.world, "act": lambda s: (lambda futures, knots: None),
        "cost": lambda s: (lambda futures: np.zeros(2)), "start": [[0.0]], "spread": 1.0, "horizon": 0.01, "samples": 2,
        "iterations": 1,
    },
    "replan": {
        "world": lambda s: s.world, "act": lambda s: (lambda futures, motion: None),
        "cost": lambda s: (lambda futures: np.zeros(2)), "now": lambda s: (lambda world: [0.0]), "start": [[0.0]],
        "spread": 1.0, "horizon": 0.01, "every": 0.01, "periods": 1, "samples": 2, "iterations": 1,
    },
    "segment_before": {"image": IMAGE, "camera": lambda s: s.camera, "table": lambda s: s.table_of},
    "segment_after": {
        "image": IMAGE, "camera": lambda s: s.camera, "table": lambda s: s.table_of, "before_image": IMAGE,
        "before_mask": np.ones((48, 64), bool), "hand_position": POINT,
    },
    "plan_walk": {"robot": lambda r: r.robot},
    "plan_walk_footsteps": {"robot": lambda r: r.robot, "footsteps": lambda r: r.walk.footsteps},
    "plan_walk_velocity": {"robot": lambda r: r.robot},
    "plane": {},
    "play_fold": {"robot": None, "cloth": lambda s: s.still, "motion": None},
    "read_case": {"folder": "nowhere"},
    "read_fold_case": {"folder": "nowhere"},
    "read_sweep": {"path": "nowhere"},
    "replay_fold": {
        "first_image": IMAGE, "hands": lambda s: [s.hand], "camera": lambda s: s.camera, "table_height": 0.0,
        "progress": False,
    },
    "save_scene": {"world": lambda s: s.world, "path": "out.xml"},
    "sheet": {"size": (1.0, 1.0), "cells": (2, 2)},
    "similarity": {"masks": np.ones((1, 8, 8), bool), "real_mask": np.ones((8, 8), bool)},
    "slider": {**RIGID_JOINT, "axis": (1, 0, 0)},
    "soft_box": {"size": (1.0, 1.0, 1.0), "cells": (1, 1, 1)},
    "soft_capsule": {"radius": 0.1, "height": 0.1, "cell": 0.1, "tetrahedraliser": "lattice"},
    "soft_cylinder": {"radius": 0.1, "height": 0.1, "cell": 0.1, "tetrahedraliser": "lattice"},
    "soft_mesh": {"source": CUBE, "cell": 0.5, "tetrahedraliser": "lattice"},
    "soft_sphere": {"radius": 0.1, "cell": 0.1, "tetrahedraliser": "lattice"},
    "soft_tetrahedra": {"vertices": TETRAHEDRON[0], "tets": TETRAHEDRON[1]},
    "sphere": {"radius": 0.1},
    "stop_walk": {"walk": lambda r: r.walk, "time": 1.0},
    "sweep": {"trial": lambda s: trial, "params": {"x": [1.0, 2.0]}, "progress": False},
    "take_capture": {
        "folder": "case", "source": None, "ask": lambda s: (lambda what: None), "camera": lambda s: s.camera,
        "hand": POINT,
    },
    "take_picture": {"world": lambda s: s.world, "camera": lambda s: s.camera},
    "track_hands": {
        "images": lambda s: {0: IMAGE}, "frame_times": [0.0], "camera": lambda s: s.camera, "start": [POINT],
        "heights": [0.1],
    },
    "track_hands_in_stereo": STEREO,
    "triangulate": {
        "left": lambda s: s.camera, "right": lambda s: s.beside, "left_pixels": [[1.0, 2.0]],
        "right_pixels": [[1.0, 2.0]],
    },
    "UsbCamera": {"number": 63},
    "Viewer": {"world": lambda s: s.world},
    # robots
    "Humanoid": {},
    "Hand": {"links": lambda r: r.links, "name": "left_hand"},
    "HeadCameras": {"links": lambda r: r.links},
    "Links": {"robot": lambda r: r.robot, "world": lambda r: nuno.World(device="cpu")},
    "Sensors": {"robot": lambda r: r.robot},
    "SimulatedRobot": {"robot": lambda r: r.robot, "world": lambda r: nuno.World(device="cpu")},
    "Stride.of": {"robot": lambda r: r.robot},
    "RobotServer": {"robot": lambda r: r.driver, "port": 0},
    "Ros1Driver": {"url": "ws://127.0.0.1:1", "python": "/no/such/python"},
    "Ros2Server": {"robot": lambda r: r.driver, "domain": 231},
    "describe_robot": {"urdf": lambda r: r.robot.description.urdf},
    "TowelPicker": {"driver": lambda r: r.driver, "table": nuno.Table(0.0)},
    "WireRobot": {"url": "ws://127.0.0.1:1", "robot": lambda r: r.robot, "timeout": 0.1},
    # methods
    "Body.angular_momentum": {}, "Body.at": {"u": 0.5, "v": 0.5}, "Body.closest": {"points": POINT},
    "Body.export": {"path": "out.obj"}, "Body.to_trimesh": {},
    "Camera.back_project": {"pixels": [[1.0, 2.0]], "height": 1.0}, "Camera.depth_of": {"points": POINT},
    "Camera.from_dict": {
        "data": {"camera_to_world": np.eye(4), "width": 8, "height": 8, "fx": 8.0, "fy": 8.0, "cx": 4.0, "cy": 4.0},
    },
    "Camera.project": {"points": (0.0, 0.0, 1.0)}, "Camera.rays": {"pixels": [[1.0, 2.0]]},
    "Camera.scaled": {"factor": 2.0},
    "Cloth.preset": {"name": "towel"}, "Cloth.of_world": {"world": 0, "world_count": 1},
    "Cloth.resolved": {"world_count": 1, "element_count": 1},
    "Coordinates.assoc": {"child": lambda s: nuno.Coordinates()}, "Coordinates.dissoc": None,
    "Coordinates.locate": {"position": POINT}, "Coordinates.rotate": {"angle": 0.1, "axis": "x"},
    "Coordinates.to_local": {"points": [POINT]}, "Coordinates.to_world": {"points": [POINT]},
    "Coordinates.transform": {"other": lambda s: nuno.Coordinates()}, "Coordinates.translate": {"offset": POINT},
    "EngineComparison.differences": {}, "EngineComparison.film": {}, "EngineComparison.table": {"rows": 2},
    "EngineComparison.save": {"folder": "out"},
    "Garment.body": {}, "Garment.distances": {"vertex": 0}, "Garment.nearest": {"place": (0.0, 0.0)},
    "HoldResult.distance": {"vertex": 0}, "HoldResult.figure": {}, "HoldResult.positions": {"rank": 0},
    "HoldResult.save": {"folder": "out"}, "HoldResult.to_dict": {},
    "Film.save": {"path": "out.html"}, "Follower.update": {"time": 0.0, "seen": np.ones((48, 64), bool)},
    "Follower.through": {"frames": lambda s: [(0.0,)]}, "Grip.release": {},
    "HandPath.at": {"time": 0.5}, "HandPath.holds_at": {"time": 0.5},
    "JointTrajectory.of": {"names": ("head_1_joint",)},
    "Layers.over": {"u": 0.5, "v": 0.5},
    "Path.at": {"time": 0.5}, "Path.quaternion_at": {"time": 0.5}, "Path.sampled": {"times": [0.0, 0.5]},
    "Recording.export": {"path": "out.glb"}, "Recording.save": {"path": "out.npz"},
    "Recording.load": {"path": "no.npz"},
    "Snapshot.at": {"time": 1.0}, "Snapshot.pick": {"world": 0}, "Snapshot.spread": {"world_count": 2},
    "SweepResult.best": {"name": "y"}, "SweepResult.row": {"index": 0}, "SweepResult.values": {"name": "y"},
    "SweepResult.save_csv": {"path": "out.csv"},
    "SurfacePoints.positions": {"vertices": TRIANGLES[0], "faces": TRIANGLES[1]},
    "World.add": {"body": lambda s: nuno.box((1, 1, 1))},
    "World.adopt": {"futures": lambda s: s.futures, "k": 0, "only": None},
    "World.attach": {"body": "still"}, "World.contact_force": {"body": "towel"}, "World.contacts": {"body": "towel"},
    "World.depth": {"camera": lambda s: s.camera}, "World.detach": {"body": "towel"}, "World.find": {"name": "towel"},
    "World.grip": {"body": "towel", "where": [1], "to": POINT, "compliance": 1e-3},
    "World.ids": {"camera": lambda s: s.camera}, "World.ignore_contact": {"a": "towel", "b": "table"},
    "World.imagine": {"n": 2}, "World.masks": {"camera": lambda s: s.camera, "body": "towel"},
    "World.move": {"body": "table", "to": lambda s: s.path}, "World.push": {"body": "brick", "force": POINT},
    "World.remove": {"body": "towel"}, "World.reset": {"worlds": [0], "saved": lambda s: s.snapshot},
    "World.rigid_motion": {"bodies": ["brick"]}, "World.segment": {"camera": lambda s: s.camera},
    "World.restore": {"saved": lambda s: s.snapshot}, "World.run": {"seconds": 0.0}, "World.save": {},
    "World.set_friction": {"a": "towel", "b": "table", "mu": 0.5},
    "World.set_material": {"body": "towel", "material": nuno.Cloth()},
    "World.set_pose": {"body": "table", "position": POINT}, "World.set_velocity": {"body": "brick", "velocity": POINT},
    "World.set_vertices": {"body": "towel", "vertices": np.zeros((15, 3))}, "World.start": {},
    "World.state": {"body": "towel"}, "World.step": {}, "World.stop": {}, "World.sum_impulses": {"body": "towel"},
    "World.trace": {"body": "towel", "times": [0.1]},
    "World.weld": {"a": "towel", "b": "brick", "where": [1], "compliance": 1e-3},
    "HandTrack.path": {"held": [True]}, "StereoTrack.path": {"held": [True]},
    "Minimum.near": {"excess": 0.1}, "Names.full": {"name": "a"}, "Picture.save": {"path": "out.png"},
    "TaughtFold.from_hands": {
        "world": lambda s: s.world, "cloth": lambda s: s.still, "hands": lambda s: [s.hand], "material": nuno.Cloth(),
    },
    "Viewer.add_camera": {"name": "a", "camera": lambda s: s.camera}, "Viewer.draw": {"body": "towel"},
    "Viewer.look_at": {"worlds": None}, "Viewer.look_from": {"eye": (1.0, 1.0, 1.0), "target": POINT},
    "Viewer.pick": {"body": "towel"}, "Viewer.play": {"what": lambda s: s.recording},
    "Viewer.plot": {"name": "a", "read": lambda s: (lambda: 0.0)}, "Viewer.record": {},
    "Viewer.remove_camera": {"name": "a"}, "Viewer.remove_plot": {"name": "a"}, "Viewer.show": {"open": False},
    "Viewer.step": {},
    "Hand.close": {}, "Hand.gap": {},
    "Hand.joint_angles": {"width": 0.05}, "Hand.move": {"width": 0.05}, "Hand.open": {},
    "Hand.volume": {}, "HeadCameras.camera": {"name": "head_left"}, "HeadCameras.look_from": None,
    "Humanoid.angle_vector": {}, "Humanoid.camera": {}, "Humanoid.checked_angles": {"angles": {"head_1_joint": 0.1}},
    "Humanoid.enter": {"world": lambda r: nuno.World(device="cpu")}, "Humanoid.frame_index": {"frame": "torso_2_link"},
    "Humanoid.frame_pose": {"frame": "torso_2_link"}, "Humanoid.joint_index": {"joint": "head_1_joint"},
    "Humanoid.reach": {"targets": {"left_hand": POINT}}, "Humanoid.stand": {},
    "Humanoid.take_configuration": {"q": lambda r: r.robot.configuration()},
    "RobotInterface.angle_vector": {},
    "RobotInterface.angle_vector_duration": {
        "start_av": lambda r: r.robot.angle_vector(), "end_av": lambda r: r.robot.angle_vector(),
    },
    "RobotInterface.angle_vector_from_names": {"angles": {"head_1_joint": 0.1}},
    "RobotInterface.angle_vector_sequence": {"avs": lambda r: [r.robot.angle_vector()]},
    "RobotInterface.camera_info": {}, "RobotInterface.cancel_angle_vector": {}, "RobotInterface.force_vector": {},
    "RobotInterface.go_pos": {}, "RobotInterface.go_stop": {}, "RobotInterface.go_velocity": {},
    "RobotInterface.is_interpolating": {}, "RobotInterface.moment_vector": {},
    "RobotInterface.move_gripper": {"arm": "larm", "pos": 0.05}, "RobotInterface.move_to": {"coords": (
        lambda r: nuno.Coordinates())},
    "RobotInterface.move_trajectory": {"x": 0.0, "y": 0.0, "yaw": 0.0}, "RobotInterface.read_wrench": {"frame": "no"},
    "RobotInterface.send_velocity": {"x": 0.0, "y": 0.0, "yaw": 0.0}, "RobotInterface.sleep": {"seconds": 0.0},
    "RobotInterface.start_grasp": {}, "RobotInterface.stop_grasp": {}, "RobotInterface.stop_motion": {},
    "RobotInterface.sub_angle_vector": {
        "v0": lambda r: r.robot.angle_vector(), "v1": lambda r: r.robot.angle_vector(),
    },
    "RobotInterface.wait_interpolation": {}, "RobotInterface.wait_until": {"condition": lambda r: (lambda: True)},
    "RobotInterface.zmp_vector": {}, "RobotInterface.add_controller": {"controller_type": "default_controller"},
    "RobotInterface.send_trajectory": None,
    "SimulatedRobot.servo": {"command": None}, "SimulatedRobot.set_up": {},
    "Sensors.read": {}, "Links.follow": {"seconds": 0.0}, "Links.offset_of": {"k": 0},
    "Walk.configuration_at": {"time": 0.5}, "Walk.state_at": {"time": 0.5},
}  # fmt: skip
# The object whose method is called
OWNERS = {
    "Body": lambda s: s.towel, "Camera": lambda s: s.camera, "Cloth": lambda s: nuno.Cloth(),
    "CalibrationBoard": lambda s: nuno.CalibrationBoard(),
    "EngineComparison": lambda s: nuno.EngineComparison(
        ("nuno", "mujoco"), {"nuno": s.recording, "mujoco": s.recording}, ("towel",), {"nuno": 0.0, "mujoco": 0.0}
    ),
    "Garment": lambda s: s.sock, "HoldResult": lambda s: s.hold,
    "Coordinates": lambda s: s.table, "Film": lambda s: s.film, "Follower": lambda s: s.follower,
    "Grip": lambda s: s.grip, "Joint": lambda s: s.hinge,
    "HandPath": lambda s: s.hand, "JointTrajectory": lambda r: r.trajectory, "Layers": lambda s: s.layers,
    "Knots": lambda s: nuno.Knots([0.0, 0.0, 0.0], [POINT], 1.0),
    "Path": lambda s: s.path, "Recording": lambda s: s.recording, "Snapshot": lambda s: s.snapshot,
    "SweepResult": lambda s: s.result, "Viewer": lambda s: s.viewer, "Picture": lambda s: s.picture,
    "HandTrack": lambda s: nuno.HandTrack(np.zeros(1), np.zeros((1, 3)), np.zeros((1, 2)), np.ones(1, bool), ()),
    "StereoTrack": lambda s: nuno.StereoTrack(
        np.zeros(1), np.zeros((1, 3)), np.zeros((1, 3, 3)), np.ones(1, bool), ()
    ),
    "Minimum": lambda s: nuno.Minimum({"x": 0.5}, 0.0, {}, (), {"x": np.zeros(2)}, np.zeros(2), "", ()),
    "Names": lambda s: nuno.Names(), "SurfacePoints": lambda s: s.points, "World": lambda s: s.world,
    "Hand": lambda r: r.hand, "HeadCameras": lambda r: r.cameras, "Humanoid": lambda r: r.robot,
    "RobotInterface": lambda r: r.driver, "SimulatedRobot": lambda r: r.driver, "Sensors": lambda r: r.sensors,
    "Links": lambda r: r.links, "Walk": lambda r: r.walk,
}  # fmt: skip
OF_ROBOTS = {
    "Hand", "HeadCameras", "Humanoid", "JointTrajectory.of", "Links", "RobotInterface", "RobotServer", "Sensors",
    "Ros1Driver", "Ros2Server", "SimulatedRobot", "Stride.of", "TowelPicker", "Walk", "WireRobot", "continue_walk",
    "describe_robot", "plan_walk", "plan_walk_footsteps", "plan_walk_velocity", "stop_walk",
}  # fmt: skip
# Properties that are set
SETTERS = {"Body": ("color", "friction", "group", "collides_with"), "Joint": ("friction", "limits", "motor", "spring")}
# What is not called, by why; a name stands for those that it begins with a star
UNCALLED = {
    "records that the package makes, for callers to read": (
        "ArmTracks",
        "CarryResult",
        "CarryTrial",
        "Calibration",
        "Capture",
        "ContactPoints*",
        "Drawing",
        "ElementState",
        "EngineComparison",
        "Film",
        "FoldCase",
        "FoldResult",
        "Garment",
        "Followed",
        "Follower",
        "Grip",
        "HandTrack",
        "HoldResult",
        "Holds",
        "FoundShape",
        "Grip",
        "HandTrack",
        "ImageQuality",
        "ImprovedFold",
        "Joint",
        "Layers",
        "LiftResult",
        "LoadedScene",
        "Material",
        "MaterialFit",
        "Minimum",
        "PickResult",
        "Picture",
        "Plan",
        "PlayedFold",
        "Reach",
        "Readings",
        "Replanned",
        "Resolution",
        "SceneReport*",
        "Snapshot",
        "StereoPoints",
        "StereoTrack",
        "SweepResult",
        "TaughtFold",
        "Trial",
        "Walk",
        "Tetrahedra*",
        "Goal*",
        "RobotInterface",
    ),
    "of results that take minutes to make; their own tests refuse what they must": (
        "ArmTracks.*",
        "CarryResult.*",
        "FoldResult.*",
        "PickResult.save",
        "TaughtFold.from_replay",
        "TaughtFold.of",
        "TaughtFold.on",
        "TowelPicker.*",
        "Footage.watch",
    ),
    "of a camera that is not plugged in": ("UsbCamera.*",),
    "between the parts of the package, with checked numbers": (
        "Grip.lead",
        "Grip.release_in",
        "Joint.release_in",
        "HoldResult.of",
        "Grip.spec_for",
        "Joint.lead",
        "Links.poses_at",
        "SimulatedRobot.imagined",
        "SimulatedRobot.take_future",
        "SimulatedRobot.future_commands",
        "SimulatedRobot.follow_grips",
        "Hand.hold_on",
        "Hand.take_grips",
        "Joint.spec_for",
        "Path.keys_around",
        "Walk.ensure",
        "Walk.sampled",
        "Walk.states_at",
        "Humanoid.move_to",
        "Humanoid.angles_of",
        "Humanoid.configuration_of",
        "*.same_as",
        "*.resolved",
        "Names.state_of",
        "Names.status_of",
        "Names.trajectory_of",
    ),
    "the side of the robot, which tests/robot/conformance.py calls": (
        "*.cancel_trajectories",
        "*.has_controller",
        "*.is_busy",
        "*.read_*",
        "*.send_*",
        "*.show_on",
        "*.begin_frame",
        "*.load",
        "*.update_robot_state",
        "*.image",
        "*.depth",
        "*.camera_info",
        "*.go_pos_unsafe",
        "*.is_moving",
        "*.move_to_send",
        "*.move_to_wait",
        "RobotServer.join",
        "Ros2Server.join",
        "SimulatedRobot.sleep",
        "SimulatedRobot.wait_until",
        "WireRobot.*",
        "*.dissoc",
        "HeadCameras.look_from",
    ),
}
