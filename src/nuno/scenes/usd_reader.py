"""USD files as scenes (the extra ``usd``)."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from nuno.scenes.nuno_part import read_part
from nuno.scenes.scene_description import EARTH, SceneDescription
from nuno.scenes.usd_bodies import UsdBodies
from nuno.scenes.usd_deformables import add_deformable, deforming_prims
from nuno.scenes.usd_joints import UsdJoints, add_filters
from nuno.scenes.usd_package import PART, usd_package
from nuno.scenes.usd_stage import UsdStage

LEFT_OUT = {
    "PointInstancer": "point instancers are left out", "Camera": "cameras are left out",
    "BasisCurves": "curves are left out",
}  # fmt: skip


def read_usd(path: Path) -> SceneDescription:
    """Return the scene of a USD file, in metres and z up, at its earliest time.

    Raises:
        MissingPackageError: usd-core is not installed.
        FileFormatError: no USD, or units that are none.
    """
    stage = UsdStage(usd_package(), path)
    scene = SceneDescription(_gravity(stage))
    bodies = UsdBodies(scene, stage)
    deforming = deforming_prims(stage)
    bodies.add({str(prim.GetPath()) for prim in deforming})
    for prim in deforming:
        add_deformable(scene, stage, bodies, prim)
    UsdJoints(scene, stage, bodies).add()
    add_filters(scene, stage, bodies)
    for prim in stage.prims:
        if what := LEFT_OUT.get(str(prim.GetTypeName())):
            scene.note(what, prim.GetName())
    root = stage.stage.GetDefaultPrim()
    part = root.GetCustomDataByKey(PART) if root else None
    if isinstance(part, str) and part:
        read_part(scene, part)
    return scene


def _gravity(stage: UsdStage) -> tuple[float, float, float]:
    """Return the gravity [m/s2] of the first physics scene; Earth's where there is none, or where it says none."""
    for prim in stage.prims:
        if prim.IsA(stage.usd.UsdPhysics.Scene):
            direction = np.array(stage.value(prim, "physics:gravityDirection", (0.0, 0.0, 0.0)), dtype=float)
            strength = float(stage.value(prim, "physics:gravityMagnitude", -np.inf))
            strength = strength * stage.unit if np.isfinite(strength) and strength >= 0.0 else -EARTH[2]
            down = stage.up @ direction if direction.any() else np.array([0.0, 0.0, -1.0])
            found = strength * down / np.linalg.norm(down)
            return float(found[0]), float(found[1]), float(found[2])
    return EARTH
