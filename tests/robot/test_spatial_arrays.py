"""Spatial arrays show what Pinocchio has, as it is at any time, and what is written into them is what it takes."""

import numpy as np
import pinocchio as pin

from nuno.robot.spatial_arrays import placement_arrays, spatial_array


def test_arrays_show_what_pinocchio_has(still_talos):
    """Placements, velocities and forces of all joints, also after they have changed; to the bit."""
    model = still_talos.model
    data = model.createData()
    axes, places = placement_arrays(data.oMi)
    velocities, forces = spatial_array(data.v), spatial_array(data.f)
    random = np.random.default_rng(3)
    for _ in range(2):
        q = pin.integrate(model, still_talos.configuration(), random.normal(size=model.nv))
        v = random.normal(size=model.nv)
        pin.forwardKinematics(model, data, q, v)
        pin.rnea(model, data, q, v, v)
        np.testing.assert_array_equal(axes, [own.rotation for own in data.oMi])
        np.testing.assert_array_equal(places, [own.translation for own in data.oMi])
        np.testing.assert_array_equal(velocities, [own.vector for own in data.v])
        np.testing.assert_array_equal(forces, [own.vector for own in data.f])


def test_what_is_written_acts(still_talos):
    """A force on one joint is the same whether it is written or put there by Pinocchio's own means."""
    model, q, still = still_talos.model, still_talos.configuration(), np.zeros(still_talos.model.nv)
    one, other = (pin.StdVec_Force() for _ in range(2))
    for _ in range(model.njoints):
        one.append(pin.Force.Zero())
        other.append(pin.Force.Zero())
    wrench = np.arange(1.0, 7.0)
    spatial_array(one)[9] = wrench
    other[9] = pin.Force(wrench)
    found, expected = (pin.rnea(model, model.createData(), q, still, still, own) for own in (one, other))
    np.testing.assert_array_equal(found, expected)
    assert not np.array_equal(found, pin.rnea(model, model.createData(), q, still, still))
