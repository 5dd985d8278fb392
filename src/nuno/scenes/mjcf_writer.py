"""Scenes as MJCF: what MuJoCo reads, with what it has no word for in a text of Nuno's own."""

from __future__ import annotations

import xml.etree.ElementTree as xml
from itertools import combinations
from typing import Any

import numpy as np

from nuno.engines.mujoco.mujoco_bending import sheet_plate
from nuno.materials import Cloth, Rigid
from nuno.mesh.tetrahedra import volumes
from nuno.scenes.build_world import is_rigid
from nuno.scenes.cloth_elasticity import mean_of, plate_of
from nuno.scenes.mjcf_joints import MjcfJoints
from nuno.scenes.mjcf_text import numbers
from nuno.scenes.nuno_part import write_part
from nuno.scenes.rest_place import placed_rest
from nuno.scenes.scene_description import SceneBody, SceneDescription
from nuno.scenes.scene_tree import joint_tree
from nuno.scenes.shape_parts import parts_of
from nuno.shapes import quaternion as quat
from nuno.shapes.color import rgb
from nuno.shapes.compound import Compound
from nuno.shapes.coordinates import compose, invert
from nuno.shapes.shape import Box, Capsule, Cylinder, Hull, Plane, Shape, Sheet, Sphere

KEY = "nuno"
"""Name of the key frame and of the text."""
FLAT = 1e-5
"""Of a mesh's size, how far its vertices are from a plane at least if they have a hull."""
MASK = 0x7FFFFFFF
"""MuJoCo's masks of contact groups are signed."""


def write_mjcf(scene: SceneDescription) -> str:
    """Return a scene as the text of an MJCF file; what MuJoCo lacks is noted in the scene."""
    return MjcfWriter(scene).text()


class MjcfWriter:
    """Writes one scene."""

    def __init__(self, scene: SceneDescription) -> None:
        free_names(scene)
        self.scene, self.tree = scene, joint_tree(scene)
        self.root = xml.Element("mujoco", model="nuno")
        xml.SubElement(self.root, "compiler", angle="radian", autolimits="true", boundmass="0", boundinertia="0")
        xml.SubElement(self.root, "option", gravity=numbers(scene.gravity))
        xml.SubElement(self.root, "size", memory="64M")
        self.asset = xml.SubElement(self.root, "asset")
        self.ground = xml.SubElement(self.root, "worldbody")
        self.qpos: list[float] = []
        self.qvel: list[float] = []
        self.joints = MjcfJoints(scene, self.tree, self.root)
        self.bodies = {body.name: body for body in scene.bodies}

    def text(self) -> str:
        """Return the file's text."""
        static = [body for body in self.scene.bodies if not is_rigid(body) and not body.deforms]
        for body in static:
            self._body(self.ground, body, None)
        for name in self.tree.children(None):
            self._body(self.ground, self.bodies[name], None)
        for body in self.scene.bodies:
            if body.deforms and not is_rigid(body):
                self._flex(body)
        implied = self._contacts()
        self.joints.close()
        custom = xml.SubElement(self.root, "custom")
        xml.SubElement(custom, "text", name=KEY, data=write_part(self.scene, implied))
        key = {"qpos": numbers(self.qpos), "qvel": numbers(self.qvel), "ctrl": numbers(self.joints.controls)}
        if any(key.values()):
            frame = xml.SubElement(self.root, "keyframe")
            xml.SubElement(frame, "key", {"name": KEY} | {name: text for name, text in key.items() if text})
        if not len(self.asset):
            self.root.remove(self.asset)
        xml.indent(self.root)
        return xml.tostring(self.root, encoding="unicode") + "\n"

    def _body(self, parent: xml.Element, body: SceneBody, above: SceneBody | None) -> None:
        pose = (body.position, body.quaternion)
        if above is not None:
            pose = compose(invert((above.position, above.quaternion)), pose)
        element = xml.SubElement(parent, "body", name=body.name, pos=numbers(pose[0]), quat=numbers(pose[1]))
        if is_rigid(body):
            self._motion(element, body)
            material: Any = body.material
            xml.SubElement(
                element, "inertial", pos=numbers(material.centre_of_mass), mass=numbers([material.mass]),
                fullinertia=numbers(material.inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]),
            )  # fmt: skip
            self._tell_what_is_lost(body)
        for k, (shape, place, turn) in enumerate(parts_of(body.shape)):
            name = body.name if not isinstance(body.shape, Compound) else f"{body.name}/{k}"
            self._geom(element, body, name, shape, place, turn)
        for child in self.tree.children(body.name):
            self._body(element, self.bodies[child], body)

    def _motion(self, element: xml.Element, body: SceneBody) -> None:
        """Write the joint that moves a body, and its present position and velocity."""
        joint = self.tree.joint.get(body.name)
        if joint is not None:
            qpos, qvel = self.joints.write(element, body, joint, self.bodies)
            self.qpos += qpos
            self.qvel += qvel
            return
        xml.SubElement(element, "freejoint", name=f"{body.name}/free")
        material: Any = body.material
        spin = np.zeros(3) if body.angular_velocity is None else body.angular_velocity
        velocity = np.zeros(3) if body.velocity is None else body.velocity
        velocity = velocity - np.cross(spin, quat.rotate(body.quaternion, material.centre_of_mass))
        self.qpos += [*body.position, *body.quaternion]
        self.qvel += [*velocity, *quat.rotate(quat.inverse(body.quaternion), spin)]

    def _geom(
        self, element: xml.Element, body: SceneBody, name: str, shape: Shape, place: np.ndarray, turn: np.ndarray
    ) -> None:
        said = {
            "name": name, "pos": numbers(place), "quat": numbers(turn), "rgba": self._rgba(body),
            "friction": numbers([body.friction, 0.005, 0.0001]), "contype": str(body.group & MASK),
            "conaffinity": str(body.collides_with & MASK),
        }  # fmt: skip
        if isinstance(shape, Box):
            said |= {"type": "box", "size": numbers(0.5 * np.array(shape.size))}
        elif isinstance(shape, Sphere):
            said |= {"type": "sphere", "size": numbers([shape.radius])}
        elif isinstance(shape, Cylinder | Capsule):
            said |= {"type": shape.kind, "size": numbers([shape.radius, 0.5 * shape.height])}
        elif isinstance(shape, Plane):
            said |= {"type": "plane", "size": "0 0 1"}
        else:
            said |= {"type": "mesh", "mesh": name}
            vertices, faces = shape.mesh()
            if is_flat(vertices):
                self.scene.note("a flat mesh has a hull of some depth for MuJoCo", body.name)
                vertices = np.vstack([vertices, out_of_plane(vertices)])
            xml.SubElement(
                self.asset, "mesh", name=name, vertex=numbers(np.ravel(vertices)),
                face=" ".join(map(str, np.ravel(faces))), inertia="exact" if shape.is_solid else "shell",
            )  # fmt: skip
            if not isinstance(shape, Hull) and not is_rigid(body):
                self.scene.note("a mesh is touched as its convex hull by MuJoCo", body.name)
        xml.SubElement(element, "geom", said)

    def _flex(self, body: SceneBody) -> None:
        """Write a cloth or soft body in its rest shape, and its present shape into the key frame."""
        assert body.vertices is not None
        material: Any = body.material
        pinned = self._pinned(body)
        rest, elements = placed_rest(body, pinned)
        if material is None:
            rest = body.vertices
        stiffer = 1.0
        if isinstance(material, Cloth) and isinstance(body.shape, Sheet):
            elements, stiffer = sheet_plate(body.shape)
        flex = xml.SubElement(
            self.ground, "flexcomp", name=body.name, type="direct", dim=str(elements.shape[1] - 1),
            point=numbers(np.ravel(rest)), element=" ".join(map(str, np.ravel(elements))), rgba=self._rgba(body),
        )  # fmt: skip
        passes_itself = (body.name, body.name) in self.scene.ignored
        touching = {
            "contype": str(body.group & MASK), "conaffinity": str(body.collides_with & MASK),
            "friction": numbers([body.friction, 0.005, 0.0001]),
            "selfcollide": "none" if passes_itself or not body.shape.is_cloth else "auto",
        }  # fmt: skip
        if material is None:
            flex.set("rigid", "true")
            flex.set("mass", "1")
            flex.set("radius", numbers([0.5 * body.thickness or 1e-4]))
            xml.SubElement(flex, "contact", touching)
            return
        if isinstance(material, Cloth):
            plate = plate_of(material, stiffer)
            corners = rest[elements]
            area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum()
            mass, radius = 0.5 * area * mean_of(material.area_density), 0.5 * mean_of(material.thickness)
            elastic = {
                "young": numbers([plate.youngs_modulus]), "poisson": numbers([plate.poisson_ratio]),
                "thickness": numbers([plate.thickness]), "elastic2d": "both",
            }  # fmt: skip
            if not plate.exact:
                self.scene.note("a cloth is an even plate to MuJoCo, with another shear or the mean of its values",
                                body.name)  # fmt: skip
        else:
            mass, radius = float(np.abs(volumes(rest, elements)).sum()) * mean_of(material.density), 1e-4
            elastic = {
                "young": numbers([mean_of(material.youngs_modulus)]),
                "poisson": numbers([mean_of(material.poisson_ratio)]),
            }  # fmt: skip
        flex.set("mass", numbers([mass]))
        flex.set("radius", numbers([radius]))
        xml.SubElement(flex, "contact", touching)
        if np.any(material.damping):
            elastic["damping"] = numbers([mean_of(material.damping)])
        xml.SubElement(flex, "elasticity", elastic)
        if np.any(material.air_drag):
            self.scene.note("air drag is read by Nuno alone", body.name)
        if len(pinned):
            xml.SubElement(flex, "pin", id=" ".join(map(str, pinned)))
            if np.linalg.norm((body.vertices - rest)[pinned], axis=1).max() > 1e-3:
                self.scene.note("held vertices are up to some mm elsewhere to MuJoCo, as the rest shape has them",
                                body.name)  # fmt: skip
        free = np.setdiff1d(np.arange(len(rest)), pinned)
        self.qpos += np.ravel((body.vertices - rest)[free]).tolist()
        velocities = np.zeros_like(rest) if body.velocities is None else body.velocities
        self.qvel += np.ravel(velocities[free]).tolist()

    def _pinned(self, body: SceneBody) -> np.ndarray:
        """Return the vertices that are held in the world, (k,) int."""
        held = [grip.vertices for grip in self.scene.grips if grip.body == body.name and self._stands(grip.to)]
        if any(grip.body == body.name and not self._stands(grip.to) for grip in self.scene.grips):
            self.scene.note("a grip by a body that moves is read by Nuno alone", body.name)
        return np.unique(np.concatenate(held)) if held else np.zeros(0, dtype=int)

    def _stands(self, name: str | None) -> bool:
        return name is None or (not is_rigid(self.bodies[name]) and self.bodies[name].material is None)

    def _contacts(self) -> list[tuple[str, str]]:
        """Write pairs of bodies that do not touch; return those that do not for their groups or joints."""
        solid = [body for body in self.scene.bodies if not body.deforms or is_rigid(body)]
        implied = []
        for a, b in combinations(solid, 2):
            either = bool(a.group & b.collides_with & MASK) or bool(b.group & a.collides_with & MASK)
            both = bool(a.group & b.collides_with) and bool(b.group & a.collides_with)
            if either and not both:
                implied.append((a.name, b.name))
        implied += [(joint.body, joint.other) for joint in self.scene.joints if joint.other and not joint.contact]
        names = {body.name for body in solid}
        pairs = [pair for pair in self.scene.ignored if pair[0] != pair[1]]
        for pair in pairs:
            if not names.issuperset(pair):
                self.scene.note("a cloth or soft body that passes through another does so for Nuno alone",
                                " and ".join(pair))  # fmt: skip
        together = {frozenset(pair): pair for pair in [*implied, *pairs] if names.issuperset(pair)}
        if together:
            contact = xml.SubElement(self.root, "contact")
            for first, second in together.values():
                xml.SubElement(contact, "exclude", body1=first, body2=second)
        for first, second, _ in self.scene.pair_friction:
            self.scene.note("the friction of a pair is read by Nuno alone", f"{first} and {second}")
        frictions = {body.friction for body in self.scene.bodies}
        if len(frictions) > 1:
            self.scene.note("the friction of two bodies is the larger one to MuJoCo, to Nuno the geometric mean",
                            "bodies of different friction")  # fmt: skip
        return implied

    def _tell_what_is_lost(self, body: SceneBody) -> None:
        assert isinstance(body.material, Rigid)
        if body.material.restitution:
            self.scene.note("restitution is read by Nuno alone", body.name)
        if body.material.air_drag:
            self.scene.note("air drag is read by Nuno alone", body.name)

    def _rgba(self, body: SceneBody) -> str:
        return numbers([*rgb("gray" if body.color is None else body.color), 1.0])


def free_names(scene: SceneDescription) -> None:
    """Rename bodies whose names are MuJoCo's: "world", and those that it gives to a flex's vertices ("towel_1")."""
    flexes = [body.name for body in scene.bodies if body.deforms and not is_rigid(body)]
    taken = {body.name for body in scene.bodies}
    for body in scene.bodies:
        stem, _, number = body.name.rpartition("_")
        of_vertex = stem in flexes and number.isdecimal() and body.name not in flexes
        if body.name == "world" or of_vertex:
            name = f"{body.name} body"
            while name in taken:
                name += "'"
            taken.add(name)
            scene.note("a name that MuJoCo gives itself is changed", f"{body.name} to {name}")
            scene.rename(body.name, name)


def is_flat(vertices: np.ndarray) -> bool:
    """Return True if all vertices (n, 3) lie in a plane, of which MuJoCo makes no hull."""
    spread = np.linalg.svd(vertices - vertices.mean(axis=0), compute_uv=False)
    return bool(spread[2] < FLAT * spread[0])


def out_of_plane(vertices: np.ndarray) -> np.ndarray:
    """Return a point (3,) off the middle of vertices in a plane, which belongs to no face."""
    middle = vertices.mean(axis=0)
    _, sizes, axes = np.linalg.svd(vertices - middle, full_matrices=False)
    return np.asarray(middle + 1e-3 * sizes[0] * axes[2])
