"""Placements of joints in many configurations are those of Pinocchio, one by one."""

import numpy as np
import pinocchio as pin

from nuno.robot.joint_placements import JointPlacements


def test_placements_are_pinocchios_to_the_bit(still_talos):
    """Random configurations, the base turned and moved, too."""
    model, random = still_talos.model, np.random.default_rng(2)
    data = model.createData()
    several = np.array(
        [pin.integrate(model, still_talos.configuration(), random.normal(size=model.nv)) for _ in range(4)]
    )
    axes, origins = JointPlacements(model, model.createData()).at(several)
    for k, q in enumerate(several):
        pin.forwardKinematics(model, data, q)
        np.testing.assert_array_equal(axes[k], [own.rotation for own in data.oMi])
        np.testing.assert_array_equal(origins[k], [own.translation for own in data.oMi])
