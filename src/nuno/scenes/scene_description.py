"""A scene as data, between a world and a file: what every format's reader makes and every writer takes."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from nuno.bodies.checked_values import ALL_GROUPS
from nuno.joints.joint_drives import Motor, Spring
from nuno.materials import Material
from nuno.shapes.shape import Shape

EARTH = (0.0, 0.0, -9.81)
"""[m/s2]"""


@dataclass(eq=False)
class SceneBody:
    """One body.

    Attributes:
        name: Unique in the scene.
        shape: In the body's own frame; of cloth and soft bodies with the rest shape.
        position: (3,) float [m].
        quaternion: (4,) float, (w, x, y, z).
        material: Of its dynamics, None while it is static.
        color: A name or (r, g, b), None for the kind's own.
        friction: Coulomb's coefficient.
        thickness: Of a static cloth [m].
        group: Bit mask of the collision groups that it is in.
        collides_with: Bit mask of those that it touches.
        vertices: (n, 3) float [m] of a cloth or soft body as it is now, in the world.
        velocities: (n, 3) float [m/s] of those, or None: at rest.
        velocity: (3,) float [m/s] of a rigid body's centre of mass.
        angular_velocity: (3,) float [rad/s], along the world's axes.
    """

    name: str
    shape: Shape
    position: np.ndarray
    quaternion: np.ndarray
    material: Material | None = None
    color: Any = None
    friction: float = 0.5
    thickness: float = 0.0
    group: int = 1
    collides_with: int = ALL_GROUPS
    vertices: np.ndarray | None = None
    velocities: np.ndarray | None = None
    velocity: np.ndarray | None = None
    angular_velocity: np.ndarray | None = None

    @property
    def deforms(self) -> bool:
        """Return True for cloth and soft bodies, dynamic or static."""
        return self.shape.is_cloth or self.shape.is_soft


@dataclass(eq=False)
class SceneJoint:
    """One joint, as ``nuno.hinge`` and its like take it.

    Attributes:
        name: Unique in the scene.
        kind: "hinge", "slider", "ball" or "fixed".
        body: Name of the body that it moves.
        other: Name of the other body, None: the world.
        point: (3,) float [m], in the world.
        axis: (3,) float, likewise.
        position: What it is now [rad] or [m].
        limits: (lower, upper) [rad] or [m], of a ball joint (0, cone) [rad]; None where there are none.
        friction: [N m] or [N].
        motor: Of a hinge or slider.
        spring: Of all but fixed joints.
        max_force: [N], None for the rule's.
        contact: Whether the two bodies touch each other.
    """

    name: str
    kind: str
    body: str
    other: str | None
    point: np.ndarray
    axis: np.ndarray
    position: float = 0.0
    limits: tuple[float, float] | None = None
    friction: float = 0.0
    motor: Motor | None = None
    spring: Spring | None = None
    max_force: float | None = None
    contact: bool = False


@dataclass(eq=False)
class SceneGrip:
    """Vertices of a cloth or soft body that are held where they are, in the world or by a body.

    Attributes:
        body: Name of the body that is held.
        vertices: (k,) int.
        to: Name of the body that holds it, None: the world.
        compliance: [m/N].
        max_force: [N] at each point, None for the rule's.
    """

    body: str
    vertices: np.ndarray
    to: str | None = None
    compliance: float = 0.0
    max_force: float | None = None


@dataclass(eq=False)
class SceneDescription:
    """A whole scene.

    Attributes:
        gravity: (3,) [m/s2].
        frame_rate: [1/s], None where the format has none.
        substeps: Of a frame, None for the solvers' rule.
        bodies: In the order in which they are added.
        joints: Likewise.
        grips: Likewise.
        ignored: Pairs of names of bodies that pass through each other; twice the same name for one that passes
            through itself.
        pair_friction: Pairs with their own coefficient.
        notes: By what was left out or approximated, the names of what it was.
    """

    gravity: tuple[float, float, float] = EARTH
    frame_rate: float | None = None
    substeps: int | None = None
    bodies: list[SceneBody] = field(default_factory=list)
    joints: list[SceneJoint] = field(default_factory=list)
    grips: list[SceneGrip] = field(default_factory=list)
    ignored: list[tuple[str, str]] = field(default_factory=list)
    pair_friction: list[tuple[str, str, float]] = field(default_factory=list)
    notes: dict[str, list[str]] = field(default_factory=lambda: defaultdict(list))

    def body(self, name: str) -> SceneBody:
        """Return the body of that name."""
        return next(body for body in self.bodies if body.name == name)

    def rename(self, old: str, new: str) -> None:
        """Give a body another name, wherever it is named."""
        self.body(old).name = new
        for joint in self.joints:
            joint.body = new if joint.body == old else joint.body
            joint.other = new if joint.other == old else joint.other
        for grip in self.grips:
            grip.body = new if grip.body == old else grip.body
            grip.to = new if grip.to == old else grip.to
        self.ignored = [(new if a == old else a, new if b == old else b) for a, b in self.ignored]
        self.pair_friction = [
            (new if a == old else a, new if b == old else b, mu) for a, b, mu in self.pair_friction
        ]  # fmt: skip

    def note(self, what: str, name: str) -> None:
        """Remember that something was left out or approximated."""
        if name not in self.notes[what]:
            self.notes[what].append(name)
