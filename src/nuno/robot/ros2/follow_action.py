"""FollowAction: the action FollowJointTrajectory of a controller in a ROS 2 graph."""

from __future__ import annotations

import logging
from typing import Any

from nuno.robot.ros2.dds_bridge import DdsBridge
from nuno.robot.wire import messages as ros
from nuno.robot.wire.protocol import CANCELED, EXECUTING, SUCCEEDED, Message

logger = logging.getLogger(__name__)

Fields = dict[str, Any]

FOLLOW = "control_msgs/action/FollowJointTrajectory"
REMEMBERED = 100
"""Goals of a controller whose results are kept for those who ask later."""
NO_SUCH_GOAL = 2
"""The return code of action_msgs/srv/CancelGoal; 0 is that the goal is being cancelled."""


class FollowAction:
    """An action's three services and two topics, as a client of ``Commands`` that speaks for all who send goals.

    Services carry the header of rmw_cyclonedds_cpp; clients on another middleware see the topics alone.

    Args:
        bridge: Where it is published.
        action: Its name: "/larm_controller/follow_joint_trajectory".
    """

    def __init__(self, bridge: DdsBridge, action: str) -> None:
        self.name = f"a ROS 2 client of {action}"
        self.action, self._bridge = action, bridge
        self._send, self._result, self._cancel = (
            f"{action}/_action/{what}" for what in ("send_goal", "get_result", "cancel_goal")
        )
        self._feedback, self._status = f"{action}/_action/feedback", f"{action}/_action/status"
        bridge.serve(self._send, f"{FOLLOW}_SendGoal")
        bridge.serve(self._result, f"{FOLLOW}_GetResult")
        bridge.serve(self._cancel, "action_msgs/srv/CancelGoal")
        bridge.advertise(self._feedback, f"{FOLLOW}_FeedbackMessage")
        bridge.advertise(self._status, "action_msgs/msg/GoalStatusArray", latched=True)
        self._states: dict[str, Fields] = {}  # by goal, the oldest first: its status, when it came, and its result
        self._asked: list[Fields] = []  # requests of results that are not there yet
        self._refused = False

    @property
    def has_clients(self) -> bool:
        """Return True if anyone is there who could send goals."""
        return self._bridge.has_publishers(self._send)

    def requests(self, now: float) -> list[Message]:
        """Answer what has come of requests for results, and return goals and cancels as ``Commands`` has them.

        Args:
            now: The time [s] of the robot's clock.
        """
        for request in self._bridge.take(self._result):
            self._asked.append(request)
        self._answer_results()
        found: list[Message] = []
        for request in self._bridge.take(self._send):
            goal = bytes(request["goal_id"]["uuid"]).hex()
            found.append({
                "op": "send_action_goal", "action": self.action, "action_type": FOLLOW, "id": goal, "feedback": True,
                "args": request["goal"], "request": request, "now": now,
            })  # fmt: skip
        for request in self._bridge.take(self._cancel):
            found += self._cancels(request)
        return found

    def begin(self, message: Message) -> None:
        """Note a goal before ``Commands`` takes it or refuses it."""
        self._refused = False
        stamp = ros.time_fields(message["now"])
        self._states[message["id"]] = {"status": EXECUTING, "stamp": stamp, "result": None}
        while len(self._states) > REMEMBERED:
            del self._states[next(iter(self._states))]

    def accept(self, message: Message) -> None:
        """Answer a goal once ``Commands`` has taken it or refused it."""
        if self._refused:
            self._states.pop(message["id"], None)
        answer = {"accepted": not self._refused, "stamp": ros.time_fields(message["now"])}
        self._bridge.answer(self._send, message["request"], answer)
        self._tell_status()

    def abandon(self) -> None:
        """Note that goals under way were stopped, as all who could have sent them are gone."""
        for state in self._states.values():
            if state["result"] is None:
                state["status"], state["result"] = CANCELED, {}
        self._asked = []
        self._tell_status()

    # What Commands tells its clients

    def send(self, message: Message) -> None:
        """Tell those who sent a goal how far it is, or how it ended."""
        goal = str(message.get("id"))
        state = self._states.get(goal)
        if message["op"] == "action_feedback":
            identity = {"uuid": bytes.fromhex(goal)}
            self._bridge.publish(self._feedback, {"goal_id": identity, "feedback": message["values"]})
        elif message["op"] == "action_result":
            if not message["result"]:
                self._refused = True
                logger.warning("%s sent a goal that was refused: %s", self.name, message["values"].get("error_string"))
            elif state is not None:
                state["status"], state["result"] = message.get("status", SUCCEEDED), message["values"]
                self._tell_status()
                self._answer_results()

    def complain(self, text: str, identity: Any = None) -> None:
        """Log what was wrong: ROS 2 has no word for it."""
        logger.warning("%s: %s", self.name, text)

    def _answer_results(self) -> None:
        left = []
        for request in self._asked:
            state = self._states.get(bytes(request["goal_id"]["uuid"]).hex())
            if state is not None and state["result"] is None:
                left.append(request)
            else:
                known = {} if state is None else {"status": state["status"], "result": state["result"]}
                self._bridge.answer(self._result, request, known)
        self._asked = left

    def _cancels(self, request: Fields) -> list[Message]:
        wanted = bytes(request["goal_info"]["goal_id"]["uuid"])
        running = [goal for goal, state in self._states.items() if state["result"] is None]
        chosen = running if not any(wanted) else [goal for goal in running if goal == wanted.hex()]
        infos = [self._info(goal) for goal in chosen]
        code = 0 if chosen else NO_SUCH_GOAL
        self._bridge.answer(self._cancel, request, {"return_code": code, "goals_canceling": infos})
        return [{"op": "cancel_action_goal", "action": self.action, "id": goal} for goal in chosen]

    def _info(self, goal: str) -> Fields:
        return {"goal_id": {"uuid": bytes.fromhex(goal)}, "stamp": self._states[goal]["stamp"]}

    def _tell_status(self) -> None:
        statuses = [{"goal_info": self._info(goal), "status": own["status"]} for goal, own in self._states.items()]
        self._bridge.publish(self._status, {"status_list": statuses})
