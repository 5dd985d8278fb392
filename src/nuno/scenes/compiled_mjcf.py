"""A compiled model of MuJoCo, at rest in one configuration: what its bodies are and which belong together."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np

from nuno.shapes.coordinates import Pose

KINDS = {
    "tendon": ("mjOBJ_TENDON", "ntendon"), "sensor": ("mjOBJ_SENSOR", "nsensor"), "camera": ("mjOBJ_CAMERA", "ncam"),
    "skin": ("mjOBJ_SKIN", "nskin"), "plugin": ("mjOBJ_PLUGIN", "nplugin"), "pair": ("mjOBJ_PAIR", "npair"),
}  # fmt: skip


class CompiledMjcf:
    """A model and its state.

    Args:
        mujoco: The package.
        spec: The model as it was written.
        model: As it was compiled.
        key: The key frame that is taken, -1 for none.

    Attributes:
        initial: The state in which flexes are at rest.
        data: The state that is taken.
        flex_bodies: Bodies that are vertices of flexes.
        roots: Bodies that move, but for vertices: each stands for all that are fixed to it.
    """

    def __init__(self, mujoco: Any, spec: Any, model: Any, key: int) -> None:
        self.mujoco, self.spec, self.model = mujoco, spec, model
        self.initial, self.data = mujoco.MjData(model), mujoco.MjData(model)
        mujoco.mj_resetData(model, self.initial)
        if key >= 0:
            mujoco.mj_resetDataKeyframe(model, self.data, key)
        for data in (self.initial, self.data):
            for update in ("mj_kinematics", "mj_comPos", "mj_flex", "mj_comVel"):
                getattr(mujoco, update)(model, data)
        held = {int(body) for body in model.flex_vertbodyid} | {int(body) for body in model.flex_nodebodyid}
        self.flex_bodies = {body for body in held if body > 0 and model.body_geomnum[body] == 0
                            and model.body_weldid[body] == body and model.body_jntnum[body] > 0}  # fmt: skip
        self.roots = [
            body for body in range(1, model.nbody)
            if model.body_weldid[body] == body and body not in self.flex_bodies and self.moves(body)
        ]  # fmt: skip
        self.intermediate: dict[int, int] = {}

    def moves(self, body: int) -> bool:
        """Return True if a body moves against the world."""
        return int(self.model.body_weldid[body]) != 0

    def root(self, body: int) -> int:
        """Return the body that stands for one that is fixed to it; 0 for what does not move."""
        return int(self.model.body_weldid[body])

    def body_name(self, body: int) -> str:
        """Return a body's name, or one that says which it is."""
        return self.name("mjOBJ_BODY", body) or f"body {body}"

    def name(self, kind: str, index: int) -> str:
        """Return an object's name, empty where it has none."""
        return self.mujoco.mj_id2name(self.model, getattr(self.mujoco.mjtObj, kind), index) or ""

    def pose(self, body: int) -> Pose:
        """Return where a body is, in the world."""
        return np.array(self.data.xpos[body]), np.array(self.data.xquat[body])

    @cached_property
    def members(self) -> dict[int, list[int]]:
        """By the body that stands for them, the bodies that are fixed to each other."""
        found: dict[int, list[int]] = {}
        for body in range(self.model.nbody):
            found.setdefault(int(self.model.body_weldid[body]), []).append(body)
        return found

    @cached_property
    def groups(self) -> tuple[dict[tuple[int, int], int], bool]:
        """The bit of each pair of contact masks that there is, and whether the masks serve as they are.

        MuJoCo lets two bodies touch where either wants to, Nuno where both do.
        """
        model = self.model
        pairs = sorted({(int(a), int(b)) for a, b in zip(model.geom_contype, model.geom_conaffinity, strict=True)}
                       | {(int(a), int(b)) for a, b in zip(model.flex_contype, model.flex_conaffinity, strict=True)}
                       | {(1, 1)})  # fmt: skip
        alike = all(bool(a[0] & b[1]) == bool(b[0] & a[1]) for a in pairs for b in pairs)
        return {pair: k for k, pair in enumerate(pairs)}, alike

    def masks(self, pair: tuple[int, int]) -> tuple[int, int]:
        """Return the group and what it touches, of MuJoCo's two masks."""
        bits, alike = self.groups
        if alike or len(bits) > 32:
            return pair[0] & 0xFFFFFFFF, pair[1] & 0xFFFFFFFF
        touches = sum(1 << k for other, k in bits.items() if pair[0] & other[1] or other[0] & pair[1])
        return 1 << bits[pair], touches


def names_of(mujoco: Any, model: Any, kind: str) -> list[str]:
    """Return the names of all objects of a kind of `KINDS`."""
    type_, count = KINDS[kind]
    return [
        mujoco.mj_id2name(model, getattr(mujoco.mjtObj, type_), k) or f"{kind} {k}"
        for k in range(getattr(model, count))
    ]
