"""USD's packages, or an error that says how to get them."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from nuno.errors import MissingPackageError

SURFACE, VOLUME, DEFORMABLE = (
    "PhysicsSurfaceDeformableSimAPI", "PhysicsVolumeDeformableSimAPI", "PhysicsDeformableBodyAPI",
)  # fmt: skip
"""Schemas of deformable bodies, as AOUSD's proposal names them; usd-core has none yet, other programs read them."""
SURFACE_MATERIAL, VOLUME_MATERIAL = "PhysicsSurfaceDeformableMaterialAPI", "PhysicsVolumeDeformableMaterialAPI"
PART, BODY = "nuno", "nuno_body"
"""Keys of custom data: of the root prim, and of each prim that is a body of Nuno's."""


def usd_package() -> Any:
    """Return USD's modules by name.

    Raises:
        MissingPackageError: usd-core is not installed.
    """
    try:
        from pxr import Gf, Sdf, Tf, Usd, UsdGeom, UsdPhysics, UsdShade, Vt
    except ImportError as error:
        raise MissingPackageError("usd-core", "usd", "USD") from error
    return SimpleNamespace(
        Gf=Gf, Sdf=Sdf, Tf=Tf, Usd=Usd, UsdGeom=UsdGeom, UsdPhysics=UsdPhysics, UsdShade=UsdShade, Vt=Vt
    )
