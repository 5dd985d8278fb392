"""Shapes of links: hulls, mirrored meshes, and which links run into each other."""

import numpy as np
import pytest

import nuno
from few_variants import few
from nuno.mesh.closed import enclosed_volume
from nuno.robot.description import robot_data
from nuno.shapes.shape import Cylinder, TriangleMesh


@pytest.mark.parametrize("name", few(["talos", "g1"], "talos"))
def test_collision_shapes_are_closed_and_convex(name, request):
    """Every corner lies behind every face: the definition of a convex solid."""
    robot = request.getfixturevalue(f"still_{name}")
    shapes = [own.shape for own in robot.geometry.shapes("collision")]
    assert len(shapes) == {"talos": 52, "g1": 36}[name]  # as the URDFs count them
    for shape in shapes:
        assert shape.is_solid
        vertices, faces = shape.mesh()
        if isinstance(shape, TriangleMesh):
            a, b, c = (vertices[faces[:, k]] for k in range(3))
            normals = np.cross(b - a, c - a)
            area = np.linalg.norm(normals, axis=1)
            flat = area < 1e-12  # [m2] slivers, whose normals are rounding
            normals = normals[~flat] / area[~flat, None]
            assert ((vertices[None] - a[~flat][:, None]) @ normals[..., None]).max() < 1e-6  # [m] files hold float32


def test_mirrored_meshes_look_outwards(still_talos):
    """A right leg is the mirror of a left one: the same volume, not its negative."""
    volumes = {own.link: enclosed_volume(*own.shape.mesh()) for own in still_talos.geometry.shapes("visual")
               if isinstance(own.shape, TriangleMesh)}  # fmt: skip
    for part in ("leg_{}_2_link", "arm_{}_1_link", "arm_{}_4_link"):
        left, right = volumes[part.format("left")], volumes[part.format("right")]
        assert left > 0.0
        assert np.isclose(left, right, rtol=1e-4)  # float32 in files


def test_primitive_shapes_are_taken_as_they_are(still_talos):
    """The wrist's force sensor is a cylinder in the URDF."""
    (sensor,) = [own for own in still_talos.geometry.shapes("collision") if own.link == "wrist_left_ft_link"]
    assert isinstance(sensor.shape, Cylinder)


def test_links_that_run_into_each_other_are_found(talos):
    """Standing nothing touches; with the left hand 0.18 m right of the middle the forearm is in the chest."""
    assert talos.self_collisions() == []
    talos.angle_vector({"arm_left_2_joint": 0.0, "arm_left_3_joint": -1.5, "arm_left_4_joint": -1.6})
    assert ("torso_2_link", "arm_left_5_link") in talos.self_collisions()


def test_without_an_srdf_neighbours_may_overlap(g1):
    """Standing nothing counts; a hand inside the thigh does."""
    assert g1.self_collisions() == []
    g1.angle_vector({"left_shoulder_roll_joint": -0.5, "left_elbow_joint": 1.4})
    assert g1.self_collisions()


@pytest.mark.parametrize("name", ["talos", "g1"])
def test_pairs_that_are_checked(name, request):
    """None of one joint; without an SRDF none of neighbours, and all others: as many as counting them says."""
    robot = request.getfixturevalue(f"still_{name}")
    model, _ = robot.geometry._collision_model
    joints = [part.parentJoint for part in model.geometryObjects]
    pairs = {frozenset((pair.first, pair.second)) for pair in model.collisionPairs}
    assert all(joints[a] != joints[b] for a, b in pairs)
    if name == "g1":
        near = {frozenset((j, parent)) for j, parent in enumerate(robot.model.parents)}
        every = [(a, b) for a in range(len(joints)) for b in range(a) if joints[a] != joints[b]]
        far = {frozenset((a, b)) for a, b in every if frozenset((joints[a], joints[b])) not in near}
        assert pairs == far  # in its posture nothing overlaps


def test_what_overlaps_in_the_posture_is_not_checked():
    """Romeo's SRDF leaves pairs out that always overlap; else it could never reach anywhere."""
    romeo = nuno.Humanoid(
        robot_data() / "romeo_description/urdf/romeo_small.urdf",
        srdf=robot_data() / "romeo_description/srdf/romeo_small.srdf",
    )
    assert romeo.self_collisions() == []
    romeo.angle_vector({"LShoulderPitch": 1.2, "LShoulderYaw": -0.3, "LElbowRoll": -1.0})
    assert romeo.self_collisions()
