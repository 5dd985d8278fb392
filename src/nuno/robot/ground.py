"""The ground that carries a robot: which feet stand, and what each bears."""

from __future__ import annotations

import numpy as np
from scipy.optimize import nnls

GUESSES = 10
"""Of which corners push, before the search is given up; two or three are usual."""
FLAT = 1e-12
"""[m4] Determinant of the balance of corners that lie on a line: that of soles of a millimetre."""
HEAVY = 1e4
"""Weight of the balance over that of an even spread, in the search for corner forces that only push."""


def moment(arm: np.ndarray, force: np.ndarray) -> np.ndarray:
    """Return arm x force, (3,) each: NumPy's own takes ten times as long, which counts in every tick."""
    x, y, z = arm.tolist()
    u, v, w = force.tolist()
    return np.array([y * w - z * v, z * u - x * w, x * v - y * u])


def lowest_corners(corners: np.ndarray) -> np.ndarray:
    """Return the height (feet,) [m] of the lowest corner of each sole, corners (feet, 4, 3) [m]."""
    return corners[..., 2].min(axis=1)


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
        # of a foot's four pushes: their sum, and their moments about the sole's middle along x and y
        arms = corners[..., :2] - self.middles[:, None, :2]
        self._sums = np.zeros((feet, 3, 4 * feet))
        for k in range(feet):
            own = slice(4 * k, 4 * k + 4)
            self._sums[k, 0, own], self._sums[k, 1, own], self._sums[k, 2, own] = 1.0, arms[k, :, 1], -arms[k, :, 0]
        # which corners push when nothing is known, and nothing of how much where feet have no size
        everywhere = np.ones(4 * feet, dtype=bool)
        self._pushing, self._levels, self._distribution = everywhere, np.zeros((4 * feet, 3)), np.zeros((3 * feet, 3))
        self._take_as_pushing(everywhere)

    def share(self, force: np.ndarray, torque: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Share a ground reaction.

        Args:
            force: (3,) [N], what the ground does to the robot.
            torque: (3,) [N m], about the world's origin.

        Returns:
            Forces (feet, 3) [N], and torques (feet, 3) [N m] about the middle of each sole.
        """
        feet = len(self.middles)
        along_x, along_y, upward = force.tolist()
        about_x, about_y, _ = torque.tolist()
        borne = np.zeros((feet, 3))
        if upward > 0.0:
            x, y = self._origin
            lever_x = self._height * along_x - about_y - x * upward
            lever_y = self._height * along_y + about_x - y * upward
            borne = self._borne(np.array([upward, lever_x, lever_y]))
        total = sum(borne[:, 0].tolist())
        share = borne[:, 0] / total if total > 0.0 else np.full(feet, 1.0 / feet)
        torques = np.zeros((feet, 3))
        torques[:, :2] = borne[:, 1:]
        missing = torque - torques.sum(axis=0) - moment(share @ self.middles, force)
        return share[:, None] * force, torques + share[:, None] * missing

    def _borne(self, wanted: np.ndarray) -> np.ndarray:
        """Return the upright force of each foot and its moments along x and y about the sole's middle, (feet, 3).

        The least squares of pushes p in balance, B p = w, are p = max(0, B^T y): which corners push is guessed, most
        often rightly as at the last call, and y follows; B^T y tells which ones push then.
        """
        for _ in range(GUESSES):
            pushing = self._levels @ wanted > 0.0
            if (pushing == self._pushing).all():
                return (self._distribution @ wanted).reshape(-1, 3)
            if not self._take_as_pushing(pushing):
                break
        self._take_as_pushing(np.ones(len(pushing), dtype=bool))
        # nothing that only pushes is in balance, or just so: as nearly as it goes
        rows = np.vstack([HEAVY * self._balance, np.eye(len(pushing))])
        return self._sums @ nnls(rows, np.append(HEAVY * wanted, np.zeros(len(pushing))))[0]

    def _take_as_pushing(self, pushing: np.ndarray) -> bool:
        """Let some corners (4 feet,) push, and no others; return whether those can be in balance."""
        some = self._balance[:, pushing]
        square = some @ some.T
        if np.linalg.det(square) < FLAT:
            return False
        inverse = np.linalg.inv(square)
        self._pushing, self._levels = pushing, self._balance.T @ inverse
        self._distribution = (self._sums[:, :, pushing] @ some.T @ inverse).reshape(-1, 3)
        return True
