"""RosApi: the services by which programs ask what there is, as rosbridge's rosapi has them."""

from __future__ import annotations

import json
from collections.abc import Callable, Collection, Mapping
from typing import Any

from nuno.robot.interface import RobotInterface
from nuno.robot.wire import messages as ros

Fields = dict[str, Any]

NODE = "/nuno"
"""The one node that a server shows: itself."""


class RosApi:
    """The services of rosapi, over what a server has.

    Args:
        robot: The robot, whose URDF is the one parameter.
        published: Types of the topics that it publishes, by name.
        taken: Types of the topics that it subscribes to.
        services: The names of all services, these among them.
        actions: The names of all actions.
    """

    def __init__(
        self, robot: RobotInterface, published: Mapping[str, str], taken: Mapping[str, str],
        services: Callable[[], Collection[str]], actions: Callable[[], Collection[str]],
    ) -> None:  # fmt: skip
        self._robot, self._published, self._taken = robot, published, taken
        self._services, self._actions = services, actions
        self.services: dict[str, Callable[[Fields], Fields]] = {
            "/rosapi/get_time": self._get_time, "/rosapi/topics": self._list_topics,
            "/rosapi/topics_and_raw_types": self._topics_and_raw_types,
            "/rosapi/topics_for_type": self._topics_for_type, "/rosapi/topic_type": self._topic_type,
            "/rosapi/services": self._list_services, "/rosapi/nodes": self._nodes,
            "/rosapi/node_details": self._node_details, "/rosapi/action_servers": self._action_servers,
            "/rosapi/get_param": self._get_param, "/rosapi/has_param": self._has_param,
            "/rosapi/get_param_names": self._get_param_names, "/rosapi/publishers": self._publishers,
            "/rosapi/subscribers": self._subscribers,
        }  # fmt: skip
        self._topics = {**published, **taken}

    def _get_time(self, _: Fields) -> Fields:
        return {"time": ros.time_fields(self._robot.now())}

    def _list_topics(self, _: Fields) -> Fields:
        return {"topics": list(self._topics), "types": list(self._topics.values())}

    def _topics_and_raw_types(self, fields: Fields) -> Fields:
        # definitions of the messages' fields are not kept: clients read them where their own ROS is
        return self._list_topics(fields) | {"typedefs_full_text": [""] * len(self._topics)}

    def _list_services(self, _: Fields) -> Fields:
        return {"services": list(self._services())}

    def _topics_for_type(self, fields: Fields) -> Fields:
        kind = ros.field(fields, "type", str)
        return {"topics": [name for name, own in self._topics.items() if _same(own, kind)]}

    def _topic_type(self, fields: Fields) -> Fields:
        return {"type": self._topics.get(_full(ros.field(fields, "topic", str)), "")}

    def _nodes(self, _: Fields) -> Fields:
        return {"nodes": [NODE]}

    def _node_details(self, fields: Fields) -> Fields:
        mine = _full(ros.field(fields, "node", str)) == NODE
        return {
            "subscribing": list(self._taken) if mine else [], "publishing": list(self._published) if mine else [],
            "services": list(self._services()) if mine else [],
        }  # fmt: skip

    def _publishers(self, fields: Fields) -> Fields:
        return {"publishers": [NODE] if _full(ros.field(fields, "topic", str)) in self._published else []}

    def _subscribers(self, fields: Fields) -> Fields:
        return {"subscribers": [NODE] if _full(ros.field(fields, "topic", str)) in self._taken else []}

    def _action_servers(self, _: Fields) -> Fields:
        return {"action_servers": list(self._actions())}

    def _get_param(self, fields: Fields) -> Fields:
        if not self._has(fields):
            return {"value": ros.field(fields, "default", str, default="null") or "null"}
        return {"value": json.dumps(self._robot.robot.description.urdf.read_text(encoding="utf-8"))}

    def _has_param(self, fields: Fields) -> Fields:
        return {"exists": self._has(fields)}

    def _get_param_names(self, _: Fields) -> Fields:
        return {"names": ["/robot_description"]}

    def _has(self, fields: Fields) -> bool:
        """Return True if a parameter is the URDF; in ROS 2 a node's name comes before it, and a colon."""
        return ros.field(fields, "name", str).rpartition(":")[2].rpartition("/")[2] == "robot_description"


def _full(name: str) -> str:
    return name if name.startswith("/") else f"/{name}"


def _same(own: str, asked: str) -> bool:
    """Return True if two types are one: ROS 1 names have no "msg" in them."""
    return own.replace("/msg/", "/") == asked.replace("/msg/", "/")
