"""Many who listen: messages are made once, newcomers cost the others nothing, and the clock goes on."""

import time

import numpy as np
import pytest
from wire_with import advance, until

from nuno.robot.wire import bridge


@pytest.fixture
def made(monkeypatch):
    """Count the frames that publications are made into."""
    found, real = [], bridge.frame_of
    monkeypatch.setattr(bridge, "frame_of", lambda text: found.append(text) or real(text))
    return found


def subscribe(client, topic="/joint_states"):
    """Subscribe, and return the message that a newcomer gets."""
    client.say({"op": "subscribe", "topic": topic})
    return client.hear(op="publish", topic=topic)["msg"]


def test_a_message_is_made_once_for_all(serve, raw, made):
    """Twenty listen to two topics: each publication of each is one frame, and all get the same."""
    server = serve()
    clients = [raw(server) for _ in range(20)]
    for client in clients:
        subscribe(client)
        subscribe(client, "/odom")
    made.clear()
    advance(clients[0], 0.1)
    states = [text for text in made if '"topic":"/joint_states"' in text]
    assert len(states) == pytest.approx(0.1 / server.tick, abs=1)
    assert sum('"topic":"/odom"' in text for text in made) == len(states)
    heard = [[client.hear(op="publish", topic="/joint_states")["msg"] for _ in states] for client in clients[1:]]
    assert all(own == heard[0] for own in heard)


def test_newcomers_get_what_there_is_and_nobody_else_does(serve, raw, made):
    """A second one gets the frame of the first; what has changed since is made anew."""
    server = serve()
    first, second, third = raw(server), raw(server), raw(server)
    state = subscribe(first)
    made.clear()
    assert subscribe(second) == state
    assert not made
    advance(second, 0.05, heard := [])
    told = [own["msg"] for own in heard if own.get("topic") == "/joint_states"]
    made.clear()
    assert subscribe(third) == told[-1]
    assert not made
    first.say({"op": "call_service", "id": "last", "service": "/rosapi/get_time"})
    came = []
    while (message := first.hear()).get("id") != "last":
        came.append(message["msg"])
    assert came == told  # none of its own for the others' subscriptions


def test_slow_sending_slows_publications_not_the_clock(serve, raw, plain, monkeypatch):
    """Where handing messages to the system takes three ticks, states come seldom and time passes as it should."""
    server = serve(real_time_factor=1.0)
    client = raw(server)
    subscribe(client)
    real = server._bridge.flush
    count, spans = [], []

    def slowly():
        count.append(plain.now())
        begin = time.monotonic()
        time.sleep(0.03)
        real()
        spans.append((begin, time.monotonic()))

    monkeypatch.setattr(server._bridge, "flush", slowly)
    until(lambda: len(spans) >= 9)
    begins, ends = np.array(spans[:9]).T
    # half of the time at most goes to sending, however long that takes on a busy machine
    assert (ends - begins)[:-1].sum() < 0.5 * (begins[-1] - begins[0])
    # and more than two ticks are between them, but where a busy machine stalls
    assert np.median(np.diff(count[:9])) > 2.0 * server.tick
