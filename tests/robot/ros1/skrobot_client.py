"""scikit-robot's own interface to ROS 1, unmodified, as a program for a real robot has it."""

import json
import re
import sys
import tempfile
import types

sys.path.append("/usr/lib/python3/dist-packages")  # rospy, beside scikit-robot's Python
sys.path.append(sys.argv[1])
from ros1.control_definitions import TEXTS, message_class

control = types.ModuleType("control_msgs")  # which Debian lacks; elsewhere it is a package of ROS
control.msg = types.ModuleType("control_msgs.msg")
for _name in TEXTS:
    setattr(control.msg, _name, message_class(f"control_msgs/{_name}"))
control.msg.SingleJointPositionActionGoal = type("SingleJointPositionActionGoal", (), {})  # only asked for by class
sys.modules |= {"control_msgs": control, "control_msgs.msg": control.msg}

import numpy as np
import rospy
from skrobot.interfaces.ros.base import ROSRobotInterfaceBase
from skrobot.models.urdf import RobotModelFromURDF

JOINTS = json.loads(sys.argv[2])


class Interface(ROSRobotInterfaceBase):
    """The left arm."""

    def default_controller(self):
        """As scikit-robot's own robots have it."""
        return [
            {
                "controller_type": "larm_controller", "controller_action": "larm_controller/follow_joint_trajectory",
                "controller_state": "larm_controller/state",
                "action_type": control.msg.FollowJointTrajectoryAction, "joint_names": JOINTS,
            }
        ]  # fmt: skip


def main():
    """Move, wait, move through a sequence, cancel."""
    rospy.init_node("skrobot", anonymous=True, disable_signals=True)
    text = rospy.get_param("/robot_description")
    text = re.sub(r"<(visual|collision)\b.*?</\1>", "", text, flags=re.S)  # shapes are not what is asked for
    with tempfile.NamedTemporaryFile("w", suffix=".urdf") as file:
        file.write(text)
        file.flush()
        model = RobotModelFromURDF(urdf_file=file.name)
    ri = Interface(model)
    seen = {"controllers": len(ri.controller_actions)}
    ri.update_robot_state(wait_until_update=True)
    model.angle_vector(ri.robot.angle_vector())
    joint = getattr(model, JOINTS[0])
    start = float(joint.joint_angle())
    joint.joint_angle(start + 0.2)
    ri.angle_vector(model.angle_vector(), 0.5)
    seen["wait"] = [bool(own) for own in ri.wait_interpolation()]
    ri.update_robot_state(wait_until_update=True)
    seen["there"] = float(getattr(ri.robot, JOINTS[0]).joint_angle()) - start
    vectors = []
    for change in (0.1, 0.3):
        joint.joint_angle(start + change)
        vectors.append(np.array(model.angle_vector()))
    ri.angle_vector_sequence(vectors, [0.3, 0.3])
    ri.wait_interpolation()
    ri.update_robot_state(wait_until_update=True)
    seen["sequence"] = float(getattr(ri.robot, JOINTS[0]).joint_angle()) - start
    joint.joint_angle(start)
    ri.angle_vector(model.angle_vector(), 100.0)
    rospy.sleep(0.5)
    seen["moving"] = bool(ri.is_interpolating())
    ri.cancel_angle_vector()
    rospy.sleep(0.5)
    seen["cancelled"] = not ri.is_interpolating()
    print(json.dumps(seen))
    rospy.signal_shutdown("done")


main()
