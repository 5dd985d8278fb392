"""Spatial arrays show what Pinocchio has, as it is at any time, and what is written into them is what it takes."""

import numpy as np
import pinocchio as pin

from nuno.robot.spatial_arrays import placement_arrays, quaternions_of, spatial_array


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


def test_quaternions_are_pinocchios_to_the_bit():
    """Random turns, of which a good third has a negative trace, and half turns about each axis."""
    random = np.random.default_rng(5)
    turns = [pin.Quaternion(own / np.linalg.norm(own)).toRotationMatrix() for own in random.normal(size=(3000, 4))]
    turns += [np.diag(own) for own in ((1.0, 1.0, 1.0), (1.0, -1.0, -1.0), (-1.0, 1.0, -1.0), (-1.0, -1.0, 1.0))]
    matrix = pin.rpy.rpyToMatrix
    turns += [matrix(*own) @ matrix(own[1], 3.1, own[0]) for own in random.normal(size=(500, 3))]
    rotations = np.array(turns)
    assert 0.2 < (np.trace(rotations, axis1=1, axis2=2) < 0.0).mean() < 0.8
    expected = np.array([pin.SE3ToXYZQUAT(pin.SE3(own, np.zeros(3)))[3:] for own in turns])
    np.testing.assert_array_equal(quaternions_of(rotations), expected)
    np.testing.assert_array_equal(quaternions_of(rotations[:12].reshape(3, 4, 3, 3)), expected[:12].reshape(3, 4, 4))
