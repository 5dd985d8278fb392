"""Placed bodies: the elements that a body is in the spec of a scene."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from nuno.engines.mujoco.mujoco_flex import FlexMesh


@dataclass(eq=False)
class Placed:
    """The elements that a body is in the spec.

    Attributes:
        role: "static", "moving" (it follows a path), "rigid" or "flex".
        signature: What it was made of; another means that it is made anew.
        bodies: Its bodies in the spec, one, or of a flex one a vertex.
        geoms, assets: Its geoms, and the meshes that they need.
        flexes: Its flexes: one that deforms, or rigid ones of what is not convex.
        mesh: Of one that deforms, its elements.
        friction: (worlds,), the coefficient of its shapes.
        helpers: Bodies that are welded to it, each with as much of its mass as is left to itself.
        thin: Helpers of joints that are loose or balls, each with a fiftieth of its mass.
        carries: Whether bodies hang on it by joints.
        depth: Of a rigid one that hangs by a joint, of how many joints its tree has above it; else 0.
        id: Of the first of its bodies in the model.
        qpos, dof: Addresses (n,) of each body's coordinates and velocities; empty of a static one.
    """

    role: str
    signature: tuple[Any, ...]
    bodies: list[Any]
    geoms: list[Any] = field(default_factory=list)
    assets: list[Any] = field(default_factory=list)
    flexes: list[Any] = field(default_factory=list)
    mesh: FlexMesh | None = None
    friction: np.ndarray = field(default_factory=lambda: np.zeros(1))
    helpers: list[Any] = field(default_factory=list)
    thin: list[Any] = field(default_factory=list)
    carries: bool = False
    depth: int = 0
    id: int = -1
    qpos: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=int))
    dof: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=int))
