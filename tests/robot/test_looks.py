"""Looks: every visual mesh goes along with a body, where the robot has it."""

import numpy as np
import pytest

import nuno
from nuno.robot.looks import looks_of
from nuno.shapes.coordinates import compose


@pytest.mark.parametrize("name", ["talos", "g1"])
def test_every_mesh_is_where_the_robot_has_it(name, request):
    """Also those of joints without hulls, two in G1's waist; some are of the same link."""
    robot = request.getfixturevalue(name)
    links = robot.enter(nuno.World(device="cpu"))
    looks = looks_of(links)
    shapes = robot.geometry.shapes("visual")
    assert [look.shape for look in looks] == list(shapes)
    data = robot.update()
    for look, shape in zip(looks, shapes, strict=True):
        place, _ = compose(links.bodies[look.body].pose(), look.pose)
        np.testing.assert_allclose(place, data.oMi[shape.joint].act(shape.position), atol=1e-12)
    with_body = {links.joints[look.body] for look in looks}
    assert ({shape.joint for shape in shapes} - with_body != set()) == (name == "g1")
