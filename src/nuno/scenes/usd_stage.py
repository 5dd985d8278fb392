"""A USD stage in metres, kilograms and z up."""

from __future__ import annotations

from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from nuno.errors import FileFormatError
from nuno.scenes.rotations_of import quaternion_from
from nuno.scenes.usd_package import BODY
from nuno.shapes.coordinates import Pose

Y_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
SHEARED = 1e-4
"""How far from right angles axes may be."""
MIN_UNIT, MAX_UNIT = 1e-9, 1e6


class UsdStage:
    """A stage, and where its prims are.

    Attributes:
        usd: USD's modules.
        stage: The stage.
        unit: Of a length [m].
        mass_unit: [kg].
        up: (3, 3), from the stage's axes to those of Nuno.

    Raises:
        FileFormatError: no USD, or units that are none.
    """

    def __init__(self, usd: Any, path: Path) -> None:
        self.usd, self.path = usd, path
        try:
            self.stage = usd.Usd.Stage.Open(str(path))
        except usd.Tf.ErrorException as error:
            reason = str(error).strip().splitlines()[0].split(" : ")[-1]
            raise FileFormatError(f"USD cannot read {str(path)!r}: {reason}") from error
        self.unit = float(usd.UsdGeom.GetStageMetersPerUnit(self.stage))
        self.mass_unit = float(usd.UsdPhysics.GetStageKilogramsPerUnit(self.stage))
        for name, unit in (("metersPerUnit", self.unit), ("kilogramsPerUnit", self.mass_unit)):
            if not MIN_UNIT <= unit <= MAX_UNIT:
                raise FileFormatError(f"{name} of {str(path)!r} must be from 1e-9 to 1e6, got {unit}")
        axis = str(usd.UsdGeom.GetStageUpAxis(self.stage))
        if axis not in ("Y", "Z"):
            raise FileFormatError(f"upAxis of {str(path)!r} must be Y or Z, got {axis!r}")
        self.up = Y_UP if axis == "Y" else np.eye(3)
        self._cache = usd.UsdGeom.XformCache(usd.Usd.TimeCode.EarliestTime())

    @cached_property
    def prims(self) -> list[Any]:
        """All prims, those of instances included."""
        usd = self.usd.Usd
        return list(usd.PrimRange(self.stage.GetPseudoRoot(), usd.TraverseInstanceProxies()))

    def matrix(self, prim: Any) -> np.ndarray:
        """Return (3, 4), from a prim's own coordinates to the world [m]."""
        own = np.array(self._cache.GetLocalToWorldTransform(prim)).T[:3]  # USD's vectors are rows
        return self.unit * (self.up @ own)

    def frame(self, prim: Any) -> tuple[Pose, np.ndarray, bool]:
        """Return a prim's pose, what lengths along its axes are multiplied by [m], and whether axes are sheared.

        A mirrored prim's first factor is negative.
        """
        matrix = self.matrix(prim)
        scale = np.linalg.norm(matrix[:, :3], axis=0)
        if (scale < 1e-12).any() or not np.isfinite(matrix).all():
            return (np.nan_to_num(matrix[:, 3]), np.array([1.0, 0.0, 0.0, 0.0])), np.zeros(3), False
        axes = matrix[:, :3] / scale
        if np.linalg.det(axes) < 0.0:
            axes[:, 0] *= -1.0
            scale[0] *= -1.0
        sheared = bool(np.abs(axes.T @ axes - np.eye(3)).max() > SHEARED)
        u, _, vt = np.linalg.svd(axes)
        return (matrix[:, 3], quaternion_from(u @ vt)), scale, sheared

    def value(self, prim: Any, name: str, default: Any = None) -> Any:
        """Return an attribute's value, the default where it has none."""
        attribute = prim.GetAttribute(name)
        found = attribute.Get(self.usd.Usd.TimeCode.EarliestTime()) if attribute else None
        return default if found is None else found

    def has(self, prim: Any, schema: str) -> bool:
        """Return True if a prim has an applied schema, also one that USD does not know."""
        return schema in prim.GetPrimTypeInfo().GetAppliedAPISchemas() or schema in prim.GetAppliedSchemas()

    def body_of(self, prim: Any) -> Any:
        """Return the prim of the rigid body that a prim belongs to, or of a body that Nuno wrote; None for none."""
        while prim and not prim.IsPseudoRoot():
            if self.is_rigid(prim) or prim.GetCustomDataByKey(BODY):
                return prim
            prim = prim.GetParent()
        return None

    def is_rigid(self, prim: Any) -> bool:
        """Return True if a prim is a rigid body, moving or kinematic."""
        return bool(prim.HasAPI(self.usd.UsdPhysics.RigidBodyAPI)) and bool(
            self.value(prim, "physics:rigidBodyEnabled", True)
        )

    def bound_material(self, prim: Any, purpose: str) -> Any:
        """Return the material that is bound to a prim, None for none."""
        material = self.usd.UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial(purpose)[0]
        return material.GetPrim() if material else None

    def color(self, prim: Any) -> Any:
        """Return a prim's colour (r, g, b), None where it has none."""
        shown = self.value(prim, "primvars:displayColor")
        if shown is None or not len(shown):
            material = self.bound_material(prim, "")
            shader = self.usd.UsdShade.Material(material).ComputeSurfaceSource()[0] if material else None
            diffuse = shader.GetInput("diffuseColor") if shader else None
            shown = [diffuse.Get()] if diffuse and diffuse.Get() is not None else []
        return tuple(float(np.clip(c, 0.0, 1.0)) for c in shown[0]) if len(shown) else None
