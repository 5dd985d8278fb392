"""ROS 2's messages as DDS has them: types with the names that ROS gives them, made from and into fields by name."""

from __future__ import annotations

import base64
import re
from collections.abc import Mapping
from functools import cache
from typing import Any

from nuno.errors import MissingPackageError
from nuno.robot.ros2.definitions import DEFINITIONS

Fields = dict[str, Any]

FIELD = re.compile(r"(?P<kind>[\w/]+)(?P<many>\[(?P<count>\d*)\])? (?P<name>\w+)")
ZEROS: dict[str, Any] = {"string": "", "bool": False, "float64": 0.0}
"""What a field is that a message leaves out, by type; numbers are 0."""


def import_cyclonedds() -> Any:
    """Return the module cyclonedds.

    Raises:
        MissingPackageError: it is not installed.
    """
    try:
        import cyclonedds
    except ImportError as error:
        raise MissingPackageError("cyclonedds", "ros2", "a robot in a ROS 2 graph") from error
    return cyclonedds


def dds_name(kind: str) -> str:
    """Return what DDS calls a type of ROS 2: "sensor_msgs/msg/Image" is "sensor_msgs::msg::dds_::Image_"."""
    package, folder, name = kind.split("/")
    return f"{package}::{folder}::dds_::{name}_"


@cache
def dds_type(kind: str) -> Any:
    """Return the DDS type of a ROS 2 message, a dataclass of cyclonedds."""
    import_cyclonedds()
    from cyclonedds.idl import make_idl_struct
    from cyclonedds.idl.annotations import final

    types, made = _idl_types(), {}
    for field in _fields(kind):
        own = _type_of(field["kind"])
        if field["count"]:
            own = types.array[own, int(field["count"])]
        elif field["many"]:
            own = types.sequence[own]
        made[field["name"]] = own
    found: Any = final(make_idl_struct(f"{kind.rpartition('/')[2]}_", dds_name(kind), made))
    last = _fields(kind)[-1]
    if last["kind"] == "uint8" and last["many"] and not last["count"]:
        found.serialize = _with_bytes(found.serialize, last["name"])
    return found


def to_dds(kind: str, fields: Mapping[str, Any]) -> Any:
    """Return a message of a type, from its fields by name; those that are left out are zero or empty."""
    values: Fields = {}
    for field in _fields(kind):
        name, own, given = field["name"], field["kind"], fields.get(field["name"])
        if own == "uint8" and field["many"]:  # as text where they are made for JSON
            values[name] = base64.b64decode(given) if isinstance(given, str) else _bytes(given, field["count"])
        elif not field["many"]:
            values[name] = _made(own, given)
        elif own in DEFINITIONS:
            values[name] = [to_dds(own, part) for part in given or ()]
        else:
            values[name] = list(given) if given else [ZEROS.get(own, 0)] * int(field["count"] or 0)
    return dds_type(kind)(**values)


def from_dds(kind: str, message: Any) -> Fields:
    """Return the fields of a message by name: the inverse of ``to_dds``, but that bytes stay bytes."""
    found = {}
    for field in _fields(kind):
        value = getattr(message, field["name"])
        if field["kind"] in DEFINITIONS:
            own = field["kind"]
            found[field["name"]] = [from_dds(own, part) for part in value] if field["many"] else from_dds(own, value)
        else:
            found[field["name"]] = _sequence(field["kind"], value) if field["many"] else value
    return found


def _with_bytes(serialize: Any, name: str) -> Any:
    """Return a ``serialize`` that appends the bytes of the last field at once: cyclonedds packs them one by one."""

    def serialize_at_once(self: Any, *arguments: Any, **options: Any) -> bytes:
        data = bytes(getattr(self, name))
        setattr(self, name, b"")
        try:
            head = serialize(self, *arguments, **options)  # ends with the number of bytes, which is 0
        finally:
            setattr(self, name, data)
        order: Any = "little" if head[1] & 1 else "big"
        return bytes(head[:-4] + len(data).to_bytes(4, order) + data)

    return serialize_at_once


@cache
def _fields(kind: str) -> tuple[Mapping[str, str], ...]:
    found = []
    for text in DEFINITIONS[kind].split(", "):
        match = FIELD.fullmatch(text)
        assert match is not None, text
        found.append(match.groupdict(default=""))
    return tuple(found)


def _bytes(given: Any, count: str) -> bytes:
    return bytes(int(count or 0)) if given is None else bytes(given)


def _sequence(kind: str, value: Any) -> Any:
    return bytes(value) if kind == "uint8" else list(value)


def _type_of(kind: str) -> Any:
    if kind in DEFINITIONS:
        return dds_type(kind)
    return {"string": str, "bool": bool}.get(kind) or getattr(_idl_types(), kind)


def _idl_types() -> Any:
    from cyclonedds.idl import types

    return types


def _made(kind: str, given: Any) -> Any:
    if kind in DEFINITIONS:
        return to_dds(kind, given or {})
    return ZEROS.get(kind, 0) if given is None else given
