"""A client's connection: answers, results, and what happens when the other side is gone or silent."""

import json
import socket
import threading
import time

import pytest
from websockets.sync.server import serve as serve_raw
from wire_with import PATIENCE

from nuno.errors import (
    ConnectionLostError,
    InvalidInputError,
    MissingPackageError,
    NotConnectedError,
    RefusedError,
    RobotTimeoutError,
)
from nuno.robot.wire import bridge
from nuno.robot.wire.connection import Connection


@pytest.fixture
def other_side():
    """A server that does with each connection what it is told."""
    servers = []

    def start(handle):
        servers.append(serve_raw(handle, "127.0.0.1", 0, compression=None))
        threading.Thread(target=servers[-1].serve_forever, daemon=True).start()
        return f"ws://127.0.0.1:{servers[-1].socket.getsockname()[1]}"

    yield start
    for server in servers:
        server.shutdown()


def silent(own):
    """Read, and say nothing."""
    for _ in own:
        pass


def test_nobody_listens():
    """A port that nobody listens on is named at once."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    with pytest.raises(NotConnectedError, match=rf"cannot connect to ws://127.0.0.1:{port}: .*refused|failed"):
        Connection(f"ws://127.0.0.1:{port}")


def test_one_who_listens_but_never_answers():
    """A program that takes the connection and says nothing is given up in time."""
    with socket.create_server(("127.0.0.1", 0)) as mute:
        with pytest.raises(NotConnectedError, match=r"no answer within 0.3 s"):
            Connection(f"ws://127.0.0.1:{mute.getsockname()[1]}", timeout=0.3)


def test_one_who_speaks_otherwise():
    """A program that answers in another protocol is no robot."""
    with socket.create_server(("127.0.0.1", 0)) as other:

        def talk():
            own, _ = other.accept()
            with own:
                own.recv(100)
                own.sendall(b"SSH-2.0-OpenSSH\r\n\r\n")

        threading.Thread(target=talk, daemon=True).start()
        with pytest.raises(NotConnectedError):
            Connection(f"ws://127.0.0.1:{other.getsockname()[1]}", timeout=2.0)


@pytest.mark.parametrize("url", ["127.0.0.1:9090", "http://127.0.0.1", "", None])
def test_bad_url(url):
    """What is no websocket's address is named."""
    with pytest.raises(InvalidInputError, match=r"url must be like 'ws://127.0.0.1:9090'"):
        Connection(url)


def test_missing_package(monkeypatch):
    """Without websockets the message has the pip command."""
    import builtins

    real = builtins.__import__

    def without(name, *arguments, **options):
        if name.startswith("websockets"):
            raise ImportError(name)
        return real(name, *arguments, **options)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(MissingPackageError, match=r"pip install .* '\.\[wire\]'"):
        bridge.import_websockets("a robot on the wire")


def test_service_that_does_not_answer(other_side):
    """A call that is not answered is named, and later calls are not confused by it."""
    with Connection(other_side(silent)) as connection:
        with pytest.raises(RobotTimeoutError, match=r"did not send an answer of /s within 0.1 s"):
            connection.call("/s", "t", {}, timeout=0.1)
        assert connection.lost is None


def test_answers_and_refusals(other_side):
    """Good answers are returned, refusals and complaints raised with their text, garbage is passed over."""

    def handle(own):
        for data in own:
            identity = data.split('"id":"')[1].split('"')[0]
            own.send("garbage")
            own.send('{"op": "service_response", "id": "someone else\'s", "service": "/s", "result": true}')
            if "/good" in data:
                own.send(
                    f'{{"op":"service_response","id":"{identity}","service":"/good","result":true,"values":{{"a":1}}}}'
                )
            elif "/bad" in data:
                own.send(f'{{"op":"service_response","id":"{identity}","service":"/bad","result":false,"values":"no"}}')
            else:
                own.send(f'{{"op":"status","level":"error","id":"{identity}","msg":"unknown service"}}')

    with Connection(other_side(handle)) as connection:
        assert connection.call("/good", "t", {}) == {"a": 1}
        with pytest.raises(RefusedError, match="/bad refused: no"):
            connection.call("/bad", "t", {})
        with pytest.raises(RefusedError, match="unknown service"):
            connection.call("/none", "t", {})


def test_lost_while_waiting(other_side):
    """Whoever waits for an answer or a result when the connection ends is told so, and so is everyone after that."""

    def handle(own):
        own.recv()
        own.recv()
        own.socket.shutdown(socket.SHUT_RDWR)  # as if the cable were cut: no closing handshake

    with Connection(other_side(handle)) as connection:
        goal = connection.send_goal("/a", "t", {})
        with pytest.raises(ConnectionLostError, match="went away without a word"):
            connection.call("/s", "t", {}, timeout=PATIENCE)
        with pytest.raises(ConnectionLostError):
            goal.result(PATIENCE)
        assert goal.done
        for act in (lambda: connection.call("/s", "t", {}), lambda: connection.send_goal("/a", "t", {}),
                    lambda: connection.publish("/t", "t", {}), connection.check):  # fmt: skip
            with pytest.raises(ConnectionLostError):
                act()


def test_closed_with_a_reason(other_side):
    """A server that says why it goes is quoted."""
    with Connection(other_side(lambda own: (own.recv(), own.close(1011, "the simulation failed")))) as connection:
        with pytest.raises(ConnectionLostError, match="code 1011, the simulation failed"):
            connection.call("/s", "t", {}, timeout=PATIENCE)


def test_one_who_falls_silent(other_side):
    """A server that answers nothing any more, not even pings, is lost after a while."""
    over = threading.Event()

    def freeze(own):
        own.recv()
        with own.protocol_mutex:  # its thread reads no more: no pong either
            over.wait()

    connection = Connection(other_side(freeze), alive=0.4)
    with pytest.raises(ConnectionLostError):
        connection.call("/s", "t", {}, timeout=PATIENCE)
    over.set()
    connection.close()


def test_too_long_a_message(other_side):
    """What is longer than is read ends the connection, by name, and fills no memory."""
    with Connection(other_side(lambda own: (own.recv(), own.send("x" * 10**6), silent(own))), max_message=10**5) as own:
        with pytest.raises(ConnectionLostError, match="1009"):
            own.call("/s", "t", {}, timeout=PATIENCE)


def test_sending_from_several_threads(other_side):
    """Messages that threads send at once arrive whole, those of one thread in its order, also at a slow reader."""
    got, done = [], threading.Event()

    def handle(own):
        for data in own:
            got.append(json.loads(data)["msg"])
            time.sleep(0.001 if len(got) < 100 else 0.0)
            if len(got) == 400:
                done.set()

    with Connection(other_side(handle)) as connection:

        def send(name):
            for k in range(100):
                connection.send({"op": "publish", "topic": "/t", "msg": {"of": name, "k": k, "data": "x" * 30000}})

        threads = [threading.Thread(target=send, args=(name,)) for name in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        assert done.wait(PATIENCE)
    for name in range(4):
        assert [own["k"] for own in got if own["of"] == name] == list(range(100))


def test_waiting_in_a_callback_is_refused(other_side):
    """A callback that waits for the connection would wait for itself: it is told so, and the connection goes on."""
    raised = []

    def handle(own):
        own.recv()
        own.send('{"op": "publish", "topic": "/t", "msg": {}}')
        for data in own:
            identity = data.split('"id":"')[1].split('"')[0]
            own.send(f'{{"op":"service_response","id":"{identity}","service":"/s","result":true,"values":{{}}}}')

    with Connection(other_side(handle)) as connection:

        def call(fields):
            try:
                connection.call("/s", "t", {})
            except InvalidInputError as error:
                raised.append(str(error))
                raise

        connection.subscribe("/t", "t", call)
        assert connection.call("/s", "t", {}) == {}
    assert "cannot be waited for in a callback" in raised[0]


def test_closing_twice(other_side):
    """A connection that was closed here is lost too, and closing it again does nothing."""
    connection = Connection(other_side(silent))
    connection.close()
    connection.close()
    with pytest.raises(ConnectionLostError, match="closed here"):
        connection.check()
