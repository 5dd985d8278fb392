"""Forces and torques that joints bear, read for many at once."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from nuno.joints.joint import Joint
    from nuno.world.simulation import Simulation


def joint_loads(world: Simulation, joints: Sequence[Joint]) -> tuple[np.ndarray, np.ndarray]:
    """Return what joints bore in the last frame, as ``Joint.wrench`` and ``Joint.effort`` tell of each.

    Returns:
        Force [N] and torque [N m] of each body on the other, (worlds, n, 6), in the world's axes and about the joint,
        and what motors, springs, friction and stops did, (worlds, n). Zeros before the first frame.
    """
    wrenches, efforts = np.zeros((world.world_count, len(joints), 6)), np.zeros((world.world_count, len(joints)))
    for coupled in world._stepping.last:
        index, borne, along = coupled.joint_loads()
        for n, joint in enumerate(joints):
            k = index.get(joint)
            if k is not None:
                kept = coupled.kept[joint.body]
                wrenches[kept, n], efforts[kept, n] = borne[kept, k], along[kept, k]
    return wrenches, efforts
