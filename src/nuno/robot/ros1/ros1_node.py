"""The node of ROS 1: it puts what a rosbridge server publishes and takes onto a ROS master.

Run by the Python that has rospy, as a process of its own; it imports nothing of Nuno. It speaks the rosbridge protocol
by lines of JSON: answers and publications come by standard input, requests go to what was standard output.
"""

import json
import os
import sys
import threading
from typing import Any

from .control_definitions import message_class
from .ros1_fields import from_ros1, to_ros1

ACTIONS = {
    "/follow_joint_trajectory": "control_msgs/FollowJointTrajectory", "/gripper_cmd": "control_msgs/GripperCommand",
}  # fmt: skip
"""Kinds of actions by how their names end; others are not passed on."""
ROS1_NAMES = {"/controller_state": "/state", "/joint_trajectory": "/command"}
"""How names of controllers' topics end in ROS 1, where that differs."""
SUCCEEDED, CANCELED = 4, 5
NO_MASTER, READY = 3, "ready"
QUEUE = 10
"""Messages that wait for a slow subscriber."""
PATIENCE = 10.0
"""[s] For an answer of the server."""


class Wire:
    """The lines to and from the server.

    Args:
        out: What lines are written to.
    """

    def __init__(self, out: Any) -> None:
        self._out, self._lock = out, threading.Lock()
        self._answers: dict[str, Any] = {}
        self._came = threading.Condition()
        self.calls: dict[str, Any] = {}  # by topic
        self.goals: dict[str, Any] = {}  # by id

    def send(self, **message: Any) -> None:
        """Send a message of the protocol."""
        with self._lock:
            self._out.write(json.dumps(message) + "\n")
            self._out.flush()

    def ask(self, service: str, **arguments: Any) -> Any:
        """Call a service and return what it answers."""
        self.send(op="call_service", id=service, service=service, args=arguments)
        with self._came:
            if not self._came.wait_for(lambda: service in self._answers, PATIENCE):
                raise RuntimeError(f"{service} did not answer within {PATIENCE:g} s")
            return self._answers.pop(service)

    def read(self, lines: Any) -> None:
        """Deal with what comes until there is no more."""
        for line in lines:
            message = json.loads(line)
            if message["op"] == "service_response":
                with self._came:
                    self._answers[message["id"]] = message["values"]
                    self._came.notify_all()
            elif message["op"] == "publish" and message["topic"] in self.calls:
                self.calls[message["topic"]](message["msg"])
            elif message["op"] in ("action_feedback", "action_result") and message["id"] in self.goals:
                self.goals[message["id"]](message)
            elif message["op"] == "status":
                sys.stderr.write(f"nuno: the server says: {message.get('msg')}\n")


class Topic:
    """A topic that the server publishes: it is subscribed to there as long as somebody is here.

    Args:
        wire: To the server.
        name: The topic's.
        kind: Of ROS 1: "sensor_msgs/JointState".
    """

    def __init__(self, wire: Wire, name: str, kind: str) -> None:
        import rospy

        class Watch(rospy.SubscribeListener):
            def peer_subscribe(self, topic: str, publish: Any, publish_to_peer: Any) -> None:
                wire.send(op="subscribe", topic=name, queue_length=1)

            def peer_unsubscribe(self, topic: str, left: int) -> None:
                if left == 0:
                    wire.send(op="unsubscribe", topic=name)

        watch = None if name == "/clock" else Watch()  # all nodes live by the clock
        publisher = rospy.Publisher(
            ros1_name(name),
            message_class(kind),
            subscriber_listener=watch,
            queue_size=QUEUE,
            latch=kind == "std_msgs/String",
        )
        wire.calls[name] = lambda fields: publisher.publish(to_ros1(fields, kind))
        if watch is None:
            wire.send(op="subscribe", topic=name, queue_length=1)


class Action:
    """An action of the server as one of actionlib.

    Args:
        wire: To the server.
        name: The action's.
        kind: "control_msgs/FollowJointTrajectory".
    """

    def __init__(self, wire: Wire, name: str, kind: str) -> None:
        import actionlib

        self._wire, self._name, self._kind = wire, name, kind
        self._server = actionlib.ActionServer(name, message_class(f"{kind}Action"), self._begin, self._cancel, False)
        self._server.start()

    def _begin(self, handle: Any) -> None:
        goal = handle.get_goal_id().id
        self._wire.goals[goal] = lambda message: self._tell(handle, goal, message)
        self._wire.send(
            op="send_action_goal", id=goal, action=self._name, action_type=self._kind, feedback=True,
            args=from_ros1(handle.get_goal()),
        )  # fmt: skip

    def _cancel(self, handle: Any) -> None:
        self._wire.send(op="cancel_action_goal", id=handle.get_goal_id().id, action=self._name)

    def _tell(self, handle: Any, goal: str, message: Any) -> None:
        status = handle.get_goal_status().status
        is_new = status in (0, 7)  # pending, or recalling
        if message["op"] == "action_feedback":
            if is_new:
                handle.set_accepted()
            handle.publish_feedback(to_ros1(message["values"], f"{self._kind}Feedback"))
            return
        self._wire.goals.pop(goal, None)
        result = to_ros1(message["values"], f"{self._kind}Result")
        text = str(message["values"].get("error_string", ""))
        if not message["result"]:
            handle.set_rejected(result, text)
            return
        if is_new:
            handle.set_accepted()
        ends = {SUCCEEDED: handle.set_succeeded, CANCELED: handle.set_canceled}
        ends.get(message["status"], handle.set_aborted)(result, text)


def ros1_name(topic: str) -> str:
    """Return what a topic is called in ROS 1."""
    for end, other in ROS1_NAMES.items():
        if topic.endswith(end):
            return topic[: -len(end)] + other
    return topic


def main() -> int:
    """Join the master, pass on until standard input ends; 3 where there is no master."""
    out = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # rospy writes its log to standard output, which is the wire's
    import rosgraph
    import rospy

    if not rosgraph.is_master_online():
        return NO_MASTER
    rospy.set_param("/use_sim_time", True)  # before anything of this node asks for the time
    rospy.init_node("nuno", disable_signals=True)
    wire = Wire(out)
    reader = threading.Thread(target=wire.read, args=(sys.stdin,), daemon=True)
    reader.start()
    node = wire.ask("/rosapi/node_details", node="/nuno")
    topics = wire.ask("/rosapi/topics")
    kinds = {topic: kind.replace("/msg/", "/") for topic, kind in zip(topics["topics"], topics["types"], strict=True)}
    rospy.set_param("/robot_description", json.loads(wire.ask("/rosapi/get_param", name="robot_description")["value"]))
    kept: list[Any] = []
    for name in node["publishing"]:
        if "/_action/" not in name and message_class(kinds[name]) is not None:
            kept.append(Topic(wire, name, kinds[name]))
    for name in node["subscribing"]:

        def take(message: Any, name: str = name) -> None:
            wire.send(op="publish", topic=name, msg=from_ros1(message))

        kept.append(rospy.Subscriber(ros1_name(name), message_class(kinds[name]), take, queue_size=1))
    for name in wire.ask("/rosapi/action_servers")["action_servers"]:
        kind = next((own for end, own in ACTIONS.items() if name.endswith(end)), None)
        if kind is not None:
            kept.append(Action(wire, name, kind))
    wire.send(op=READY)
    reader.join()
    rospy.signal_shutdown("the server has gone")
    return 0
