"""Push: a force that acts on a body's vertices for a while."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class Push:
    """A force on a body's vertices.

    Attributes:
        force: (worlds, n, 3) float32 [N]; of a rigid body (worlds, 6): force, and torque [N m], at the centre of mass.
        end: The world's time [s] at which it ends, or None.
    """

    force: np.ndarray
    end: float | None
