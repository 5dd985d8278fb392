"""The rosbridge protocol: what is understood, and what is said of what is not."""

import json

import pytest

from nuno.errors import MessageError
from nuno.robot.wire.protocol import FROM_CLIENTS, FROM_SERVERS, decode, encode


def test_message_both_ways():
    """What is encoded is decoded as it was."""
    message = {"op": "publish", "topic": "/t", "msg": {"a": [1.5, None, "x"]}}
    assert decode(encode(message), FROM_CLIENTS) == message
    assert decode(encode(message).encode(), FROM_SERVERS) == message


def test_no_nan_is_sent():
    """JSON has no NaN: rosbridge sends null in its place, and so is done here."""
    assert json.loads(encode({"v": [float("nan"), float("inf"), 1.0], "w": {"x": -float("inf")}})) == {
        "v": [None, None, 1.0], "w": {"x": None},
    }  # fmt: skip


@pytest.mark.parametrize(
    ("data", "said"),
    [
        ("hello", "must be JSON"), (b"\xff\xfe", "must be JSON"), ("", "must be JSON"), ("[" * 100000, "must be JSON"),
        ("1" * 10000, "must be JSON"), ("[]", "JSON object"), ("null", "JSON object"), ("{}", "op must be one of"),
        ('{"op": 3}', "op must be one of"), ('{"op": "dance"}', "op must be one of"),
        ('{"op": "subscribe"}', "needs the field 'topic'"), ('{"op": "subscribe", "topic": 7}', "must be str"),
        ('{"op": "publish", "topic": "/t", "msg": []}', "must be dict"),
        ('{"op": "subscribe", "topic": "/t", "throttle_rate": "fast"}', "must be int or float"),
        ('{"op": "subscribe", "topic": "/t", "queue_length": true}', "must be int"),
        ('{"op": "call_service", "service": "/s", "id": {}}', "must be str or int"),
    ],
)  # fmt: skip
def test_garbage_is_named(data, said):
    """What is no message of the protocol is refused, and the refusal says what is valid."""
    with pytest.raises(MessageError, match=said):
        decode(data, FROM_CLIENTS)


def test_refusal_is_short():
    """A refused message of a megabyte is not quoted in full."""
    with pytest.raises(MessageError) as caught:
        decode("x" * 10**6, FROM_CLIENTS)
    assert len(str(caught.value)) < 300


def test_refusal_keeps_the_id():
    """The sender of a message that lacks something learns which one it was."""
    with pytest.raises(MessageError) as caught:
        decode('{"op": "publish", "id": "p1", "topic": "/t"}', FROM_CLIENTS)
    assert caught.value.identity == "p1"
