"""The ground that carries a robot: which feet stand, and what each bears."""

from __future__ import annotations

import numpy as np
from scipy.optimize import nnls

HEAVY = 1e4
"""How much more the balance counts than an even spread, in the search for corner forces that only push."""


def moment(arm: np.ndarray, force: np.ndarray) -> np.ndarray:
    """Return arm x force, (3,) each: NumPy's own takes ten times as long, which counts in every tick."""
    x, y, z = arm.tolist()
    u, v, w = force.tolist()
    return np.array([y * w - z * v, z * u - x * w, x * v - y * u])


def lowest_corners(corners: np.ndarray) -> np.ndarray:
    """Return the height (feet,) [m] of the lowest corner of each sole, corners (feet, 4, 3) [m]."""
    return corners[..., 2].min(axis=1)


def zero_moment_point(force: np.ndarray, torque: np.ndarray, height: float) -> np.ndarray:
    """Return where (2,) [m] in the plane z = height the moment of a ground reaction is upright; NaN without one.

    Args:
        force: (3,) [N].
        torque: (3,) [N m], about the world's origin.
        height: [m].
    """
    if not force[2] > 1e-9:
        return np.full(2, np.nan)
    return np.array([height * force[0] - torque[1], torque[0] + height * force[1]]) / force[2]


class Soles:
    """The soles that stand, and how they share what the ground must do.

    What two feet bear is not determined by the motion. Taken is what a slightly elastic ground under the corners would
    give: upright forces at the corners that only push, in balance with the whole, and of least squares. The rest, along
    the ground and about the upright axis, is shared in proportion. The sum is exactly the reaction that was given, also
    where no pushes could give it (the robot tips over).

    Args:
        corners: (feet, 4, 3) [m].
    """

    def __init__(self, corners: np.ndarray) -> None:
        feet = len(corners)
        self.corners = corners.copy()
        self.middles = corners.mean(axis=1)
        flat = corners.reshape(-1, 3)
        self._height, self._origin = float(flat[:, 2].mean()), self.middles[:, :2].mean(axis=0).tolist()
        self._balance = np.vstack([np.ones(len(flat)), (flat[:, :2] - self._origin).T])
        self._spread = self._balance.T @ np.linalg.inv(self._balance @ self._balance.T)
        # of a foot's four pushes: their sum, and their moments about the sole's middle along x and y
        arms = corners[..., :2] - self.middles[:, None, :2]
        self._sums = np.zeros((feet, 3, 4 * feet))
        for k in range(feet):
            own = slice(4 * k, 4 * k + 4)
            self._sums[k, 0, own], self._sums[k, 1, own], self._sums[k, 2, own] = 1.0, arms[k, :, 1], -arms[k, :, 0]

    def share(self, force: np.ndarray, torque: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Share a ground reaction.

        Args:
            force: (3,) [N], what the ground does to the robot.
            torque: (3,) [N m], about the world's origin.

        Returns:
            Forces (feet, 3) [N], and torques (feet, 3) [N m] about the middle of each sole.
        """
        feet = len(self.middles)
        upward = max(float(force[2]), 0.0)
        pushes = np.zeros(4 * feet)
        if upward > 0.0:
            x, y = zero_moment_point(force, torque, self._height).tolist()
            wanted = np.array([upward, upward * (x - self._origin[0]), upward * (y - self._origin[1])])
            pushes = self._spread @ wanted
            if pushes.min() < 0.0:
                rows = np.vstack([HEAVY * self._balance, np.eye(len(pushes))])
                pushes = nnls(rows, np.append(HEAVY * wanted, np.zeros(len(pushes))))[0]
        borne = self._sums @ pushes
        total = float(borne[:, 0].sum())
        share = borne[:, :1] / total if total > 0.0 else np.full((feet, 1), 1.0 / feet)
        forces = share * force
        torques = np.zeros((feet, 3))
        torques[:, :2] = borne[:, 1:]
        missing = torque - torques.sum(axis=0)
        for middle, own in zip(self.middles, forces, strict=True):
            missing -= moment(middle, own)
        return forces, torques + share * missing


def share_among_feet(force: np.ndarray, torque: np.ndarray, corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Share a ground reaction among soles with corners (feet, 4, 3) [m], once; see ``Soles``."""
    return Soles(corners).share(force, torque)
