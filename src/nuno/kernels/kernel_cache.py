"""Warp's kernel cache filled ahead of use: in a container image, on a cluster, before a demonstration.

For CUDA no device is needed. What is made there is machine code of one architecture (cubin), under the name by which
Warp looks for it; Warp's own choice, PTX, would be made into machine code by the driver when first loaded, which is
most of the wait.
"""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Collection
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path
from typing import Any

from nuno.errors import InvalidInputError
from nuno.kernels.kernel_modules import WHEN_NAMED, KernelModule, kernel_modules
from nuno.kernels.struct_references import pass_structs_by_reference
from nuno.plans.cpu_threads import core_count


def compile_kernels(
    device: str = "cpu", arch: str | None = None, *, only: Collection[str] | None = None, jobs: int | None = None,
    report: Callable[[str, float], Any] | None = None,
) -> Path:  # fmt: skip
    """Compile kernels that are not in Warp's cache yet.

    Args:
        device: "cpu", for this machine's processor, or "cuda".
        arch: CUDA's architecture, "sm_90" for an H100 or H200; None: that of this machine's devices.
        only: Names of Warp modules; None: all that the device runs by itself.
        jobs: How many are compiled at once; None: as many as there are cores.
        report: Called with each module's name and seconds as soon as it is there.

    Returns:
        The folder of the cache.

    Raises:
        InvalidInputError: a device, an architecture or a module that there is not.
    """
    import warp as wp

    if device not in ("cpu", "cuda"):
        raise InvalidInputError(f'kernels are compiled for "cpu" or "cuda", got {device!r}')
    if device == "cpu" and arch is not None:
        raise InvalidInputError(f"an architecture is CUDA's: arch={arch!r} needs the device cuda")
    chosen = [module for module in kernel_modules() if device in module.devices]
    if only is None:
        chosen = [module for module in chosen if module.name not in WHEN_NAMED]
    else:
        if unknown := sorted(set(only) - {module.name for module in chosen}):
            raise InvalidInputError(f"there is no module of kernels {unknown[0]!r} for {device}")
        chosen = [module for module in chosen if module.name in only]
    numbers = _architectures(arch) if device == "cuda" else ()
    pass_structs_by_reference()

    def work(module: KernelModule) -> float:
        started = time.perf_counter()
        if device == "cpu":
            wp.load_module(module.module, device="cpu")
        else:
            _compile_for_cuda(module, numbers)
        return time.perf_counter() - started

    pool = ThreadPoolExecutor(jobs or core_count(), thread_name_prefix="nuno-compile")
    try:
        waiting = {pool.submit(work, module): module.name for module in chosen}
        for done in as_completed(waiting):
            seconds = done.result()
            if report is not None:
                report(waiting[done], seconds)
    finally:
        pool.shutdown(cancel_futures=True)
    return Path(wp.config.kernel_cache_dir or "")


def take_machine_code(device: str) -> None:
    """Let Warp look for machine code in its cache, not for PTX, where there is some of Nuno's for the device.

    A choice of one's own (``warp.config.cuda_output``) stays.

    Args:
        device: "cuda:0" ...
    """
    import warp as wp

    if wp.config.cuda_output is None:
        if is_cached("nuno.*", f"sm{wp.get_device(device).arch}.cubin"):
            wp.config.cuda_output = "cubin"


def is_cached(modules: str, *kinds: str) -> bool:
    """Return True if Warp's cache has files that end in any of some ways, of modules by a pattern of their names."""
    import warp as wp

    cache = Path(wp.config.kernel_cache_dir or "")
    return any(path for kind in kinds for path in cache.glob(f"wp_{modules}/*.{kind}"))


def _architectures(arch: str | None) -> tuple[int, ...]:
    import warp as wp

    supported = wp.get_cuda_supported_archs()
    if arch is None:
        here = {device.arch for device in wp.get_cuda_devices()}
        if not here:
            raise InvalidInputError("there is no CUDA device here to compile for: name its architecture, such as sm_90")
        return tuple(sorted(here))
    found = re.fullmatch(r"(?:sm_)?(\d+)", arch)
    if not found or int(found[1]) not in supported:
        raise InvalidInputError(f"arch must be one of {', '.join(f'sm_{each}' for each in supported)}, got {arch!r}")
    return (int(found[1]),)


def _compile_for_cuda(module: KernelModule, numbers: tuple[int, ...]) -> None:
    """Machine code of a module, for each size of blocks."""
    import warp as wp

    before = wp.get_module_options(module.module)["block_dim"]
    for block in module.blocks:
        wp.set_module_options({"block_dim": block}, module=module.module)
        wp.compile_aot_module(module.module, arch=numbers, use_ptx=False)
    wp.set_module_options({"block_dim": before}, module=module.module)
