"""Groups of joints that a controller each moves: arms, legs, hands, head and torso, as the model shows them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nuno.errors import InvalidInputError

if TYPE_CHECKING:
    from nuno.robot.humanoid import Humanoid

LIMBS = {"larm": "left_hand", "rarm": "right_hand", "lleg": "left_foot", "rleg": "right_foot", "head": "head_camera"}
"""Limbs by the names that robots' interfaces have for them, and the role of the frame at their end."""


def controller_groups(robot: Humanoid) -> dict[str, tuple[str, ...]]:
    """Return the joints of each controller, "larm_controller" and so on; every joint is in one of them.

    A limb's joints are those that carry its end and no other limb's; those that carry several are the torso's. What a
    limb's last joint carries besides its end, such as fingers, is that arm's hand: "lhand_controller". A robot whose
    description names no ends has one "fullbody_controller". Groups that the description lists count in place of all
    that, and joints in none of them are the "rest_controller"'s.

    Raises:
        UnknownNameError: a group has a joint that the robot lacks.
        InvalidInputError: a joint is in two groups.
    """
    if robot.description.groups:
        return _groups_of(robot)
    ends = {limb: role for limb, role in LIMBS.items() if role in robot.description.frames}
    if not ends:
        return {"fullbody_controller": robot.joint_names} if robot.joint_names else {}
    model = robot.model
    chains = {
        limb: [j for j in model.supports[model.frames[robot.frame_index(role)].parentJoint] if j >= 2]
        for limb, role in ends.items()
    }
    group: dict[int, str] = {}
    for limb, chain in chains.items():
        for j in chain:
            group[j] = "torso" if j in group else limb
    for j in range(2, model.njoints):  # parents come before their children
        if j not in group:
            above = group.get(model.parents[j], "torso")
            group[j] = above.replace("arm", "hand")
    order = ("larm", "rarm", "lhand", "rhand", "head", "torso", "lleg", "rleg")
    return {
        f"{name}_controller": tuple(model.names[j] for j in sorted(group) if group[j] == name)
        for name in order
        if name in group.values()
    }


def _groups_of(robot: Humanoid) -> dict[str, tuple[str, ...]]:
    found, taken = {}, dict[str, str]()
    for group, joints in robot.description.groups.items():
        for joint in joints:
            robot.joint_index(joint)
            if joint in taken:
                raise InvalidInputError(f"the joint {joint!r} is in the groups {taken[joint]!r} and {group!r}")
            taken[joint] = group
        found[f"{group}_controller"] = joints
    rest = tuple(joint for joint in robot.joint_names if joint not in taken)
    return found | ({"rest_controller": rest} if rest else {})
