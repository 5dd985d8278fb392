"""Kinematics in MuJoCo before a substep: where bodies are and how they move.

The batch works them out only within the substep.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from nuno.engines.mujoco.mujoco_package import mujoco_package

COPIED = ("qpos", "qvel", "mocap_pos", "mocap_quat")


class Kinematics:
    """Places and velocities of the worlds of a batch.

    Args:
        batch: The batch, whose model is not compiled anew.
    """

    def __init__(self, batch: Any) -> None:
        self._batch = batch
        self._models: list[Any] = []
        self._data: Any = None

    def of_worlds(self) -> Iterator[tuple[int, Any, Any]]:
        """Yield each world with its model and with data of its state, good until the next world.

        The frames of bodies, geoms and sites are worked out, and what `velocity_of` needs.
        """
        mujoco, batch = mujoco_package(), self._batch
        if not self._models:
            self._models = [batch.get_model(world) for world in range(len(batch.bind("qpos")))]
            self._data = mujoco.MjData(self._models[0])
        data = self._data
        for world, model in enumerate(self._models):
            for name in COPIED:
                getattr(data, name)[:] = batch.bind(name)[world]
            mujoco.mj_kinematics(model, data)
            mujoco.mj_comPos(model, data)
            mujoco.mj_comVel(model, data)
            yield world, model, data


def velocity_of(model: Any, data: Any, body: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the velocity [m/s] of the origin of a body's frame, and its spin [rad/s], (3,) each."""
    mujoco, motion = mujoco_package(), np.zeros(6)
    mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_XBODY, body, motion, 0)
    return motion[3:], motion[:3]
