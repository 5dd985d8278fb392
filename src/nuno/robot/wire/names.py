"""Names: what a robot's topics, services and actions are called on the wire."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from nuno.validation import check_fields, checked

# Of Nuno's own server, beside what robots with ROS 2 have
ADVANCE = "/simulation/advance"
CLOCK_KIND = "/simulation/clock_kind"
GO_VELOCITY = "/simulation/go_velocity"
STEPPED, RUNNING = "stepped", "running"


@dataclass(frozen=True)
class Names:
    """Names of topics and actions; the defaults are those of most robots with ROS 2.

    Those of controllers come from the actions in ``default_controller()`` of the interface.

    Attributes:
        namespace: What all that do not begin with "/" are put behind.
        clock: Topic of the simulation's time, which a real robot has none of.
        joint_states: Topic of the joints.
        odometry: Topic of where the base is.
        velocity: Topic that the base takes velocities from.
        navigate: Action that brings the base to a place.
        imu: Topic of the inertial measurement unit.
        wrench: Topics of forces; "{frame}" stands for the frame's role: "left_wrist" ...
        gripper: Actions of hands; "{hand}" stands for "left_hand" ...
        description: Topic of the URDF.
        image: Topics of colour images; "{camera}" stands for the camera's name: "head" ...
        compressed: Likewise, compressed.
        depth: Likewise, of depth images.
        camera_info: Likewise, of the cameras' pixels.
        transforms: Topic of where all links are.
    """

    namespace: str = ""
    clock: str = "/clock"
    joint_states: str = "joint_states"
    odometry: str = "odom"
    velocity: str = "cmd_vel"
    navigate: str = "navigate_to_pose"
    imu: str = "imu/data"
    wrench: str = "{frame}/wrench"
    gripper: str = "{hand}/gripper_cmd"
    description: str = "robot_description"
    image: str = "{camera}/image_raw"
    compressed: str = "{camera}/image_raw/compressed"
    depth: str = "{camera}/depth/image_raw"
    camera_info: str = "{camera}/camera_info"
    transforms: str = "/tf"

    def __post_init__(self) -> None:
        check_fields(self)

    def state_of(self, controller: Mapping[str, Any]) -> str:
        """Return the topic on which a controller tells where its joints are to be, in full."""
        return self.full(f"{controller['controller_action'].rpartition('/')[0]}/controller_state")

    def status_of(self, controller: Mapping[str, Any]) -> str:
        """Return the topic on which a controller tells whether it follows a goal, in full."""
        return self.full(f"{controller['controller_action']}/_action/status")

    def trajectory_of(self, controller: Mapping[str, Any]) -> str:
        """Return the topic on which a controller takes trajectories, in full."""
        return self.full(f"{controller['controller_action'].rpartition('/')[0]}/joint_trajectory")

    @checked
    def full(self, name: str, **parts: str) -> str:
        """Return a name in full, with its parts filled in: "/joint_states"."""
        filled = name.format(**parts)
        if filled.startswith("/"):
            return filled
        return "/" + "/".join(part.strip("/") for part in (self.namespace, filled) if part.strip("/"))
