"""The part of a scene file that only Nuno reads: as JSON, what the format has no word for."""

from __future__ import annotations

import json
from dataclasses import asdict, fields, replace
from typing import Any

import numpy as np

from nuno.errors import FileFormatError, NunoError
from nuno.joints.joint_drives import Motor, Spring
from nuno.materials import Cloth, Rigid, Soft
from nuno.scenes.scene_description import SceneBody, SceneDescription, SceneGrip
from nuno.shapes.shape import Box, Capsule, Cylinder, Hull, Plane, Shape, Sheet, Sphere, TriangleMesh
from nuno.shapes.soft_shape import SoftBox, SoftCapsule, SoftCylinder, SoftMesh, SoftSphere

VERSION = 1
RESTORED: dict[str, Any] = {
    kind.__name__: kind for kind in (Sheet, SoftBox, SoftSphere, SoftCylinder, SoftCapsule, SoftMesh)
}
"""Deformable shapes of which a format holds the vertices alone."""
NATIVE = (Box, Sphere, Cylinder, Capsule, Plane)
"""Shapes that formats have a word for; others with a formula are meshes there."""
ROUNDED = 1e-5
"""Of a shape's size, by how much a mesh of it may come back otherwise."""
MATERIALS: dict[str, Any] = {"Cloth": Cloth, "Soft": Soft, "Rigid": Rigid}


def write_part(scene: SceneDescription, implied: list[tuple[str, str]]) -> str:
    """Return the part.

    Args:
        scene: The scene.
        implied: Pairs that the file excludes from contact for another reason than ``scene.ignored``.
    """
    part = {
        "version": VERSION, "frame_rate": scene.frame_rate, "substeps": scene.substeps,
        "bodies": {body.name: _body_part(scene, body) for body in scene.bodies},
        "joints": {
            joint.name: {
                "max_force": joint.max_force, "friction": joint.friction, "contact": joint.contact,
                "motor": None if joint.motor is None else asdict(joint.motor),
                "spring": None if joint.spring is None else asdict(joint.spring),
                "limits": joint.limits if joint.kind == "ball" else None, "axis": joint.axis,
            }
            for joint in scene.joints
        },
        "grips": [asdict(grip) for grip in scene.grips],
        "ignored": scene.ignored, "implied": implied, "pair_friction": scene.pair_friction,
    }  # fmt: skip
    return json.dumps(part, default=_plain, separators=(",", ":"))


def read_part(scene: SceneDescription, text: str) -> None:
    """Give a scene that was read from a file's own words what its Nuno part says besides.

    Raises:
        FileFormatError: damaged, or of a newer version.
    """
    try:
        part = json.loads(text)
        if part["version"] > VERSION:
            raise FileFormatError(f"the file's Nuno part has version {part['version']}; this Nuno reads {VERSION}")
        scene.frame_rate, scene.substeps = part["frame_rate"], part["substeps"]
        for body in scene.bodies:
            if body.name in part["bodies"]:
                _read_body(scene, body, part["bodies"][body.name])
        for joint in scene.joints:
            said = part["joints"].get(joint.name)
            if said is None:
                continue
            joint.max_force, joint.friction, joint.contact = said["max_force"], said["friction"], said["contact"]
            joint.motor = None if said["motor"] is None else Motor(**said["motor"])
            joint.spring = None if said["spring"] is None else Spring(**said["spring"])
            if joint.kind == "ball":
                joint.limits = None if said["limits"] is None else tuple(said["limits"])
                joint.axis = np.array(said["axis"])
        names = {body.name for body in scene.bodies}
        scene.grips = [
            SceneGrip(**{**grip, "vertices": np.array(grip["vertices"], dtype=int)})
            for grip in part["grips"] if grip["body"] in names and (grip["to"] is None or grip["to"] in names)
        ]  # fmt: skip
        known = {frozenset(pair) for pair in part["implied"] + part["ignored"]}
        own = [tuple(pair) for pair in part["ignored"] if names.issuperset(pair)]
        scene.ignored = [*own, *(pair for pair in scene.ignored if frozenset(pair) not in known)]
        scene.pair_friction = [(a, b, mu) for a, b, mu in part["pair_friction"] if a in names and b in names]
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        if isinstance(error, FileFormatError):
            raise
        raise FileFormatError(f"the file's Nuno part is damaged: {type(error).__name__}: {error}") from error


def _body_part(scene: SceneDescription, body: SceneBody) -> dict[str, Any]:
    part: dict[str, Any] = {
        "color": body.color, "friction": body.friction, "thickness": body.thickness,
        "group": body.group, "collides_with": body.collides_with,
    }  # fmt: skip
    by_formula = body.shape.formula is not None and not isinstance(body.shape, NATIVE)
    if type(body.shape).__name__ in RESTORED or by_formula:
        names = [item.name for item in fields(body.shape) if item.init]  # type: ignore[arg-type]
        part["shape"] = {"kind": type(body.shape).__name__} | {name: getattr(body.shape, name) for name in names}
    elif isinstance(body.shape, Hull):
        part["shape"] = {"kind": "Hull"}
    held = [grip.vertices for grip in scene.grips if grip.body == body.name]
    if held and body.vertices is not None:
        part["held"] = {str(k): body.vertices[k] for k in np.unique(np.concatenate(held))}
    if isinstance(body.material, Rigid):
        part["rigid"] = {"restitution": body.material.restitution, "air_drag": body.material.air_drag}
    elif body.material is not None:
        part["material"] = {"kind": type(body.material).__name__} | _values(body.material)
    return part


def _values(material: Any) -> dict[str, Any]:
    return {item.name: getattr(material, item.name) for item in fields(material)}


def _read_body(scene: SceneDescription, body: SceneBody, part: dict[str, Any]) -> None:
    body.color, body.friction, body.thickness = _color(part["color"]), part["friction"], part["thickness"]
    body.group, body.collides_with = part["group"], part["collides_with"]
    if "shape" in part:
        body.shape = _shape(scene, body, dict(part["shape"]))
    if body.vertices is not None:
        for k, place in part.get("held", {}).items():
            body.vertices[int(k)] = place
    if "rigid" in part and isinstance(body.material, Rigid):
        body.material = replace(body.material, friction=body.friction, **part["rigid"])
    if "material" in part and body.deforms and body.material is not None:
        said = dict(part["material"])
        body.material = MATERIALS[said.pop("kind")](**{name: _array(value) for name, value in said.items()})


def _shape(scene: SceneDescription, body: SceneBody, said: dict[str, Any]) -> Shape:
    kind = said.pop("kind")
    if kind == "Hull":
        if not isinstance(body.shape, TriangleMesh):
            return body.shape
        try:
            return Hull(body.shape.vertices, body.shape.faces)
        except NunoError:
            scene.note("a hull that the file's numbers round to no convex one is a mesh", body.name)
            return body.shape
    by_formula = {each.__name__: each for each in Shape.__subclasses__() if each.formula is not Shape.formula}
    made: Shape = (RESTORED | by_formula)[kind](**{name: _tuple(value) for name, value in said.items()})
    if made.formula is not None and _is_mesh_of(body.shape, made):
        return made
    if body.vertices is None or len(made.mesh()[0]) != len(body.vertices):
        scene.note("its mesh is no longer what Nuno saved, and is taken from the file", body.name)
        return body.shape
    return made


def _is_mesh_of(shape: Shape, made: Shape) -> bool:
    """Return True if a shape is the mesh of another with a formula, about the same origin."""
    points, own = np.sort(shape.mesh()[0], axis=0), np.sort(made.mesh()[0], axis=0)
    return points.shape == own.shape and bool(np.abs(points - own).max() < ROUNDED * np.ptp(own))


def _plain(value: Any) -> Any:
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else str(value)


def _tuple(value: Any) -> Any:
    if isinstance(value, list) and value and isinstance(value[0], list):
        return np.array(value)
    return tuple(value) if isinstance(value, list) else value


def _array(value: Any) -> Any:
    """Return what was an array or (warp, weft) as a tuple of two numbers or as an array."""
    if not isinstance(value, list):
        return value
    if len(value) == 2:
        return tuple(_array(part) for part in value)
    return np.array(value)


def _color(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) else value
