"""Clients that mean harm, or die: the server's memory and files do not grow, and others are served."""

import json
import os
import resource
import signal
import socket
import subprocess
import sys
import time
from contextlib import suppress

import pytest
from websockets.exceptions import ConnectionClosed
from wire_with import PATIENCE, advance, until

from nuno.robot.wire import bridge
from nuno.robot.wire.outbox import MAX_KEPT
from nuno.robot.wire.server import WAITS


def ask(client):
    """Ask a server for the time, and return it [s]."""
    client.say({"op": "call_service", "id": "t", "service": "/rosapi/get_time"})
    told = client.hear(op="service_response", id="t")["values"]["time"]
    return told["sec"] + 1e-9 * told["nanosec"]


def deaf(raw, server):
    """A client that never reads, and takes little into its own buffers."""
    own = socket.socket()
    own.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    own.connect(("127.0.0.1", server.port))
    return raw(server, sock=own, max_queue=1, max_size=None)


@pytest.mark.parametrize("speaks", [b"", b"GET / HTTP/1.1\r\nHost: x\r\n"])
def test_one_who_connects_and_says_nothing(serve, raw, monkeypatch, speaks):
    """Who does not ask for a websocket, or not to the end, is let go after a while."""
    monkeypatch.setattr(bridge, "OPENING", 0.3)
    server = serve(real_time_factor=1.0)
    with socket.create_connection(("127.0.0.1", server.port)) as mute:
        mute.sendall(speaks)
        assert ask(raw(server)) >= 0.0
        mute.settimeout(PATIENCE)
        assert b"websocket" not in mute.recv(100)  # nothing, or a refusal
    until(lambda: len(server._bridge.clients) == 1)  # the one that asked


@pytest.mark.parametrize(
    "sent", [os.urandom(4096), b"GET /" + b"x" * 10**5, b"GET / HTTP/1.1\r\n" + b"a: b\r\n" * 10**4 + b"\r\n",
             b"GET / HTTP/1.1\r\n\r\n", b"\x16\x03\x01\x02\x00\x01"],
    ids=["noise", "long line", "many headers", "a browser", "TLS"],
)  # fmt: skip
def test_other_protocols(serve, raw, sent):
    """What is no websocket is let go, and the server listens on."""
    server = serve()
    with socket.create_connection(("127.0.0.1", server.port)) as other:
        other.settimeout(PATIENCE)
        try:
            other.sendall(sent)
            other.shutdown(socket.SHUT_WR)
            while other.recv(4096):
                pass
        except ConnectionError:  # the server has gone before it was told all
            pass
    until(lambda: not server._bridge.clients)
    assert ask(raw(server)) == 0.0


@pytest.mark.parametrize(
    "sent", [b"\x81\x05hello", b"\x81\xff" + (2**62).to_bytes(8, "big") + b"abcd", b"\xff" * 100, b"\x80\x80abcd"],
    ids=["not masked", "four exabytes", "reserved bits", "a continuation of nothing"],
)  # fmt: skip
def test_frames_that_break_the_protocol(serve, raw, sent):
    """Who breaks the websocket protocol is disconnected; others notice nothing."""
    server = serve()
    other = raw(server)
    raw(server).socket.socket.sendall(sent)
    until(lambda: len(server._bridge.clients) == 1)
    assert ask(other) == 0.0


def test_a_message_in_many_pieces(serve, raw):
    """What comes in fragments is one message, and too long a one where all of them are too long together."""
    server = serve(max_message=10**4)
    client = raw(server)
    text = json.dumps({"op": "call_service", "id": "p", "service": "/rosapi/get_time"})
    client.socket.send(iter(text))  # a frame for each letter
    assert client.hear(id="p")["result"]
    with suppress(ConnectionClosed):  # the server may be gone before the last piece
        client.socket.send("x" * 3000 for _ in range(4))
    until(lambda: not server._bridge.clients)


@pytest.mark.long
def test_a_thousand_connections_in_a_row(serve, raw):
    """Connections that come and go at once, with and without a word, leave no files open."""
    server = serve(real_time_factor=1.0)
    other = raw(server)
    before = len(os.listdir("/proc/self/fd")) if os.path.isdir("/proc/self/fd") else None
    for k in range(1000):
        with socket.create_connection(("127.0.0.1", server.port)) as own:
            own.sendall(b"GET / HTTP/1.1\r\n" if k % 2 else b"")
    assert ask(other) > 0.0
    until(lambda: len(server._bridge.clients) == 1)
    # what is left of other tests comes and goes by a few
    until(lambda: before is None or len(os.listdir("/proc/self/fd")) < before + 20)


@pytest.mark.skipif(not os.path.isdir("/proc/self/fd"), reason="counts the files of this process as Linux does")
def test_too_many_open_files(serve, raw):
    """Where no more files can be open those that are connected are served, and later ones when there is room again."""
    server = serve(real_time_factor=1.0)
    other = raw(server)
    own = [socket.socket() for _ in range(30)]
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    used = {int(name) for name in os.listdir("/proc/self/fd")}
    free = [number for number in range(len(used) + 5) if number not in used]
    resource.setrlimit(resource.RLIMIT_NOFILE, (free[4], hard))  # files get the lowest numbers that are free
    try:
        for each in own:
            each.connect(("127.0.0.1", server.port))
        first = ask(other)
        until(lambda: ask(other) > first)
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))
        for each in own:
            each.close()
    assert ask(raw(server)) > 0.0


def test_a_long_queue_for_one_that_never_reads(serve, raw):
    """However long a queue a client asks for, the server keeps little for it."""
    server = serve()
    deaf(raw, server).say({"op": "subscribe", "topic": "/big", "queue_length": 10**9})
    until(lambda: server._bridge.has_subscribers("/big"))
    (client,) = server._bridge.clients
    for k in range(500):  # 50 MB: more than system buffers hold
        server._bridge.publish("/big", {"data": f"{k}" + "x" * 10**5})
        assert len(client.outbox) <= MAX_KEPT
    until(lambda: len(client.outbox) == MAX_KEPT)
    assert ask(raw(server)) == 0.0


def test_one_who_reads_late(serve, raw):
    """What was too much for a socket at once arrives whole when it is read, and what was sent meanwhile after it."""
    server = serve()
    late = deaf(raw, server)
    server._bridge.publish("/long", {"data": "x" * 10**7}, latched=True)  # more than system buffers hold
    late.say({"op": "subscribe", "topic": "/long"})
    late.say({"op": "call_service", "id": "after", "service": "/rosapi/get_time"})
    until(lambda: any(own.outbox for own in server._bridge.clients))
    assert ask(raw(server)) == 0.0
    text = late.socket.recv(timeout=PATIENCE, decode=False)
    assert json.loads(text)["msg"] == {"data": "x" * 10**7}
    assert late.hear(id="after")["result"]


@pytest.mark.long
def test_pings_without_end_from_one_that_never_reads(serve, raw):
    """Pongs are kept for nobody: who asks for 1 GB of them and reads none is disconnected before."""
    server = serve()
    slow = deaf(raw, server)
    sent = 0
    with pytest.raises(OSError):  # a reset connection, or a pipe that is broken
        while sent < 10**9:
            slow.socket.socket.sendall((b"\x89\xfd\0\0\0\0" + b"x" * 125) * 100)
            sent += 12500
    # how much of the 1 GB came through until the server looked depends on the speed of the machine
    until(lambda: not server._bridge.clients)


def test_answers_for_one_that_never_reads(serve, raw):
    """Answers may not be dropped: who asks without end and reads none is disconnected."""
    server = serve()
    slow = deaf(raw, server)
    with pytest.raises(Exception):  # noqa: B017 - a closed connection has several names
        for _ in range(10**6):
            slow.say({"op": "subscribe", "topic": "/robot_description"})
    until(lambda: not server._bridge.clients)


def test_subscriptions_without_end(serve, raw, monkeypatch):
    """What is remembered of one client has an end; what it had goes on, and ends with it."""
    monkeypatch.setattr(bridge, "SUBSCRIPTIONS", 20)
    server = serve()
    client = raw(server)
    for k in range(25):
        client.say({"op": "subscribe", "topic": f"/topic{k}", "id": f"{k}"})
    for k in range(20, 25):
        assert "no more than 20 subscriptions" in client.hear(op="status", id=f"{k}")["msg"]
    assert server._bridge.has_subscribers("/topic19")
    assert not server._bridge.has_subscribers("/topic20")
    client.say({"op": "unsubscribe", "topic": "/topic19", "id": "19"})
    client.say({"op": "subscribe", "topic": "/clock"})
    assert client.hear(topic="/clock")
    client.socket.close()
    until(lambda: not server._bridge.clients)
    assert not server._bridge.has_subscribers("/topic0")


def test_waits_without_end(serve, raw):
    """A client waits for so many times at once; the waits of others are not delayed by them."""
    server = serve()
    client = raw(server)
    for k in range(WAITS + 1):
        client.say({
            "op": "call_service", "id": f"{k}", "service": "/simulation/advance", "args": {"duration": {"sec": 3600}},
        })  # fmt: skip
    refused = client.hear(op="service_response")
    assert (refused["id"], refused["result"]) == (f"{WAITS}", False)
    assert f"{WAITS} times at once" in refused["values"]


def test_a_flood_ends_where_nobody_reads_the_answers(serve, raw):
    """A server that is busy reads no further than the socket's own queue, and answers all when it has time."""
    server = serve()
    client = raw(server)
    with server.lock:  # as by a program that uses the robot: nothing is dealt with
        for _ in range(300):
            client.say({"op": "call_service", "service": "/rosapi/get_time"})
        time.sleep(0.3)
        (own,) = server._bridge.clients
        assert not own.outbox
    for _ in range(300):
        assert client.hear(op="service_response")["result"]


def test_a_server_that_is_busy_keeps_its_clients(serve, raw):
    """While the robot's thread does one long thing, clients connect, and pings are answered."""
    server = serve()
    with server.lock:
        raw(server).say({"op": "call_service", "service": "/rosapi/get_time"})  # which the robot's thread hangs in
        time.sleep(0.1)
        client = raw(server, open_timeout=PATIENCE)
        assert client.socket.ping().wait(PATIENCE)
    assert ask(client) == 0.0


def test_a_client_that_is_killed(serve, raw, plain):
    """A client whose process is killed is gone at once: the base that it drove stops, others go on."""
    server = serve(real_time_factor=1.0)
    program = (
        "import json, sys, time\n"
        "from websockets.sync.client import connect\n"
        "own = connect(sys.argv[1], compression=None)\n"
        "own.send(json.dumps({'op': 'subscribe', 'topic': '/joint_states'}))\n"
        "own.send(json.dumps({'op': 'send_action_goal', 'action': '/navigate_to_pose', 'action_type': 'x',\n"
        "                     'args': {'pose': {'pose': {'position': {'x': 100.0}}}}}))\n"
        "print(own.recv(), flush=True)\n"
        "time.sleep(60)\n"
    )
    other = raw(server)
    with subprocess.Popen([sys.executable, "-c", program, server.url], stdout=subprocess.PIPE, text=True) as process:
        try:
            assert "/joint_states" in process.stdout.readline()
            until(lambda: plain.going is not None)
            assert not plain.going[0].is_done
            process.send_signal(signal.SIGKILL)
        finally:
            process.kill()
    until(lambda: plain.going[0].is_done)
    until(lambda: len(server._bridge.clients) == 1)
    first = ask(other)
    until(lambda: ask(other) > first)


def test_two_hundred_subscribers(serve, raw, monkeypatch):
    """A message is made into text once for all that listen, and the robot's clock goes on as it does for one."""
    made = []
    encode = bridge.encode
    monkeypatch.setattr(bridge, "encode", lambda message: made.append(message["op"]) or encode(message))
    server = serve()
    clients = [raw(server) for _ in range(200)]
    for client in clients:
        client.say({"op": "subscribe", "topic": "/joint_states", "queue_length": 1})
        client.hear(topic="/joint_states")
    made.clear()
    assert advance(clients[0], 0.5)["values"]["time"] == {"sec": 0, "nanosec": 500000000}
    assert len(made) <= 0.5 / server.tick + 2  # one a tick, not one a client
    for client in clients[1:]:
        while client.hear(topic="/joint_states")["msg"]["header"]["stamp"] != {"sec": 0, "nanosec": 500000000}:
            pass
