"""Products of matrices by one thread for a while."""

from concurrent.futures import ThreadPoolExecutor
from threading import Barrier

import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from nuno.numbers.blas_threads import one_blas_thread


def threads():
    """How many threads multiply matrices now, by library."""
    return {pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"}


def test_one_thread_within_and_as_many_as_before_afterwards():
    """Also nested, and where something fails within."""
    with threadpool_limits(2, user_api="blas"):
        with one_blas_thread():
            with one_blas_thread():
                assert threads() == {1}
            assert threads() == {1}
        assert threads() == {2}
        with pytest.raises(KeyError), one_blas_thread():
            raise KeyError
        assert threads() == {2}


def test_who_asks_at_the_same_time_does_not_keep_the_limit():
    """Two are within at once and leave in the order in which they came: what was before is there again."""
    both, first_left = Barrier(2, timeout=20), Barrier(2, timeout=20)

    def ask(first):
        with one_blas_thread():
            both.wait()
            if not first:
                first_left.wait()
        if first:
            first_left.wait()

    with threadpool_limits(2, user_api="blas"):
        with ThreadPoolExecutor(2) as pool:
            list(pool.map(ask, (True, False)))
        assert threads() == {2}
