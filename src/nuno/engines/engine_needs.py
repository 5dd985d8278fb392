"""Needs: the capabilities that dynamics of a material, or a grip, ask of an engine."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.engines.world_view import rules_of
from nuno.joints.grip import GripSpec
from nuno.joints.joint import JointSpec
from nuno.joints.joint_drives import DRIVES
from nuno.joints.tie import MAX_FORCE, HoldSpec, TieSpec
from nuno.materials import Cloth, Material, Rigid, Soft

if TYPE_CHECKING:
    from nuno.bodies.body import Body
    from nuno.engines.world_view import EngineWorld


def needs_of_dynamics(body: Body, material: Material, world: EngineWorld) -> list[str]:
    """Return the capabilities that dynamics of a material ask for."""
    needs = []
    worlds = world.world_count
    values: list[Any] = []
    for name, value in vars(material).items():
        if name not in material.OF_BODY:
            values += [(name, part) for part in (value if isinstance(value, tuple) else (value,))]
    for name, value in values:
        shape = np.shape(value)
        if shape in ((worlds,), (worlds, 1)) and worlds > 1:
            needs.append("worlds' materials")
        elif shape and name in material.PER_ELEMENT:
            needs.append("elements' materials")
    if isinstance(material, Cloth):
        needs.append("cloth")
        needs += ["directed stretch"] if _differ(material.stretch_stiffness) else []
        needs += ["directed bending"] if _differ(material.bending_rigidity) else []
        needs += ["self-contact of cloth"] if rules_of(world).touches_itself(body) else []
    elif isinstance(material, Soft):
        needs.append("soft bodies")
        needs += ["self-contact of soft bodies"] if material.self_contact else []
    elif isinstance(material, Rigid):
        needs.append("rigid bodies")
        needs += ["restitution"] if np.max(material.restitution) > 0.0 else []
    needs += ["air drag"] if np.max(getattr(material, "air_drag", 0.0)) > 0.0 else []
    return list(dict.fromkeys(needs))


def needs_of_grip(spec: Any, on_moving: bool) -> list[str]:
    """Return the capabilities that a grip, weld or joint asks for, on another body that is dynamic or not."""
    needs: list[str] = []
    if isinstance(spec, JointSpec):
        kind = {"hinge": "hinges", "slider": "sliders", "ball": "ball joints", "fixed": "fixed joints"}[spec.kind]
        drives = "drives of ball joints" if spec.kind == "ball" else "joint drives"
        needs += [kind, drives] if _is_driven(spec) else [kind]
    if spec.compliance > 0.0:
        needs.append("compliant grips of rigid bodies" if isinstance(spec, HoldSpec) else "compliant grips")
    if not isinstance(spec, GripSpec) and np.min(spec.max_force) < MAX_FORCE:
        needs.append("limited welds and joints")
    if isinstance(spec, HoldSpec):
        needs.append("welds of rigid bodies" if on_moving else "grips of rigid bodies")
        if spec.free is not None:
            needs += ["sliding grips", "sliding welds"] if on_moving else ["sliding grips"]
    elif isinstance(spec, TieSpec):
        needs.append("ties")
        needs += ["grips inside faces"] if _between(spec.weights) else []
    elif isinstance(spec, GripSpec):
        needs.append("grips of vertices")
        if spec.barycentric is not None and _between(spec.barycentric):
            needs.append("grips inside faces")
        needs += ["limited grips"] if spec.max_force is not None and np.isfinite(spec.max_force).any() else []
    return needs


def _differ(value: Any) -> bool:
    if not isinstance(value, tuple):
        return False
    warp, weft = np.broadcast_arrays(*value)
    return not np.array_equal(warp, weft)


def _between(weights: np.ndarray) -> bool:
    """Return True if a point is at no vertex."""
    return bool((np.max(weights, axis=-1) < 1.0 - 1e-6).any())


def _is_driven(spec: JointSpec) -> bool:
    """Return True if a joint has a stop, a motor, a spring or friction."""
    drives = dict(zip(DRIVES, np.moveaxis(spec.drives, -1, 0), strict=True))
    stops = np.isfinite(drives["upper"]).any() or np.isfinite(drives["lower"]).any()
    if spec.kind == "ball":
        stops = np.isfinite(drives["upper"]).any()
    rest = ("friction", "max_effort", "spring", "spring_damping")
    return spec.kind != "fixed" and bool(stops or any(np.any(drives[name]) for name in rest))
