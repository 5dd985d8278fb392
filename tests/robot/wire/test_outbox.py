"""What waits for a slow reader, and what does not."""

import asyncio

from nuno.robot.wire.outbox import Outbox


class Reader:
    """A peer that reads when it is let."""

    def __init__(self):
        """Not reading yet."""
        self.reads, self.got, self.given_up = asyncio.Event(), [], 0

    async def send(self, text):
        """Take a text, some time."""
        await self.reads.wait()
        self.got.append(text)

    def give_up(self):
        """Count how often it was given up."""
        self.given_up += 1


def run(texts, limit=1000):
    """Put texts for one that does not read, let it read, and return it."""

    async def main():
        reader = Reader()
        outbox = Outbox(asyncio.get_running_loop(), reader.send, reader.give_up, limit)
        for arguments in texts:
            outbox.put(*arguments)
        sending = asyncio.create_task(outbox.run())
        await asyncio.sleep(0.01)
        reader.reads.set()
        await asyncio.sleep(0.01)
        sending.cancel()
        return reader

    return asyncio.run(main())


def test_old_publications_are_dropped():
    """Of one topic the newest are kept, in their order among the rest, and nothing else is dropped."""
    reader = run([("a1", "a", 2), ("answer",), ("a2", "a", 2), ("b1", "b", 1), ("a3", "a", 2), ("result",)])
    assert reader.got == ["answer", "a2", "b1", "a3", "result"]


def test_one_who_never_reads_is_given_up():
    """Answers may not be dropped: who leaves too many of them is disconnected, once, and nothing more gathers."""
    reader = run([(f"{k}",) for k in range(100)], limit=10)
    assert reader.given_up == 1
    assert reader.got == [str(k) for k in range(10)]
