"""The device of a command that names none, which is not to wait a minute for its first answer."""

from __future__ import annotations

import logging

from nuno.kernels.kernel_cache import is_cached

log = logging.getLogger(__name__)


def device_of_command(name: str, kernels: str) -> str:
    """Return the device that a command runs on: for "auto" CUDA only where its kernels have been compiled.

    Compiling them takes about a minute, an answer on the CPU seconds. That the CPU is taken is told, with the cure.

    Args:
        name: "auto", or a device, which stays.
        kernels: The module of kernels that the command waits for longest.
    """
    if name != "auto":
        return name
    import warp as wp

    if not wp.get_cuda_device_count():
        return "cpu"
    device = wp.get_device("cuda:0")
    if is_cached(f"{kernels}_*", "ptx", f"sm{device.arch}.cubin"):
        return name
    log.warning(
        "kernels for %s are not compiled yet, which takes about a minute: the CPU is taken. --device cuda compiles "
        "them now; nuno compile --device cuda compiles all ahead",
        device.name,
    )
    return "cpu"
