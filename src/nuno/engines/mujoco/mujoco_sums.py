"""Sums over a frame: what joints bore and did, and what contacts gave bodies, from the substeps' forces."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.engines.mujoco.mujoco_package import mujoco_package

if TYPE_CHECKING:
    from nuno.engines.mujoco.mujoco_joints import Joints
    from nuno.engines.mujoco.mujoco_placed import Placed
    from nuno.joints.grip import Grip


class Sums:
    """Sums over the last frame, or the part of one that was advanced last.

    Args:
        model: The model as it is compiled.
        batch: Its worlds.
        joints: The joints whose loads are summed.
        placed: What each body is, by its key.
        worlds: Number of worlds.
    """

    def __init__(self, model: Any, batch: Any, joints: Joints, placed: Mapping[str, Placed], worlds: int) -> None:
        self._model, self._batch, self._of_joints, self._worlds = model, batch, joints, worlds
        self._joints: dict[Any, int] = {joint: k for k, joint in enumerate(joints.joints)}
        self._borne = np.zeros((worlds, len(self._joints), 6))
        self._along = np.zeros((worlds, len(self._joints)))
        self._duration = 0.0
        self._keys = list(placed)
        self._given = np.zeros((worlds, len(self._keys), len(self._keys), 3))
        self._data: Any = None
        self._owner = owners_of(model, placed, self._keys)

    def begin(self) -> None:
        """Forget what was summed up."""
        self._borne[:], self._along[:], self._given[:], self._duration = 0.0, 0.0, 0.0, 0.0

    def add(self, step: float) -> None:
        """Add what happened in the last substep, of ``step`` [s]."""
        self._duration += step
        if self._joints:
            borne, along = self._of_joints.loads(self._batch, step)
            self._borne += step * borne
            self._along += step * along
        if self._data is None:
            self._data = mujoco_package().MjData(self._model)
        for world, given in enumerate(self._given):
            data = self._batch.get_data(world, self._data)
            if data.ncon:
                self._add_contacts(data, step, given)

    def _add_contacts(self, data: Any, step: float, given: np.ndarray) -> None:
        contact, (geoms, flexes) = data.contact, self._owner
        # -1, of what is none, is the last entry, which is of no body either
        pairs = np.where(contact.geom >= 0, geoms[contact.geom], flexes[contact.flex])
        row = contact.efc_address
        there = (row >= 0) & (pairs >= 0).all(axis=1) & (pairs[:, 0] != pairs[:, 1])
        # of an elliptic cone with three dimensions: along the normal and the two tangents
        forces = data.efc_force[row[there, None] + np.arange(3)]
        on_second = step * np.einsum("ck,ckx->cx", forces, contact.frame[there].reshape(-1, 3, 3))
        first, second = pairs[there].T
        np.add.at(given, (second, first), on_second)
        np.add.at(given, (first, second), -on_second)

    def loads(self, joints: Sequence[Grip]) -> tuple[np.ndarray, np.ndarray]:
        """Return what joints bore (worlds, n, 6) and did (worlds, n) in the mean; zeros of what is not known."""
        borne, along = np.zeros((self._worlds, len(joints), 6)), np.zeros((self._worlds, len(joints)))
        for n, joint in enumerate(joints):
            k = self._joints.get(joint)
            if k is not None and self._duration > 0.0:
                borne[:, n], along[:, n] = self._borne[:, k] / self._duration, self._along[:, k] / self._duration
        return borne, along

    def impulses(self, key: str) -> dict[str, np.ndarray]:
        """Return what contacts gave a body (worlds, 3) [N s], by the other's key."""
        if key not in self._keys:
            return {}
        rows = self._given[:, self._keys.index(key)]
        return {self._keys[k]: rows[:, k].copy() for k in np.flatnonzero(rows.any(axis=(0, 2)))}


def owners_of(model: Any, placed: Mapping[str, Placed], keys: list[str]) -> tuple[np.ndarray, np.ndarray]:
    """Return the places among ``keys`` of the bodies that own each geom and each flex, and -1 at the end."""
    mujoco = mujoco_package()
    geoms, flexes = np.full(model.ngeom + 1, -1), np.full(model.nflex + 1, -1)
    for k, key in enumerate(keys):
        own = placed[key]
        for found, kind, elements in (
            (geoms, mujoco.mjtObj.mjOBJ_GEOM, own.geoms), (flexes, mujoco.mjtObj.mjOBJ_FLEX, own.flexes),
        ):  # fmt: skip
            for element in elements:
                found[mujoco.mj_name2id(model, kind, element.name)] = k
    return geoms, flexes
