"""An estimate's kernels, compiled on other threads while the images are looked at.

With an empty kernel cache most of the wait is for one of them, that of a batch in lanes; the others are compiled beside
it. Warp's compiler does not hold Python's lock.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import warp as wp

from nuno.camera import extent, raster
from nuno.estimate import pattern, similarity
from nuno.plans.cloth_worlds import run_lanes
from nuno.state import pack

THREADS = 2
"""The longest module takes longer than all others together."""


def compile_ahead(device: str) -> Callable[[], None]:
    """Begin to load the kernels that an estimate launches, compiled where they are not in the cache.

    On CUDA nothing is done: what is compiled there depends on how many worlds there are.

    Args:
        device: "cpu" or "cuda:0" ...

    Returns:
        A function that waits until all are there, and raises what went wrong. None of these kernels may be launched
        before, for Warp would compile it once more.
    """
    if device != "cpu":
        return lambda: None
    wp.init()  # once, before threads do
    parts = (pack, extent, raster, similarity, pattern)
    modules = [run_lanes.module, *(wp.get_module(part.__name__) for part in parts)]
    pool = ThreadPoolExecutor(THREADS, thread_name_prefix="nuno-compile")
    loading = [pool.submit(wp.load_module, module, device) for module in modules]
    pool.shutdown(wait=False)

    def wait() -> None:
        for each in loading:
            each.result()

    return wait
