"""Clients of a server that send what they should not: they are answered, and harm nobody."""

import math
import socket
import threading
import time
from contextlib import suppress

import pytest
from wire_with import PATIENCE, advance, goal, until


def test_garbage_is_answered_and_harms_nothing(serve, raw, plain):
    """Each message that is wrong is answered by a complaint; the client stays connected, and time goes on."""
    client = raw(serve())
    for message, said in (
        ("hello", "must be JSON"), (b"\x00\xff", "must be JSON"), ("[" * 5000, "must be JSON"), ([], "JSON object"),
        ({"op": "explode"}, "op must be one of"), ({"op": "subscribe"}, "needs the field"),
        ({"op": "subscribe", "topic": "/clock", "compression": "png"}, "compression must be none"),
        ({"op": "unsubscribe", "topic": "/never"}, "not subscribed"),
        ({"op": "publish", "topic": "/nobody", "msg": {}}, "nobody listens"),
        ({"op": "publish", "topic": "/cmd_vel", "msg": {"linear": {"x": "fast"}}}, "must be a number"),
        ({"op": "advertise", "topic": "/cmd_vel", "type": "std_msgs/msg/String"}, "takes geometry_msgs"),
    ):  # fmt: skip
        client.say(message)
        answer = client.hear(op="status")
        assert answer["level"] == "error"
        assert said in answer["msg"]
    assert advance(client)["result"]


def test_bad_calls_are_refused(serve, raw):
    """A service that is not there, or that is asked for nonsense, answers that it failed."""
    client = raw(serve())
    for service, args, said in (
        ("/nothing", {}, "no service '/nothing'; there are:"),
        ("/simulation/advance", {}, "'duration' is missing"),
        ("/simulation/advance", {"duration": {"sec": -1}}, "must lie in"),
        ("/simulation/advance", {"duration": {"sec": 1e30}}, "must lie in"),
        ("/simulation/advance", {"duration": {"sec": float("nan")}}, "finite"),
        ("/simulation/advance", "soon", "must lie in messages"),
    ):
        client.say({"op": "call_service", "id": "c", "service": service, "args": args})
        answer = client.hear(op="service_response", id="c")
        assert answer["result"] is False
        assert said in answer["values"]
    assert advance(client)["result"]


def test_bad_goals_are_refused(serve, raw, plain):
    """A goal that cannot be followed is refused with a result code, and what is under way goes on."""
    client = raw(serve())
    client.say(goal(plain))
    client.hear(op="action_feedback")
    names = plain.controller_param_table["larm_controller"][0]["joint_names"]
    nan = {"joint_names": names, "points": [{"positions": [float("nan")] * len(names)}]}
    for change, code in (
        ({"action": "/nowhere"}, -1), ({"args": {}}, -1), ({"args": {"trajectory": nan}}, -1), ({"args": []}, -1),
        ({"args": {"trajectory": {"joint_names": ["x"], "points": [{"positions": [1.0]}]}}}, -2),
        ({"id": "g"}, -1),  # which is under way
    ):  # fmt: skip
        client.say(goal(plain, id="bad") | change)
        answer = client.hear(op="action_result")
        assert answer["result"] is False
        assert answer["values"]["error_code"] == code
        assert answer["values"]["error_string"]
    assert not plain.goals["larm_controller"][0].is_done
    assert advance(client)["result"]


def test_too_long_a_message(serve, raw, plain):
    """Who sends more than is read is disconnected, and what it asked for stops; others notice nothing."""
    server = serve(max_message=10**4)
    client, other = raw(server), raw(server)
    client.say(goal(plain))
    client.hear(op="action_feedback")
    client.say({"op": "publish", "topic": "/t", "msg": {"data": "x" * 10**5}})
    until(lambda: plain.goals["larm_controller"][0].is_done)
    assert advance(other)["result"]


def test_a_flood_of_messages(serve, raw, plain):
    """A client that sends without end slows itself down, not the time of others."""
    server = serve(real_time_factor=1.0)
    flooding, other = raw(server), raw(server)
    stop = threading.Event()

    def flood():
        try:
            while not stop.is_set():
                flooding.say({"op": "call_service", "service": "/rosapi/topics"})
        except Exception:  # given up, as it reads none of the answers: that is what may happen
            pass

    thread = threading.Thread(target=flood, daemon=True)
    thread.start()
    begin = plain.now()
    for _ in range(5):
        other.say({"op": "call_service", "id": "t", "service": "/rosapi/get_time"})
        assert other.hear(op="service_response", id="t")["result"]
    until(lambda: plain.now() > begin)
    stop.set()
    with suppress(OSError):  # closed already
        flooding.socket.socket.shutdown(socket.SHUT_RDWR)
    thread.join(PATIENCE)
    assert not thread.is_alive()


def test_a_client_that_does_not_read(serve, raw, plain):
    """Publications for one that does not read are dropped: the simulation and others wait for nothing."""
    server = serve(real_time_factor=math.inf)
    # a small window, so that what is sent soon stays with the server
    slow = socket.create_connection(("127.0.0.1", server.port))
    slow.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    deaf = raw(server, sock=slow, max_queue=1)
    for topic in ("/joint_states", "/clock", "/odom"):
        deaf.say({"op": "subscribe", "topic": topic})
    other = raw(server)
    for _ in range(20):
        other.say({"op": "call_service", "id": "t", "service": "/rosapi/get_time"})
        assert other.hear(op="service_response", id="t")["result"]
        time.sleep(0.02)
    client = next(own for own in server._bridge.clients if own.subscriptions)
    assert len(client.outbox) <= 3 * 16 + 1


def test_clients_that_come_and_go(serve, raw, plain):
    """Connections that open and close, with and without goals, leave nothing behind."""
    server = serve()
    for k in range(10):
        client = raw(server)
        client.say({"op": "subscribe", "topic": "/joint_states"})
        client.say(goal(plain))
        client.hear(op="action_feedback")
        if k % 2:
            client.socket.close()
        else:
            client.socket.socket.close()
    until(lambda: not server._bridge.clients)
    until(lambda: plain.goals["larm_controller"][0].is_done)
    assert not server._bridge.has_subscribers("/joint_states")
    assert advance(raw(server))["result"]


def test_web_pages_may_not_connect(serve, raw):
    """A page in a browser, which says where it is from, is turned away unless it was allowed."""
    from websockets.exceptions import InvalidStatus

    with pytest.raises(InvalidStatus, match="403"):
        raw(serve(), origin="http://elsewhere.example")
    assert advance(raw(serve(origins=("http://here.example",)), origin="http://here.example"))["result"]
