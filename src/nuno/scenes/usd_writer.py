"""Scenes as USD, with UsdPhysics' schemas; metres, kilograms, z up."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from nuno.materials import Cloth, Rigid, Soft
from nuno.scenes.build_world import is_rigid
from nuno.scenes.cloth_elasticity import mean_of, plate_of
from nuno.scenes.nuno_part import write_part
from nuno.scenes.rest_place import rest_shape
from nuno.scenes.scene_description import SceneBody, SceneDescription
from nuno.scenes.shape_parts import parts_of
from nuno.scenes.usd_joint_writer import write_joint
from nuno.scenes.usd_package import (
    BODY,
    DEFORMABLE,
    PART,
    SURFACE,
    SURFACE_MATERIAL,
    VOLUME,
    VOLUME_MATERIAL,
    usd_package,
)
from nuno.shapes import quaternion as quat
from nuno.shapes.color import rgb
from nuno.shapes.coordinates import apply, invert
from nuno.shapes.shape import Box, Capsule, Cylinder, Hull, Plane, Shape, Sphere


def write_usd(scene: SceneDescription, extension: str) -> bytes:
    """Return a scene as a USD file's bytes; what USD lacks is noted in the scene.

    Args:
        scene: The scene.
        extension: ".usda" for text, ".usdc" or ".usd" for binary.

    Raises:
        MissingPackageError: usd-core is not installed.
    """
    usd = usd_package()
    stage = usd.Usd.Stage.CreateInMemory()
    UsdWriter(usd, scene, stage).write()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"scene{extension}"
        stage.GetRootLayer().Export(str(path))
        return path.read_bytes()


class UsdWriter:
    """Writes one scene into a stage."""

    def __init__(self, usd: Any, scene: SceneDescription, stage: Any) -> None:
        self.usd, self.scene, self.stage = usd, scene, stage
        self.paths: dict[str, str] = {}
        self._taken: set[str] = set()

    def write(self) -> None:
        """Write everything."""
        usd, stage, scene = self.usd, self.stage, self.scene
        usd.UsdGeom.SetStageUpAxis(stage, usd.UsdGeom.Tokens.z)
        usd.UsdGeom.SetStageMetersPerUnit(stage, 1.0)
        usd.UsdPhysics.SetStageKilogramsPerUnit(stage, 1.0)
        root = usd.UsdGeom.Xform.Define(stage, "/World").GetPrim()
        stage.SetDefaultPrim(root)
        physics = usd.UsdPhysics.Scene.Define(stage, "/World/physics")
        strength = float(np.linalg.norm(scene.gravity))
        direction = np.array(scene.gravity) / strength if strength else np.array([0.0, 0.0, -1.0])
        physics.CreateGravityDirectionAttr(self.vec3f(direction))
        physics.CreateGravityMagnitudeAttr(strength)
        for body in scene.bodies:
            self._body(body)
        for joint in scene.joints:
            write_joint(self, joint)
        self._pairs()
        for grip in scene.grips:
            scene.note("grips of vertices are read by Nuno alone", grip.body)
        for first, second, _ in scene.pair_friction:
            scene.note("the friction of a pair is read by Nuno alone", f"{first} and {second}")
        root.SetCustomDataByKey(PART, write_part(scene, []))

    def path_for(self, name: str, kind: str) -> str:
        """Return a prim's path for a name, which USD may not take as it is."""
        base = found = f"/World/{self.usd.Tf.MakeValidIdentifier(name)}"
        number = 1
        while found in self._taken:
            number += 1
            found = f"{base}_{number}"
        self._taken.add(found)
        if kind == "body":
            self.paths[name] = found
        return found

    def vec3f(self, values: Any) -> Any:
        """Return three numbers as USD has them."""
        return self.usd.Gf.Vec3f(*(float(value) for value in values))

    def quatf(self, values: Any) -> Any:
        """Return a quaternion as USD has it."""
        return self.usd.Gf.Quatf(*(float(value) for value in values))

    def _body(self, body: SceneBody) -> None:
        usd = self.usd
        path = self.path_for(body.name, "body")
        form = usd.UsdGeom.Xform.Define(self.stage, path)
        prim = form.GetPrim()
        prim.SetDisplayName(body.name)
        prim.SetCustomDataByKey(BODY, True)
        self._place(form, body.position, body.quaternion)
        if is_rigid(body):
            self._mass(prim, body)
        if body.deforms and not is_rigid(body):
            self._deformable(prim, path, body)
            return
        material = self._material(path, body)
        for k, (shape, place, turn) in enumerate(parts_of(body.shape)):
            made = self._shape(f"{path}/shape_{k}", shape, is_rigid(body))
            self._place(made, place, turn, shape.size if isinstance(shape, Box) else None)
            made.CreateDisplayColorAttr([self.vec3f(rgb("gray" if body.color is None else body.color))])
            touch = usd.UsdPhysics.CollisionAPI.Apply(made.GetPrim())
            if not body.group or not body.collides_with:
                touch.CreateCollisionEnabledAttr(False)
            usd.UsdShade.MaterialBindingAPI.Apply(made.GetPrim()).Bind(
                material, bindingStrength=usd.UsdShade.Tokens.weakerThanDescendants, materialPurpose="physics"
            )

    def _place(self, form: Any, position: Any, turn: Any, size: Any = None) -> None:
        double = self.usd.UsdGeom.XformOp.PrecisionDouble
        form.AddTranslateOp(double).Set(self.usd.Gf.Vec3d(*(float(value) for value in position)))
        form.AddOrientOp(double).Set(self.usd.Gf.Quatd(*(float(value) for value in turn)))
        if size is not None:
            form.AddScaleOp(double).Set(self.usd.Gf.Vec3d(*(float(value) for value in size)))

    def _mass(self, prim: Any, body: SceneBody) -> None:
        usd = self.usd
        material: Any = body.material
        rigid = usd.UsdPhysics.RigidBodyAPI.Apply(prim)
        back = quat.inverse(body.quaternion)
        if body.velocity is not None:
            rigid.CreateVelocityAttr(self.vec3f(quat.rotate(back, body.velocity)))
        if body.angular_velocity is not None:
            rigid.CreateAngularVelocityAttr(self.vec3f(np.degrees(quat.rotate(back, body.angular_velocity))))
        moments, axes = np.linalg.eigh(material.inertia)
        axes[:, 2] *= np.sign(np.linalg.det(axes))
        matrix = usd.Gf.Matrix3d(*(float(value) for value in axes.T.ravel()))  # USD's vectors are rows
        turn = matrix.ExtractRotation().GetQuat()
        mass = usd.UsdPhysics.MassAPI.Apply(prim)
        mass.CreateMassAttr(float(material.mass))
        mass.CreateCenterOfMassAttr(self.vec3f(material.centre_of_mass))
        mass.CreateDiagonalInertiaAttr(self.vec3f(moments))
        mass.CreatePrincipalAxesAttr(self.quatf([turn.GetReal(), *turn.GetImaginary()]))
        if material.air_drag:
            self.scene.note("air drag is read by Nuno alone", body.name)

    def _material(self, path: str, body: SceneBody) -> Any:
        usd = self.usd
        material = usd.UsdShade.Material.Define(self.stage, f"{path}/material")
        physics = usd.UsdPhysics.MaterialAPI.Apply(material.GetPrim())
        physics.CreateStaticFrictionAttr(float(body.friction))
        physics.CreateDynamicFrictionAttr(float(body.friction))
        if isinstance(body.material, Rigid):
            physics.CreateRestitutionAttr(float(body.material.restitution))
        return material

    def _shape(self, path: str, shape: Shape, moves: bool) -> Any:
        geom, stage = self.usd.UsdGeom, self.stage
        if isinstance(shape, Box):
            made = geom.Cube.Define(stage, path)
            made.CreateSizeAttr(1.0)
        elif isinstance(shape, Sphere):
            made = geom.Sphere.Define(stage, path)
            made.CreateRadiusAttr(shape.radius)
        elif isinstance(shape, Cylinder | Capsule):
            made = (geom.Cylinder if isinstance(shape, Cylinder) else geom.Capsule).Define(stage, path)
            made.CreateRadiusAttr(shape.radius)
            made.CreateHeightAttr(shape.height)
            made.CreateAxisAttr("Z")
        elif isinstance(shape, Plane):
            made = geom.Plane.Define(stage, path)
            made.CreateAxisAttr("Z")
        else:
            vertices, faces = shape.mesh()
            made = self._mesh(path, vertices, faces)
            hulls = self.usd.UsdPhysics.MeshCollisionAPI.Apply(made.GetPrim())
            hulls.CreateApproximationAttr("convexHull" if moves or isinstance(shape, Hull) else "none")
        return made

    def _mesh(self, path: str, vertices: np.ndarray, faces: np.ndarray) -> Any:
        vt = self.usd.Vt
        made = self.usd.UsdGeom.Mesh.Define(self.stage, path)
        made.CreatePointsAttr(vt.Vec3fArray.FromNumpy(np.ascontiguousarray(vertices, dtype=np.float32)))
        made.CreateFaceVertexIndicesAttr(vt.IntArray.FromNumpy(np.ascontiguousarray(faces, dtype=np.int32).ravel()))
        made.CreateFaceVertexCountsAttr(vt.IntArray.FromNumpy(np.full(len(faces), 3, dtype=np.int32)))
        made.CreateSubdivisionSchemeAttr("none")
        return made

    def _deformable(self, prim: Any, path: str, body: SceneBody) -> None:
        """Write a cloth as a mesh, or a soft body as a mesh of tetrahedra, in its present shape and that at rest."""
        usd, vt = self.usd, self.usd.Vt
        assert body.vertices is not None
        own = (body.position, body.quaternion)
        rest, elements = rest_shape(body)
        points = apply(invert(own), body.vertices)
        array = vt.Vec3fArray.FromNumpy(np.ascontiguousarray(points, dtype=np.float32))
        if body.shape.is_cloth:
            made = self._mesh(f"{path}/cloth", points, elements)
        else:
            made = usd.UsdGeom.TetMesh.Define(self.stage, f"{path}/soft")
            made.CreatePointsAttr(array)
            made.CreateTetVertexIndicesAttr([usd.Gf.Vec4i(*row) for row in elements.tolist()])
            faces = np.asarray(body.shape.mesh()[1]).tolist()
            made.CreateSurfaceFaceVertexIndicesAttr([usd.Gf.Vec3i(*row) for row in faces])
        sim, types = made.GetPrim(), usd.Sdf.ValueTypeNames
        made.CreateDisplayColorAttr([self.vec3f(rgb("gray" if body.color is None else body.color))])
        usd.UsdPhysics.CollisionAPI.Apply(sim)
        sim.CreateAttribute("physics:restShapePoints", types.Point3fArray, False).Set(
            vt.Vec3fArray.FromNumpy(np.ascontiguousarray(rest, dtype=np.float32))
        )
        if body.velocities is not None:
            turned = quat.rotate(quat.inverse(body.quaternion), body.velocities)
            made.CreateVelocitiesAttr(vt.Vec3fArray.FromNumpy(np.ascontiguousarray(turned, dtype=np.float32)))
        if body.material is None:
            return
        prim.AddAppliedSchema(DEFORMABLE)
        sim.AddAppliedSchema(SURFACE if body.shape.is_cloth else VOLUME)
        material = self._material(path, body)
        bound = material.GetPrim()
        bound.AddAppliedSchema(SURFACE_MATERIAL if body.shape.is_cloth else VOLUME_MATERIAL)
        values = self._elasticity(body)
        if "thickness" in values:  # of the plate, which AOUSD's proposal keeps with the geometry
            sim.CreateAttribute("physics:thicknesses", types.FloatArray, False).Set([values.pop("thickness")])
            sim.CreateAttribute("physics:thicknesses:elementType", types.Token, False).Set("constant")
        for name, value in values.items():
            bound.CreateAttribute(f"physics:{name}", types.Float, False).Set(value)
        usd.UsdShade.MaterialBindingAPI.Apply(sim).Bind(material, materialPurpose="physics")
        if np.any(getattr(body.material, "air_drag", 0.0)):
            self.scene.note("air drag is read by Nuno alone", body.name)

    def _elasticity(self, body: SceneBody) -> dict[str, float]:
        material = body.material
        if isinstance(material, Soft):
            return {
                "density": mean_of(material.density), "youngsModulus": mean_of(material.youngs_modulus),
                "poissonsRatio": mean_of(material.poisson_ratio),
            }  # fmt: skip
        assert isinstance(material, Cloth)
        plate = plate_of(material)
        if not plate.exact:
            self.scene.note("a cloth is an even plate to USD, with another shear or the mean of its values", body.name)
        return {
            "density": mean_of(material.area_density) / plate.thickness, "youngsModulus": plate.youngs_modulus,
            "poissonsRatio": plate.poisson_ratio, "thickness": plate.thickness,
            "contactThickness": mean_of(material.thickness),
        }  # fmt: skip

    def _pairs(self) -> None:
        """Write pairs of bodies that do not touch."""
        usd = self.usd
        for first, second in self.scene.ignored:
            if first == second:
                self.scene.note("a cloth that passes through itself does so for Nuno alone", first)
                continue
            pairs = usd.UsdPhysics.FilteredPairsAPI.Apply(self.stage.GetPrimAtPath(self.paths[first]))
            pairs.CreateFilteredPairsRel().AddTarget(self.paths[second])
        bodies = self.scene.bodies
        if any(body.group != 1 or body.collides_with & 1 == 0 for body in bodies if body.group and body.collides_with):
            self.scene.note("groups of contact are read by Nuno alone", "bodies with masks")
