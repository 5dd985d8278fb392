"""Matrix products by one thread.

The library behind NumPy's products shares each among all cores. Of small ones its threads wait for each other for
longer than a thread takes, by hundreds of times where other work keeps the cores busy.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from threading import Lock
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from threadpoolctl import ThreadpoolController

_lock = Lock()
_inside = 0
_limit: Any = None


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Let one thread multiply matrices within; as many as before do so again once all who asked for it are out."""
    global _inside, _limit
    with _lock:
        if _inside == 0:
            _limit = _controller().limit(limits=1, user_api="blas")
        _inside += 1
    try:
        yield
    finally:
        with _lock:
            _inside -= 1
            if _inside == 0:
                _limit.restore_original_limits()


@lru_cache(maxsize=1)
def _controller() -> ThreadpoolController:
    """The controller of the libraries that are loaded."""
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()
