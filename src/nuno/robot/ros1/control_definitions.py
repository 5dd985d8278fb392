"""Messages of control_msgs as ROS 1 (Noetic) has them, for systems whose ROS lacks that package, as Debian's does.

Run by the Python that has rospy; it imports nothing of Nuno. genpy makes classes of them, with the checksums that the
package's own have: those depend on the fields alone.
"""

import importlib
from typing import Any

POINT = "trajectory_msgs/JointTrajectoryPoint"
MOTION = f"Header header\nstring[] joint_names\n{POINT} desired\n{POINT} actual\n{POINT} error\n"
CODES = "".join(
    f"int32 {name} = {-k}\n"
    for k, name in enumerate(
        ("SUCCESSFUL", "INVALID_GOAL", "INVALID_JOINTS", "OLD_HEADER_TIMESTAMP", "PATH_TOLERANCE_VIOLATED",
         "GOAL_TOLERANCE_VIOLATED")
    )
)  # fmt: skip
GRIPPER_STATE = "float64 position\nfloat64 effort\nbool stalled\nbool reached_goal\n"
TEXTS = {
    "JointTrajectoryControllerState": MOTION,
    "JointTolerance": "string name\nfloat64 position\nfloat64 velocity\nfloat64 acceleration\n",
    "GripperCommand": "float64 position\nfloat64 max_effort\n",
    "FollowJointTrajectoryGoal": (
        "trajectory_msgs/JointTrajectory trajectory\nJointTolerance[] path_tolerance\n"
        "JointTolerance[] goal_tolerance\nduration goal_time_tolerance\n"
    ),
    "FollowJointTrajectoryResult": f"int32 error_code\n{CODES}string error_string\n",
    "FollowJointTrajectoryFeedback": MOTION,
    "GripperCommandGoal": "GripperCommand command\n",
    "GripperCommandResult": GRIPPER_STATE,
    "GripperCommandFeedback": GRIPPER_STATE,
}
"""By name, the fields of messages."""
for _action in ("FollowJointTrajectory", "GripperCommand"):
    TEXTS[f"{_action}ActionGoal"] = f"Header header\nactionlib_msgs/GoalID goal_id\n{_action}Goal goal\n"
    for _part in ("Result", "Feedback"):
        TEXTS[f"{_action}Action{_part}"] = (
            f"Header header\nactionlib_msgs/GoalStatus status\n{_action}{_part} {_part.lower()}\n"
        )
    TEXTS[f"{_action}Action"] = "".join(
        f"{_action}Action{part} action_{part.lower()}\n" for part in ("Goal", "Result", "Feedback")
    )

_made: dict[str, Any] = {}


def message_class(kind: str) -> Any:
    """Return the class of a ROS 1 message ("sensor_msgs/Image"): the package's own, or one made here; None of neither."""
    import roslib.message

    found = roslib.message.get_message_class(kind)
    package, _, name = kind.partition("/")
    if found is None and package == "control_msgs" and name in TEXTS:
        if kind not in _made:
            from genpy.dynamic import generate_dynamic

            _made.update(generate_dynamic(kind, _with_parts(kind)))
        found = _made[kind]
    return found


def _with_parts(kind: str) -> str:
    """Return the text of a message, and after it those of all that it is made of, as rosbags hold them."""
    texts, waiting = {}, [kind]
    while waiting:
        own = waiting.pop(0)
        if own in texts:
            continue
        texts[own] = _text(own)
        for line in texts[own].splitlines():
            part = line.split()[0].partition("[")[0] if line.split() and "=" not in line else ""
            if part == "Header":
                waiting.append("std_msgs/Header")
            elif "/" in part:
                waiting.append(part)
            elif part in TEXTS:
                waiting.append(f"control_msgs/{part}")
            elif f"{own.partition('/')[0]}/{part}" in _siblings(own):
                waiting.append(f"{own.partition('/')[0]}/{part}")
    first, *rest = texts.items()
    rule = "=" * 80
    return first[1] + "".join(f"{rule}\nMSG: {name}\n{text}" for name, text in rest)


def _text(kind: str) -> str:
    package, _, name = kind.partition("/")
    if package == "control_msgs":
        return TEXTS[name]
    own = getattr(importlib.import_module(f"{package}.msg"), name)
    text = own._full_text.partition("=" * 80)[0]
    return "\n".join(line.partition("#")[0].rstrip() for line in text.splitlines()) + "\n"


def _siblings(kind: str) -> set[str]:
    package = kind.partition("/")[0]
    if package == "control_msgs":
        return set()
    return {f"{package}/{name}" for name in dir(importlib.import_module(f"{package}.msg"))}
