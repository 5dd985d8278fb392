"""Transforms: where a robot's links and cameras are, as ROS' tf has them."""

from __future__ import annotations

from typing import Any

import numpy as np

from nuno.robot.interface import RobotInterface
from nuno.robot.pinocchio import pin
from nuno.robot.wire.image_messages import transform_fields

Fields = dict[str, Any]

ODOM = "odom"
"""The frame that the base is in."""


def camera_frame(camera: str) -> str:
    """Return the name of a camera's frame: x right, y down, z forward."""
    return f"{camera}_optical_frame"


def link_transforms(robot: RobotInterface, time: float) -> list[Fields]:
    """Return a geometry_msgs/msg/TransformStamped of every link in its parent, the base in "odom", and of cameras.

    Args:
        robot: The robot, which is asked for its joints and its base.
        time: [s], of the message.
    """
    robot.update_robot_state()
    model, data = robot.robot.model, robot.robot.update()
    links = [k for k, frame in enumerate(model.frames) if frame.type == pin.FrameType.BODY and frame.name != "universe"]
    found = []
    for k in links:
        parent = model.frames[k].parentFrame
        while parent and model.frames[parent].type != pin.FrameType.BODY:
            parent = model.frames[parent].parentFrame
        above = data.oMf[parent] if parent in links else pin.SE3.Identity()
        name = model.frames[parent].name if parent in links else ODOM
        found.append(_stamped(time, name, model.frames[k].name, above.actInv(data.oMf[k])))
    for camera in robot.camera_names:
        on = robot.robot.description.cameras[camera]
        frame = model.frames[robot.robot.frame_index(on.frame)]
        link = next(k for k in links if model.frames[k].name == _link_of(model, frame))
        pose = robot.robot.camera(camera).camera_to_world
        placed = data.oMf[link].actInv(pin.SE3(pose[:3, :3], pose[:3, 3]))
        found.append(_stamped(time, model.frames[link].name, camera_frame(camera), placed))
    return found


def _link_of(model: Any, frame: Any) -> str:
    """Return the link that carries a frame."""
    while frame.type != pin.FrameType.BODY:
        frame = model.frames[frame.parentFrame]
    return str(frame.name)


def _stamped(time: float, parent: str, child: str, placed: Any) -> Fields:
    x, y, z, w = pin.SE3ToXYZQUAT(placed)[3:]
    return transform_fields(time, parent, child, placed.translation, np.array([w, x, y, z]))
