"""The rosbridge v2 protocol: messages as JSON objects with an "op", and what each must have."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

from nuno.errors import MessageError

Message = dict[str, Any]

FROM_CLIENTS: dict[str, dict[str, type | tuple[type, ...]]] = {
    "advertise": {"topic": str, "type": str},
    "unadvertise": {"topic": str},
    "publish": {"topic": str, "msg": dict},
    "subscribe": {"topic": str},
    "unsubscribe": {"topic": str},
    "call_service": {"service": str},
    "send_action_goal": {"action": str, "action_type": str},
    "cancel_action_goal": {"action": str},
    "set_level": {"level": str},
}
"""Messages that a server understands, by op: the fields that each must have, and their types."""

FROM_SERVERS: dict[str, dict[str, type | tuple[type, ...]]] = {
    "publish": {"topic": str, "msg": dict},
    "service_response": {"service": str, "result": bool},
    "action_feedback": {"action": str, "values": dict},
    "action_result": {"action": str, "result": bool},
    "status": {"level": str},
}
"""Messages that a client understands, likewise."""

# The other fields that the programs here read, of whatever op
OPTIONAL: dict[str, type | tuple[type, ...]] = {
    "id": (str, int), "type": str, "throttle_rate": (int, float), "queue_length": int, "feedback": bool, "status": int,
}  # fmt: skip

UNKNOWN, EXECUTING, SUCCEEDED, CANCELED, ABORTED = 0, 2, 4, 5, 6
"""The status of an action's goal: action_msgs/msg/GoalStatus."""


def encode(message: Message) -> str:
    """Return a message as JSON; numbers that are not finite become null, which JSON has no other word for."""
    try:
        return json.dumps(message, allow_nan=False, separators=(",", ":"))
    except ValueError:
        return json.dumps(_without_nan(message), allow_nan=False, separators=(",", ":"))


def decode(data: str | bytes, understood: dict[str, dict[str, type | tuple[type, ...]]]) -> Message:
    """Return the message that was received.

    Args:
        data: JSON.
        understood: ``FROM_CLIENTS`` or ``FROM_SERVERS``.

    Raises:
        MessageError: no JSON object with an op that is understood, or a field that is missing or of another type.
    """
    message = _parse(data)
    if not isinstance(message, dict):
        raise MessageError(f"a message must be a JSON object, got {_short(message)}")
    op = message.get("op")
    if not isinstance(op, str) or op not in understood:
        raise MessageError(f"op must be one of {', '.join(understood)}, got {_short(op)}", _identity(message))
    for field, kind in understood[op].items():
        if field not in message:
            raise MessageError(f"{op} needs the field {field!r}", _identity(message))
        _check_kind(message, op, field, kind)
    for field, kind in OPTIONAL.items():
        if message.get(field) is not None:
            _check_kind(message, op, field, kind)
    return message


def _parse(data: str | bytes) -> Any:
    try:
        return json.loads(data)  # with NaN too, which some servers send: who reads a number looks whether it is finite
    except (ValueError, RecursionError) as error:  # a UnicodeDecodeError is a ValueError too
        reason = "it is nested too deeply" if isinstance(error, RecursionError) else str(error)
        raise MessageError(f"a message must be JSON, got {_short(data)}: {reason}") from error


def _check_kind(message: Message, op: str, field: str, kind: type | tuple[type, ...]) -> None:
    value = message[field]
    kinds = kind if isinstance(kind, tuple) else (kind,)
    if not isinstance(value, kinds) or (isinstance(value, bool) and bool not in kinds):
        names = " or ".join(k.__name__ for k in kinds)
        raise MessageError(f"{field!r} of {op} must be {names}, got {_short(value)}", _identity(message))


def _identity(message: Message) -> str | int | None:
    """Return a message's id where it has a usable one: it may be the very thing that is wrong."""
    found = message.get("id")
    return found if isinstance(found, (str, int)) and not isinstance(found, bool) else None


def _short(value: Any) -> str:
    if isinstance(value, (str, bytes)):
        value = value[:61]  # a message of megabytes is not to be quoted twice
    try:
        text = repr(value)
    except RecursionError:
        text = f"a {type(value).__name__} nested too deeply"
    return text if len(text) <= 60 else f"{text[:57]}..."


def _without_nan(value: Any) -> Any:
    keep: Callable[[Any], Any] = _without_nan
    if isinstance(value, dict):
        return {key: keep(own) for key, own in value.items()}
    if isinstance(value, (list, tuple)):
        return [keep(own) for own in value]
    return None if isinstance(value, float) and (value != value or value in (float("inf"), float("-inf"))) else value
