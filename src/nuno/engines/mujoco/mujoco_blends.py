"""Blends: light points in MuJoCo that stay at weighted sums of a flex's vertices, for rigid bodies to be tied to."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from nuno.engines.mujoco.mujoco_package import mujoco_package
from nuno.engines.mujoco.mujoco_stiff import CLOSING, STIFF

LIGHT = 1e-3
"""Share of a vertex' mass that a blend has besides."""


@dataclass(eq=False)
class Blend:
    """A point between vertices.

    Attributes:
        body: Its body in the spec.
        terms: The vertices with their weights.
        elements: All that it has in the spec, of which some refer to those before them.
        qpos, dof: The addresses (3,) of its coordinates, and of those of its vertices (k, 3).
    """

    body: Any
    terms: list[tuple[int, float]]
    elements: list[Any] = field(default_factory=list)
    qpos: Any = None
    dof: Any = None


def add_blend(spec: Any, name: str, flex: Any, terms: list[tuple[int, float]]) -> Blend:
    """Add a blend of the vertices of a placed flex to a spec."""
    mujoco = mujoco_package()
    rest = sum(weight * flex.mesh.rest[vertex] for vertex, weight in terms)
    mass = LIGHT * float(flex.bodies[terms[0][0]].mass)
    body = spec.worldbody.add_body(
        name=name, pos=rest, mass=mass, inertia=[mass * 1e-6] * 3, explicitinertial=True, gravcomp=1.0
    )
    own = Blend(body, terms, [body])
    for axis, letter in zip(np.eye(3), "xyz", strict=True):
        body.add_joint(name=f"{name}.{letter}", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis)
        tendon = spec.add_tendon(name=f"{name}.{letter}")
        tendon.wrap_joint(f"{name}.{letter}", -1.0)
        for vertex, weight in terms:
            tendon.wrap_joint(f"{flex.bodies[vertex].name}.{letter}", weight)
        kept = spec.add_equality(name=tendon.name, type=mujoco.mjtEq.mjEQ_TENDON, name1=tendon.name)
        kept.objtype, kept.solimp = mujoco.mjtObj.mjOBJ_TENDON, STIFF
        own.elements += [tendon, kept]
    return own


def find_blend(own: Blend, flex: Any, model: Any, batch: Any, step: float) -> None:
    """Note where a blend is in a compiled model, and write its equalities' numbers, for substeps so long [s]."""
    names = [f"{own.body.name}.{letter}" for letter in "xyz"]
    rows = [int(model.equality(name).id) for name in names]
    batch.expand("eq_solref")[:, rows] = (CLOSING * step, 1.0)
    batch.expand("eq_data")[:, rows, :5] = 0.0
    joints = [model.joint(name) for name in names]
    vertices, axes = [vertex for vertex, _ in own.terms], np.arange(3)
    own.qpos = np.array([int(j.qposadr[0]) for j in joints]), flex.qpos[vertices][:, None] + axes
    own.dof = np.array([int(j.dofadr[0]) for j in joints]), flex.dof[vertices][:, None] + axes


def place_blend(own: Blend, batch: Any) -> None:
    """Set a blend to where its vertices are, with their velocity."""
    weights = np.array([weight for _, weight in own.terms])
    for name, (mine, theirs) in (("qpos", own.qpos), ("qvel", own.dof)):
        values = batch.bind(name)
        values[:, mine] = np.einsum("k,wkx->wx", weights, values[:, theirs])
