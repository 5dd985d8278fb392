"""An estimate's kernels, compiled on other threads while the images are looked at.

With an empty kernel cache most of the wait is for one of them, that of a batch in lanes or by blocks; the others are
compiled beside it. On the CPU nothing else is done in Python until that one's source is written, for the compiler then
has more to do than all that is left.
"""

from __future__ import annotations

import logging
from collections.abc import Callable

import warp as wp

from nuno.camera import extent, raster
from nuno.estimate import pattern, similarity
from nuno.kernels.kernel_cache import is_cached
from nuno.kernels.module_loads import load_ahead, wait_for_load, wait_for_source
from nuno.kernels.precompiled_headers import begin_to_read_headers
from nuno.plans.block_plan import FEW_THREADS, MANY_THREADS, run_blocks_shared, run_blocks_small
from nuno.plans.cloth_worlds import run_lanes
from nuno.plans.cpu_threads import core_count
from nuno.state import pack

log = logging.getLogger(__name__)

THREADS = 2
"""On the CPU: the longest module takes longer than all others together."""
BATCHES = ((run_blocks_shared, FEW_THREADS), (run_blocks_small, MANY_THREADS))
"""On CUDA, of some and of many futures; each is compiled for most of a minute. A clear case has only some, a doubtful
one has many later on."""


def compile_ahead(device: str) -> Callable[[], None]:
    """Begin to load the kernels that an estimate launches, compiled where they are not in the cache.

    Args:
        device: "cpu" or "cuda:0" ...

    Returns:
        A function that waits until all are there, and raises what went wrong. None of these kernels may be launched
        before, for Warp would compile it once more. On CUDA it does not wait for those of batches: whoever launches
        one does (`nuno.kernels.module_loads`).
    """
    parts = [wp.get_module(part.__name__) for part in (pack, extent, raster, similarity, pattern)]
    if device == "cpu":
        parts.insert(0, run_lanes.module)
        is_compiled = is_cached(f"{run_lanes.module.name}_*", "o")
        if not is_compiled:
            begin_to_read_headers()
        load_ahead(((part, None) for part in parts), device, THREADS)
        if not is_compiled:
            wait_for_source(run_lanes.module, device)
    else:
        parts.append(pack.find_broken.module)
        every = [(kernel.module, block) for kernel, block in BATCHES]
        batches = [(each, block) for each, block in every if not is_cached(f"{each.name}_*", "ptx", "cubin")]
        if batches:
            log.warning(
                "compiling the kernels of %s beside the estimate, for about a minute: they are kept for later runs",
                " and ".join(module.name for module, _ in batches),
            )
        threads = max(2, core_count())
        load_ahead([*batches, *((part, None) for part in parts)], device, threads)

    def wait() -> None:
        for part in parts:
            wait_for_load(part, device)

    return wait
