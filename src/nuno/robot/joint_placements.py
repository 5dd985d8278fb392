"""JointPlacements: where Pinocchio's joints are in many configurations."""

from __future__ import annotations

from typing import Any

import numpy as np

from nuno.robot.pinocchio import pin
from nuno.robot.spatial_arrays import placement_arrays


class JointPlacements:
    """Forward kinematics of many configurations, one after the other by Pinocchio.

    Args:
        model: Pinocchio's model.
        data: Its data, which is changed.

    Attributes:
        data: Likewise.
    """

    def __init__(self, model: Any, data: Any) -> None:
        self._model, self.data = model, data
        axes, origins = placement_arrays(data.oMi.tolist())
        nine, step = 9 * axes.itemsize, axes.strides[0]
        assert origins.ctypes.data - axes.ctypes.data == nine and axes.strides[1:] == (8, 24), "columns, then the place"
        self._numbers = np.lib.stride_tricks.as_strided(axes, (len(axes), 12), (step, axes.itemsize))

    def at(self, configurations: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return rotation matrices (k, joints, 3, 3) and places (k, joints, 3) [m] in configurations (k, nq).

        The matrices lie column by column, as Pinocchio's do.
        """
        found = np.empty((len(configurations), *self._numbers.shape))
        for own, q in zip(found, configurations, strict=True):
            pin.forwardKinematics(self._model, self.data, q)
            own[...] = self._numbers
        return found[..., :9].reshape(*found.shape[:2], 3, 3).swapaxes(-1, -2), found[..., 9:]
