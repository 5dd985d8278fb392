"""Messages of ROS 1 from and into the fields by name that Nuno's wire has, which are those of ROS 2.

Run by the Python that has rospy; it imports nothing of Nuno.
"""

import base64
from typing import Any

from .control_definitions import message_class

PRIMITIVE = {
    "bool", "int8", "uint8", "int16", "uint16", "int32", "uint32", "int64", "uint64", "float32", "float64", "string",
    "char", "byte",
}  # fmt: skip


def to_ros1(fields: dict[str, Any], kind: str) -> Any:
    """Return a message of a type ("sensor_msgs/JointState"); what ROS 1 has no field for is left out."""
    message = message_class(kind)()
    for name, own in zip(message.__slots__, message._slot_types, strict=True):
        given = fields.get(name, fields.get(name.lower()))  # CameraInfo's D, K, R, P are d, k, r, p in ROS 2
        if given is not None:
            setattr(message, name, _to(given, own))
    return message


def from_ros1(message: Any) -> dict[str, Any]:
    """Return the fields of a message."""
    return {
        name: _from(getattr(message, name), own)
        for name, own in zip(message.__slots__, message._slot_types, strict=True)
    }


def _to(given: Any, kind: str) -> Any:
    base, _, many = kind.partition("[")
    if base == "uint8" and many:
        return base64.b64decode(given) if isinstance(given, str) else bytes(given)
    if many:
        return given if base in PRIMITIVE else [_to(own, base) for own in given]
    if base in ("time", "duration"):
        import genpy

        made = genpy.Time if base == "time" else genpy.Duration
        return made(given.get("sec", 0), given.get("nanosec", 0))
    return given if base in PRIMITIVE else to_ros1(given, _full(base))


def _from(value: Any, kind: str) -> Any:
    base, _, many = kind.partition("[")
    if base == "uint8" and many:
        return base64.b64encode(bytes(value)).decode()
    if many:
        return [own if base in PRIMITIVE else _from(own, base) for own in value]
    if base in ("time", "duration"):
        return {"sec": value.secs, "nanosec": value.nsecs}
    return value if base in PRIMITIVE else from_ros1(value)


def _full(kind: str) -> str:
    return "std_msgs/Header" if kind == "Header" else kind
