"""Calls on the threads of the CPU."""

import threading
import time

import pytest

from nuno.plans import cpu_threads
from nuno.plans.cpu_threads import run_together


@pytest.mark.parametrize("cores", [1, 3])
def test_each_call_is_made_once(monkeypatch, cores):
    """By this thread too, with more calls than threads or fewer; an error comes out once no other call runs."""
    monkeypatch.setattr(cpu_threads, "core_count", lambda: cores)
    monkeypatch.setattr(cpu_threads, "_threads", None)
    for number in (1, 2, 40):
        made, threads = [], set()

        def call(k, made=made, threads=threads):
            time.sleep(1e-3)
            made.append(k)
            threads.add(threading.current_thread())

        run_together([lambda k=k, call=call: call(k) for k in range(number)])
        assert sorted(made) == list(range(number)) and len(threads) <= min(cores, number)
        assert number == 2 or threading.current_thread() in threads
    under_way = []

    def slow():
        under_way.append(1)
        time.sleep(0.02)
        under_way.pop()

    def broken():
        raise ValueError("broken")

    with pytest.raises(ValueError, match="broken"):
        run_together([slow, broken, slow])
    assert not under_way
