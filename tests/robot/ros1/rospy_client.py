"""A program of ROS 1, run by the Python that has rospy: it says in JSON what it has seen and done."""

import json
import sys
import threading
import time

import actionlib
import rospy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import CameraInfo, Image, JointState
from tf2_msgs.msg import TFMessage
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

sys.path.append(sys.argv[1])
from ros1.control_definitions import message_class

ACTION = "control_msgs/FollowJointTrajectory"
CHECKSUM = "bc4f9b743838566551c0390c65f1a248"  # of control_msgs/FollowJointTrajectoryAction, as that package has it
PATIENCE = 120.0


def trajectory(joints, positions, seconds):
    """One point."""
    point = JointTrajectoryPoint(positions=positions, time_from_start=rospy.Duration(seconds))
    return JointTrajectory(joint_names=joints, points=[point])


def main():
    """Look at topics, send goals, walk."""
    rospy.init_node("client", anonymous=True)
    seen = {}
    rospy.wait_for_message("/clock", Clock, PATIENCE)  # the node's own time begins with it
    while not rospy.Time.now():
        time.sleep(0.01)
    state = rospy.wait_for_message("/joint_states", JointState, PATIENCE)
    seen["names"], seen["stamp"], seen["now"] = state.name, state.header.stamp.to_sec(), rospy.Time.now().to_sec()
    transforms = rospy.wait_for_message("/tf", TFMessage, PATIENCE).transforms
    seen["pelvis_in"] = next(own.header.frame_id for own in transforms if own.child_frame_id == "pelvis")
    seen["urdf"] = rospy.get_param("/robot_description")[:200]
    image = rospy.wait_for_message("/head/image_raw", Image, PATIENCE)
    seen["image"] = [image.height, image.width, image.encoding, sum(image.data)]
    info = rospy.wait_for_message("/head/camera_info", CameraInfo, PATIENCE)
    seen["focal"] = info.K[0]

    kind = message_class(f"{ACTION}Action")
    assert kind._md5sum == CHECKSUM
    joints = [name for name in state.name if name in json.loads(sys.argv[2])]
    before = dict(zip(state.name, state.position, strict=True))
    client = actionlib.SimpleActionClient("/larm_controller/follow_joint_trajectory", kind)
    seen["server"] = client.wait_for_server(rospy.Duration(PATIENCE))
    goal = message_class(f"{ACTION}Goal")
    told = []
    wanted = [before[joint] + 0.2 for joint in joints]
    client.send_goal(goal(trajectory=trajectory(joints, wanted, 0.3)), feedback_cb=told.append)
    client.wait_for_result(rospy.Duration(PATIENCE))
    seen["status"], seen["code"] = client.get_state(), client.get_result().error_code
    seen["feedback"] = told[-1].joint_names == joints
    client.send_goal(goal(trajectory=trajectory(joints, wanted, 1000.0)))
    done = threading.Event()
    rospy.sleep(0.3)
    client.cancel_goal()
    client.wait_for_result(rospy.Duration(PATIENCE))
    seen["cancelled"] = client.get_state()
    client.send_goal(goal(trajectory=trajectory(joints[:1], wanted[:1], 0.3)))
    client.wait_for_result(rospy.Duration(PATIENCE))
    seen["refused"], seen["refused_code"] = client.get_state(), client.get_result().error_code

    command = rospy.Publisher("/larm_controller/command", JointTrajectory, queue_size=1)
    velocity = rospy.Publisher("/cmd_vel", Twist, queue_size=1)
    while not (command.get_num_connections() and velocity.get_num_connections()):
        rospy.sleep(0.05)
    command.publish(trajectory(joints, [before[joint] for joint in joints], 0.2))
    twist = Twist()
    twist.linear.x = 0.3
    velocity.publish(twist)
    went = rospy.Subscriber("/odom", Odometry, lambda own: done.set() if own.pose.pose.position.x > 0.02 else None)
    seen["walked"] = done.wait(PATIENCE)
    went.unregister()
    for _ in range(100):
        state = rospy.wait_for_message("/joint_states", JointState, PATIENCE)
        now = dict(zip(state.name, state.position, strict=True))
        seen["back"] = max(abs(now[joint] - before[joint]) for joint in joints)
        if seen["back"] < 1e-6:
            break
    sys.stdout.write(json.dumps(seen) + "\n")


main()
