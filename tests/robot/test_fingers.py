"""Fingers that the model fixes: which links they are, where they go, and what is said where a table is wrong."""

import numpy as np
import pytest
from lifter import TABLE, URDF, lifter_in

import nuno
from nuno.errors import InvalidInputError, RobotModelError
from nuno.robot.fingers import fingers_of
from nuno.shapes.coordinates import Coordinates


def test_talos_tips_meet(still_talos):
    """Two fingers a hand; closed, the pads of the two sides meet in the middle of the hand, to 0.2 mm."""
    robot = still_talos.copy()
    world = nuno.World(device="cpu")
    links = robot.enter(world)
    assert [finger.hand for finger in fingers_of(robot)] == ["left_hand"] * 2 + ["right_hand"] * 2
    robot.angle_vector({"gripper_left_joint": -0.61})
    links.follow(0.0)
    frame = robot.frame_pose("left_hand")
    frame = Coordinates(frame.position, frame.quaternion)
    sides = {}
    for k in (1, 2, 3):
        body = links.bodies[links.names.index(f"gripper_left_fingertip_{k}_link")]
        y = frame.to_local(body.vertices)[:, 1]
        sides[k] = y.min() if y.mean() > 0.0 else y.max()
    np.testing.assert_allclose(list(sides.values()), 0.0, atol=2e-4)
    right = links.bodies[links.names.index("gripper_right_fingertip_3_link")]
    assert np.abs(robot.frame_pose("right_hand").to_local(right.vertices)[:, 1]).min() > 0.045  # the other is open


def test_a_link_body_of_joints_leaves_fingers_out(tmp_path):
    """One body for each joint, then one for each finger, which has the mass that the hand has not."""
    world = nuno.World(device="cpu")
    robot = lifter_in(tmp_path, world, dynamics=True)
    assert len(robot.links.names) == robot.actual.model.njoints - 1 + 2 and robot.links.names[-2:] == ("a", "b")
    masses = {name: body.mass for name, body in zip(robot.links.names, robot.links.bodies, strict=True)
              if body.is_dynamic}  # fmt: skip
    assert masses["a"] == masses["b"] == pytest.approx(0.05) and masses["palm"] == pytest.approx(0.9)


@pytest.mark.parametrize(
    ("before", "after", "error", "message"),
    [
        ('fingers = [["a"], ["b"]]', 'fingers = [["a"], ["crank"]]', InvalidInputError, "moves with 'turn'"),
        ('fingers = [["a"], ["b"]]', 'fingers = [["a"], ["c"]]', RobotModelError, "'c'"),
        ('fingers = [["a"], ["b"]]', 'fingers = ["a"]', InvalidInputError, "list of names"),
        ("width = 0.08", "width = 0.0", InvalidInputError, "how wide they open"),
    ],
)
def test_bad_tables(tmp_path, before, after, error, message):
    """Named with the finger and what is wrong with it."""
    (tmp_path / "lifter.urdf").write_text(URDF)
    (tmp_path / "robots.toml").write_text(TABLE.replace(before, after))
    with pytest.raises(error, match=message):
        nuno.Humanoid("lifter", robots=tmp_path / "robots.toml").enter(nuno.World(device="cpu"))
