"""The joints of a group of bodies, as the tables that the solver takes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
import warp as wp

from nuno.coupled.joint_opening import Trees
from nuno.coupled.joint_response import Joints
from nuno.joints.joint import KINDS, Joint, JointSpec
from nuno.tables.joint_trees import ANCHOR, tree_table

if TYPE_CHECKING:
    from nuno.bodies.body import Body


class BodySlots(Protocol):
    """The slots of a world's rigid bodies: `nuno.dynamics.rigid_dynamics.RigidScene` as tables of joints see it."""

    @property
    def origin(self) -> np.ndarray:
        """(worlds, 3) [m], what the solver's positions are relative to."""

    def slot_of(self, body: Body) -> int | None:
        """Return the slot of a rigid or static body, None where the solver was not told of it yet."""


class CoupledJoints:
    """Joints of rigid bodies that go together.

    Args:
        joints: The joints.
        bodies: Those of the group, in the coupling's order.
        worlds: Worlds in the batch.
        device: Where the tables live.
        scene: What moves the world's rigid bodies, None where there are none.
    """

    def __init__(
        self, joints: list[Joint], bodies: list[Body], worlds: int, device: str, scene: BodySlots | None
    ) -> None:
        self.joints = joints
        self.table, self.trees = Joints(), Trees()
        self._specs: list[JointSpec] = []
        self._device = device
        count = len(joints)
        self.table.count = count
        if not count:
            return
        assert scene is not None
        places, others = [], []
        for joint in joints:
            spec: JointSpec = joint.spec
            own: Any = joint.body._dynamics
            other: Any = None if joint.target is None else joint.target._dynamics
            places.append(spec.place - own.centre)
            # a static body's slot has its shape's frame; the world's is relative to the scene's origin
            others.append(spec.other_place - (scene.origin if joint.target is None else 0.0))
            if other is not None:
                others[-1] = spec.other_place - other.centre
        specs: list[JointSpec] = [joint.spec for joint in joints]
        slots = [scene.slot_of(joint.body) for joint in joints]
        other_slots = [-1 if j.target is None else scene.slot_of(j.target) for j in joints]
        seen: set[int | None] = {-1}
        settles = []
        for own_slot, other_slot in zip(slots, other_slots, strict=True):
            settles.append((own_slot not in seen) + 2 * (other_slot not in seen))
            seen |= {own_slot, other_slot}
        for name, numbers in (
            ("kind", [KINDS.index(spec.kind) for spec in specs]),
            ("body", [bodies.index(joint.body) for joint in joints]),
            ("slot", slots),
            ("other", other_slots),
            ("settles", settles),
        ):
            setattr(self.table, name, wp.array(np.array(numbers, np.int32), dtype=int, device=self._device))
        self._put("place", places, wp.vec3)
        self._put("other_place", others, wp.vec3)
        self._put("turn", [np.roll(spec.turn, -1, axis=1) for spec in specs], wp.quat)
        self._put("other_turn", [np.roll(spec.other_turn, -1, axis=1) for spec in specs], wp.quat)
        self._put("limit", [np.broadcast_to(spec.max_force, (worlds,)) for spec in specs], float)
        for name, kind in (
            ("pull", wp.vec3), ("twist", wp.vec3), ("free", wp.vec3), ("axial", float), ("state", int),
            ("total", wp.vec3), ("total_twist", wp.vec3), ("total_axial", float), ("unmet", int),
        ):  # fmt: skip
            setattr(self.table, name, wp.zeros(worlds * count, dtype=kind, device=self._device))
        pairs = [
            (own, other if other is not None and joint.target is not None and joint.target.is_dynamic else ANCHOR)
            for joint, own, other in zip(joints, slots, other_slots, strict=True)
            if own is not None
        ]
        self.trees = tree_table(pairs, worlds, self._device)
        self.bring()

    def bring(self) -> None:
        """Take over what motors, springs, friction and limits are now."""
        specs: list[JointSpec] = [joint.spec for joint in self.joints]
        if len(specs) != len(self._specs) or any(a is not b for a, b in zip(specs, self._specs, strict=True)):
            self._put("drive", [spec.drives for spec in specs], float)
            self._specs = specs

    def _put(self, name: str, values: list[np.ndarray], dtype: Any) -> None:
        table = np.stack(values, axis=1).astype(np.float32)  # (worlds, joints, ...)
        flat = table.ravel() if dtype is float else table.reshape(-1, table.shape[-1])
        setattr(self.table, name, wp.array(flat, dtype=dtype, device=self._device))
