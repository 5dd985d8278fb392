"""Rigid and static bodies of a USD stage."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from nuno.errors import NunoError
from nuno.materials import Rigid
from nuno.scenes.bare_body import BARE, whole_body
from nuno.scenes.scene_description import SceneBody, SceneDescription
from nuno.scenes.usd_package import BODY
from nuno.scenes.usd_shapes import usd_shape
from nuno.scenes.usd_stage import UsdStage
from nuno.shapes import quaternion as quat
from nuno.shapes.coordinates import compose, invert
from nuno.shapes.mass_properties import MassProperties, joined, mass_properties
from nuno.shapes.shape import Shape, Sphere

WATER = 1000.0
"""[kg/m3] UsdPhysics' density of what says none."""
Part = tuple[Any, Shape, np.ndarray, np.ndarray]
"""A prim, its shape, and where that is in the body."""


class UsdBodies:
    """Adds a stage's bodies to a scene.

    Attributes:
        names: By each prim's path, the name of the body that it is.
    """

    def __init__(self, scene: SceneDescription, stage: UsdStage) -> None:
        self.scene, self.stage = scene, stage
        self.names: dict[str, str] = {}
        self.bodies: dict[str, SceneBody] = {}
        self._gprims = [prim for prim in stage.prims if prim.IsA(stage.usd.UsdGeom.Gprim)]

    def add(self, deforming: set[str]) -> None:
        """Add all bodies, but prims whose paths are those of cloth and soft bodies."""
        stage, physics = self.stage, self.stage.usd.UsdPhysics
        own: dict[str, list[Any]] = {}
        alone = []
        bare = not any(prim.HasAPI(physics.CollisionAPI) or stage.is_rigid(prim) for prim in stage.prims)
        if bare and self._gprims and not deforming:
            self.scene.note("a stage without physics is static bodies", stage.path.name)
        for prim in self._gprims:
            if str(prim.GetPath()) in deforming:
                continue
            body = stage.body_of(prim)
            if body is not None:
                own.setdefault(str(body.GetPath()), []).append(prim)
            elif bare or prim.HasAPI(physics.CollisionAPI):
                alone.append(prim)
            else:
                self.scene.note("geometry that is only seen is left out", prim.GetName())
        for prim in stage.prims:
            path = str(prim.GetPath())
            if path in own or stage.is_rigid(prim):
                self._add(prim, own.get(path, []), bare)
            elif prim in alone:
                self._add(prim, [prim], bare)

    def name_for(self, prim: Any) -> str:
        """Return a name for a body that no other has: the prim's, or its path where that is taken."""
        name = prim.GetDisplayName() or prim.GetName()
        taken = {body.name for body in self.scene.bodies}
        return name if name not in taken else str(prim.GetPath())[1:]

    def _add(self, prim: Any, gprims: list[Any], bare: bool) -> None:
        stage, scene = self.stage, self.scene
        name = self.name_for(prim)
        is_rigid = stage.is_rigid(prim)
        moves = is_rigid and not bool(stage.value(prim, "physics:kinematicEnabled", False))
        if is_rigid and not moves:
            scene.note("a kinematic body is static: world.move leads it", name)
        pose, scale, sheared = stage.frame(prim)
        if not scale.all():
            scene.note("bodies of no size are left out", name)
            return
        if sheared:
            scene.note("sheared axes are taken as right angles", name)
        parts = self._parts(gprims, name, pose, moves)
        api = stage.usd.UsdPhysics.CollisionAPI
        touching = [part for part in parts if part[0].HasAPI(api)]
        if touching and len(touching) < len(parts):
            scene.note("geometry that is only seen is left out", name)
        used = touching or parts
        if not used and not moves:
            return
        if not used:
            scene.note("bodies without a shape are balls of 1 cm that touch nothing", name)
        elif not touching and not bare and not prim.GetCustomDataByKey(BODY):
            scene.note("bodies that touch nothing are there to be seen", name)
        body = self._body(prim, name, pose, used, bool(touching) or (bare and bool(parts)), moves, scale)
        scene.bodies.append(body)
        self.bodies[str(prim.GetPath())] = body
        self.names[str(prim.GetPath())] = name
        for gprim in gprims:
            self.names[str(gprim.GetPath())] = name

    def _parts(self, gprims: list[Any], name: str, pose: Any, moves: bool) -> list[Part]:
        found: list[Part] = []
        for prim in gprims:
            try:
                made = usd_shape(self.scene, self.stage, prim, prim.GetName(), moves)
            except NunoError as error:
                self.scene.note(f"geometry that cannot be used is left out ({error})", f"{name}/{prim.GetName()}")
                continue
            if made is not None:
                found.append((prim, made[0], *compose(invert(pose), made[1])))
        return found

    def _body(
        self, prim: Any, name: str, pose: Any, parts: list[Part], touches: bool, moves: bool, scale: np.ndarray
    ) -> SceneBody:
        stage, scene = self.stage, self.scene
        friction, restitution = 0.5, 0.0
        for k, (gprim, *_) in enumerate(parts):
            material = stage.bound_material(gprim, "physics")
            mu = None if material is None else stage.value(material, "physics:dynamicFriction")
            if mu is not None:
                if k and float(mu) != friction:
                    scene.note("geometry of one body has one friction, that of its last part", name)
                friction, restitution = float(mu), float(stage.value(material, "physics:restitution", 0.0))
        enabled = touches and any(stage.value(part[0], "physics:collisionEnabled", True) for part in parts)
        color = stage.color(parts[0][0]) if parts else None
        shapes = [(shape, place, turn) for _, shape, place, turn in parts] or [
            (Sphere(BARE), np.zeros(3), quat.IDENTITY)
        ]
        mass = self._mass(prim, parts, scale, name) if moves else None
        material = Rigid(friction=friction, restitution=min(restitution, 1.0)) if moves else None
        body = SceneBody(name, shapes[0][0], pose[0], pose[1], material, color, friction)
        if not enabled:
            body.group = body.collides_with = 0
        body = whole_body(body, shapes, mass)
        if moves:
            body.velocity = self._vector(prim, "physics:velocity", pose, stage.unit)
            body.angular_velocity = self._vector(prim, "physics:angularVelocity", pose, np.pi / 180.0)
        return body

    def _vector(self, prim: Any, name: str, pose: Any, unit: float) -> np.ndarray | None:
        given = np.array(self.stage.value(prim, name, (0.0, 0.0, 0.0)), dtype=float)
        return unit * quat.rotate(pose[1], given) if given.any() else None

    def _mass(self, prim: Any, parts: list[Part], scale: np.ndarray, name: str) -> MassProperties:
        """Return mass (as the volume), centre and inertia in the body's frame, as UsdPhysics says they are found."""
        stage = self.stage
        per_volume = stage.mass_unit / stage.unit**3
        density = float(stage.value(prim, "physics:density", 0.0))
        pieces = [self._piece(part, density, per_volume, name) for part in parts]
        own = joined(pieces) if pieces else MassProperties(1.0, np.zeros(3), 1e-4 * np.eye(3))
        given = float(stage.value(prim, "physics:mass", 0.0)) * stage.mass_unit
        if given > 0.0:
            own = replace(own, volume=given, inertia=own.inertia * (given / own.volume))
        elif not pieces:
            self.scene.note("a body without mass and shape has 1 kg", name)
        centre = np.array(stage.value(prim, "physics:centerOfMass", (-np.inf,) * 3), dtype=float)
        if np.isfinite(centre).all():
            own = replace(own, centre=centre * scale)
        moments = np.array(stage.value(prim, "physics:diagonalInertia", (0.0,) * 3), dtype=float)
        if (moments > 0.0).all():
            axes = stage.value(prim, "physics:principalAxes")
            turn = quat.IDENTITY if axes is None else np.array([axes.GetReal(), *axes.GetImaginary()], dtype=float)
            turn = turn / np.linalg.norm(turn) if turn.any() else quat.IDENTITY
            r = quat.to_matrix(turn)
            own = replace(own, inertia=r @ np.diag(moments * stage.mass_unit * stage.unit**2) @ r.T)
        return own

    def _piece(self, part: Part, of_body: float, per_volume: float, name: str) -> MassProperties:
        prim, shape, place, turn = part
        stage = self.stage
        unit = mass_properties(shape, thickness=1e-3)
        mass = float(stage.value(prim, "physics:mass", 0.0)) * stage.mass_unit
        if mass <= 0.0:
            density = float(stage.value(prim, "physics:density", 0.0)) or of_body
            material = stage.bound_material(prim, "physics")
            if not density and material is not None:
                density = float(stage.value(material, "physics:density", 0.0))
            mass = abs(unit.volume) * (density * per_volume if density else WATER)
        if not shape.is_solid:
            self.scene.note("an open mesh has the mass of a shell of 1 mm", name)
        return MassProperties(mass, unit.centre, unit.inertia * (mass / unit.volume)).turned(turn, place)
