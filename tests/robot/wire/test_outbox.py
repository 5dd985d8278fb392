"""What waits for a slow reader, and what does not."""

from nuno.robot.wire.outbox import Outbox


def test_old_publications_are_dropped():
    """Of one topic the newest are kept, in their order among the rest, and nothing else is dropped."""
    outbox = Outbox()
    for text in [("a1", "a", 2), ("answer",), ("a2", "a", 2), ("b1", "b", 1), ("a3", "a", 2), ("result",)]:
        assert outbox.add(*text)
    assert [outbox.pop() for _ in range(len(outbox))] == ["answer", "a2", "b1", "a3", "result"]
    assert outbox.add("a4", "a", 1)  # nothing of that topic waits any more
    assert outbox.add("a5", "a", 1)
    assert (len(outbox), outbox.pop()) == (1, "a5")


def test_what_may_not_be_dropped_has_an_end():
    """Answers may not be dropped: there is room for so many of them, beside publications."""
    outbox = Outbox(limit=10)
    assert outbox.add("clock", "clock")
    assert all(outbox.add(f"{k}") for k in range(10))
    assert not outbox.add("one more")
    assert outbox.add("clock again", "clock")
    assert len(outbox) == 12
    outbox.clear()
    assert len(outbox) == 0
    assert outbox.add("again")
