"""URDF files as scenes, by Pinocchio's parser (the extra ``robot``): links and joints, no robot's program."""

from __future__ import annotations

import xml.etree.ElementTree as xml
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from nuno.errors import FileFormatError, MeshError, NunoError
from nuno.joints.joint_drives import Spring
from nuno.materials import Rigid
from nuno.scenes.bare_body import BARE, whole_body
from nuno.scenes.scene_description import SceneBody, SceneDescription, SceneJoint
from nuno.shapes import quaternion as quat
from nuno.shapes.mass_properties import MassProperties
from nuno.shapes.shape import Hull, Shape, Sphere, TriangleMesh

SIMPLE, COARSE = 1e-3, 0.005
"""[m] By how much a hull may be smaller than that of the mesh, and no more than that share of its size."""
LIGHTEST = 1e-3
"""[kg] Of a link that moves and is said to have no mass."""
GRAY = (0.6, 0.6, 0.6)
Part = tuple[Shape, np.ndarray, np.ndarray]


def read_urdf(path: Path, folders: Sequence[Path], fixed_base: bool) -> SceneDescription:
    """Return the scene of a URDF file: what is fixed to each other is one body.

    Args:
        path: The file.
        folders: Where ``package://`` names are looked up, besides the folders above the file.
        fixed_base: Whether the root link stands still.

    Raises:
        MissingPackageError: Pinocchio is not installed.
        FileFormatError: no URDF.
        MeshError: a mesh that is not there or cannot be read.
    """
    from nuno.robot.pinocchio import pin

    try:
        tree = xml.parse(path).getroot()
        if tree.tag != "robot":
            raise FileFormatError(f"{str(path)!r} is no URDF: its root is <{tree.tag}>, not <robot>")
        model = pin.buildModelFromUrdf(str(path)) if fixed_base else pin.buildModelFromUrdf(
            str(path), pin.JointModelFreeFlyer()
        )  # fmt: skip
    except (xml.ParseError, ValueError, RuntimeError) as error:
        if isinstance(error, NunoError):
            raise
        raise FileFormatError(f"Pinocchio cannot read {str(path)!r}: {' '.join(str(error).split())}") from error
    return UrdfReader(pin, model, tree, path, folders).scene


class UrdfReader:
    """Reads one model.

    Attributes:
        scene: The scene.
    """

    def __init__(self, pin: Any, model: Any, tree: Any, path: Path, folders: Sequence[Path]) -> None:
        self.pin, self.model, self.tree, self.path = pin, model, tree, path
        self.scene, self.data = SceneDescription(), model.createData()
        self._folders = [str(folder) for folder in [*folders, *path.resolve().parents]]
        self.q = self._start()
        pin.forwardKinematics(model, self.data, self.q)
        self.links = self._links()
        self._add_bodies()
        for joint in range(1, model.njoints):
            self._add_joint(joint)
        self._tell()
        self._part_overlapping()

    def _start(self) -> np.ndarray:
        """Return the neutral configuration, within the limits."""
        model = self.model
        q = np.array(self.pin.neutral(model))
        for joint in range(1, model.njoints):
            if model.nqs[joint] == 1:
                k = model.idx_qs[joint]
                low, high = model.lowerPositionLimit[k], model.upperPositionLimit[k]
                if low <= high and not low <= q[k] <= high:
                    q[k] = np.clip(q[k], low, high)
                    self.scene.note("joints that cannot be at 0 begin at a limit", str(model.names[joint]))
        return q

    def _links(self) -> dict[int, str]:
        """By each joint, the name of the first link that it carries."""
        found: dict[int, str] = {}
        for frame in self.model.frames:
            if frame.type == self.pin.FrameType.BODY and frame.name != "universe":
                found.setdefault(int(frame.parentJoint), str(frame.name))
        for joint in range(1, self.model.njoints):
            found.setdefault(joint, str(self.model.names[joint]))
        return found

    def _add_bodies(self) -> None:
        parts = self._parts("COLLISION")
        bare = [joint for joint in range(1, self.model.njoints) if joint not in parts]
        seen = self._parts("VISUAL") if bare and self.tree.find(".//visual") is not None else {}
        colors = self._colors()
        for joint in range(self.model.njoints):
            own, touches = parts.get(joint, []), joint in parts
            if joint == 0 and not touches:
                continue
            if not touches and joint in seen:
                own = seen[joint]
                self.scene.note("bodies that touch nothing are there to be seen", self.links[joint])
            elif not touches:
                self.scene.note("links without a shape are balls of 1 cm that touch nothing", self.links[joint])
            name = self.links.get(joint, "base")
            placement = self.data.oMi[joint]
            turn = np.roll(self.pin.Quaternion(placement.rotation).normalized().coeffs(), 1)
            body = SceneBody(
                name, Sphere(BARE), np.array(placement.translation), turn, None if joint == 0 else Rigid(),
                colors.get(name, GRAY), group=int(touches), collides_with=0xFFFFFFFF if touches else 0,
            )  # fmt: skip
            shapes = own or [(Sphere(BARE), np.zeros(3), quat.IDENTITY)]
            self.scene.bodies.append(whole_body(body, shapes, None if joint == 0 else self._mass(joint)))

    def _parts(self, kind: str) -> dict[int, list[Part]]:
        """By each joint, the shapes that it carries; of what moves, meshes are their convex hulls."""
        from nuno.robot.link_geometry import shape_of

        try:
            geometry = self.pin.buildGeomFromUrdf(
                self.model, str(self.path), getattr(self.pin.GeometryType, kind), package_dirs=self._folders
            )
        except (ValueError, RuntimeError) as error:
            raise MeshError(
                f"a mesh of {str(self.path)!r} cannot be read; package_dirs says where packages are: "
                f"{' '.join(str(error).split())}"
            ) from error
        read = {str(part.name).rpartition("_")[0] for part in geometry.geometryObjects}
        for link in self.tree.findall("link"):
            if link.find(kind.lower()) is not None and link.get("name") not in read:
                self.scene.note(
                    f"{kind.lower()} shapes that Pinocchio does not read are left out", str(link.get("name"))
                )
        found: dict[int, list[Part]] = {}
        for part in geometry.geometryObjects:
            joint = int(part.parentJoint)
            try:
                shape, offset = shape_of(part, joint > 0)
                if joint > 0 and isinstance(shape, TriangleMesh):
                    shape, offset = self._simple(shape, joint)
            except (NunoError, ValueError, RuntimeError) as error:
                self.scene.note(f"geometry that cannot be used is left out ({error})", str(part.name))
                continue
            own = part.placement
            turn = np.roll(self.pin.Quaternion(own.rotation).normalized().coeffs(), 1)
            found.setdefault(joint, []).append((shape, own.translation + own.rotation @ offset, turn))
        return found

    def _simple(self, mesh: TriangleMesh, joint: int) -> tuple[Shape, np.ndarray]:
        """Return a hull of few corners, and where its centre is."""
        from nuno.robot.link_geometry import few_corners

        points = np.asarray(mesh.vertices)
        hull = Hull.of(few_corners(points, min(SIMPLE, COARSE * float(np.ptp(points, axis=0).max()))))
        self.scene.note("a mesh that moves is touched as its convex hull, to a millimetre", self.links[joint])
        return hull, hull.centre

    def _mass(self, joint: int) -> MassProperties:
        own = self.model.inertias[joint]
        if own.mass < LIGHTEST:
            self.scene.note(f"links without mass have {LIGHTEST} kg", self.links[joint])
        return MassProperties(max(float(own.mass), LIGHTEST), np.array(own.lever), np.array(own.inertia))

    def _add_joint(self, joint: int) -> None:
        model, scene = self.model, self.scene
        name, kind = str(model.names[joint]), str(model.joints[joint].shortname())
        if kind == "JointModelFreeFlyer":
            return
        made = self.data.joints[joint] if hasattr(self.data, "joints") else model.joints[joint].createData()
        model.joints[joint].calc(made, self.q)
        columns = np.array(made.S).reshape(6, -1)
        if columns.shape[1] != 1:
            scene.note(f"joints of type {kind.removeprefix('JointModel')} are left out: the link is free", name)
            return
        slides = np.linalg.norm(columns[:3]) > 0.5
        placement, k, v = self.data.oMi[joint], model.idx_qs[joint], model.idx_vs[joint]
        axis = placement.rotation @ columns[: 3 if slides else 6, 0][-3:]
        parent = int(model.parents[joint])
        there = {body.name for body in scene.bodies}
        other = self.links.get(parent) if self.links.get(parent) in there else None
        found = SceneJoint(
            name, "slider" if slides else "hinge", self.links[joint], other, np.array(placement.translation), axis,
            friction=max(float(model.upperDryFrictionLimit[v]), 0.0),
        )  # fmt: skip
        if model.nqs[joint] == 1:
            found.position = float(self.q[k])
            limits = float(model.lowerPositionLimit[k]), float(model.upperPositionLimit[k])
            if np.isfinite(limits).all() and limits[0] <= limits[1]:
                if slides or (-np.pi <= limits[0] and limits[1] <= np.pi):
                    found.limits = limits
                else:
                    scene.note("limits of hinges beyond half a turn are left out", name)
        if model.damping[v] > 0.0:
            found.spring = Spring(0.0, 0.0, float(model.damping[v]))
        scene.joints.append(found)

    def _colors(self) -> dict[str, tuple[float, float, float]]:
        """By link, the colour of its first visual that has one."""
        given = {each.get("name"): each.find("color") for each in self.tree.findall("material")}
        named = {name: color for name, color in given.items() if color is not None}
        found = {}
        for link in self.tree.findall("link"):
            for material in link.findall("visual/material"):
                color = material.find("color")
                color = named.get(material.get("name")) if color is None else color
                if color is not None:
                    red, green, blue = np.clip([float(c) for c in color.get("rgba", "0.6 0.6 0.6 1").split()[:3]], 0, 1)
                    found[link.get("name")] = (float(red), float(green), float(blue))
                    break
        return found

    def _tell(self) -> None:
        """Note what the file has that a scene of links and joints has not."""
        for joint in self.tree.findall("joint"):
            if joint.find("mimic") is not None:
                self.scene.note("mimic joints move on their own", str(joint.get("name")))
        if self.tree.find("transmission") is not None or self.tree.find(".//limit[@effort]") is not None:
            self.scene.note("no joint has a motor until joint.motor is set", "all joints")

    def _part_overlapping(self) -> None:
        """Let bodies that overlap at the start pass through each other: neighbours of neighbours often do."""
        from nuno.scenes.overlaps import overlapping_pairs

        joined = {frozenset((joint.body, joint.other)) for joint in self.scene.joints}
        for a, b in overlapping_pairs(self.scene.bodies):
            if frozenset((a, b)) not in joined:
                self.scene.ignored.append((a, b))
                self.scene.note("links that overlap at the start pass through each other", f"{a} and {b}")
