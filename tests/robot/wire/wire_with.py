"""What talks to servers in tests of the wire, and waits for what happens in other threads."""

import json
import time

import numpy as np
from websockets.sync.client import connect

PATIENCE = 120.0
"""[s] No wait of these tests takes a tenth of that; one that hangs fails after it."""


class RawClient:
    """A websocket that says what it is told to, whether it is of the protocol or not."""

    def __init__(self, url, **options):
        """Connect."""
        self.socket = connect(url, compression=None, **({"close_timeout": 0.5} | options))

    def say(self, message):
        """Send a text as it is, or anything else as JSON."""
        self.socket.send(message if isinstance(message, (str, bytes)) else json.dumps(message))

    def hear(self, **wanted):
        """Return the next message with these fields."""
        while True:
            message = json.loads(self.socket.recv(timeout=PATIENCE))
            if all(message.get(field) == value for field, value in wanted.items()):
                return message


def until(condition):
    """Wait for what another thread does."""
    end = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < end, "it did not happen"
        time.sleep(0.002)


def advance(client, duration=0.1, heard=None):
    """Let time pass, and return the answer: proof that the simulation goes on. What comes before it goes to a list."""
    nanosec = round(1e9 * duration)
    client.say({
        "op": "call_service", "id": "go on", "service": "/simulation/advance",
        "args": {"duration": {"sec": nanosec // 10**9, "nanosec": nanosec % 10**9}},
    })  # fmt: skip
    while (message := client.hear()).get("id") != "go on":
        if heard is not None:
            heard.append(message)
    return message


def goal(robot, controller="larm_controller", seconds=1, change=0.2, **message):
    """A goal of one point, as a client sends it."""
    joints = robot.controller_param_table[controller][0]["joint_names"]
    positions = [robot.angles[joint] + change for joint in joints]
    point = {"positions": positions, "time_from_start": {"sec": seconds, "nanosec": 0}}
    return {
        "op": "send_action_goal", "id": "g", "action": f"/{controller}/follow_joint_trajectory",
        "action_type": "control_msgs/action/FollowJointTrajectory", "feedback": True,
        "args": {"trajectory": {"joint_names": joints, "points": [point]}},
    } | message  # fmt: skip


def angles(robot, controller="larm_controller"):
    """Where a controller's joints are."""
    return np.array([robot.angles[joint] for joint in robot.controller_param_table[controller][0]["joint_names"]])
