"""The Warp modules that hold Nuno's kernels: which there are, and what they are compiled for.

A module is what Warp compiles in one piece. Most are named after the Python module that declares them; a kernel of many
thousand lines has one of its own.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

BLOCK = 256
"""Threads of a CUDA block where a launch names no other number: Warp's default, and that of most kernels."""

CPU_ONLY = frozenset(
    f"nuno.solver.{name}"
    for name in (
        "run_worlds", "run_lanes", "run_fine_worlds", "run_fine_lanes", "wide", "run_fine_wide",
        "run_soft_worlds", "run_soft_lanes", "run_soft_wide",
        "run_soft_fine_worlds", "run_soft_fine_lanes", "run_soft_fine_wide",
    )
)  # fmt: skip
"""Worlds by a thread, and in lanes of SIMD registers."""

CUDA_ONLY = tuple(
    f"nuno.solver.{name}"
    for name in (
        "run_blocks", "run_fine_blocks", "run_grid", "run_fine_grid", "run_rigid_team", "finite",
        "run_soft_blocks", "run_soft_few", "run_soft_fine_blocks", "run_soft_grid", "run_soft_fine_grid",
    )
)  # fmt: skip
"""Beginnings of names: worlds by blocks and by the whole device. The CPU runs some of them, when asked to."""


@dataclass(frozen=True, eq=False)
class KernelModule:
    """A Warp module with kernels.

    Attributes:
        name: Its name.
        module: The Warp module.
        devices: "cpu", "cuda" or both: where its kernels are launched.
        blocks: Threads of a block, by which CUDA launches them; each is compiled by itself.
    """

    name: str
    module: Any
    devices: tuple[str, ...]
    blocks: tuple[int, ...]


def kernel_sources() -> list[str]:
    """Return the names of the Python modules that declare kernels, in order."""
    root = Path(__file__).parents[1]
    declaring = (path for path in root.rglob("*.py") if path != Path(__file__) and "@wp.kernel" in path.read_text())
    return sorted(".".join((root.name, *path.relative_to(root).with_suffix("").parts)) for path in declaring)


@cache
def kernel_modules() -> tuple[KernelModule, ...]:
    """Import all that declares kernels, and return their modules in the order of names."""
    import warp as wp

    wp.init()
    kernels = [
        kernel for source in kernel_sources() for kernel in _kernels(vars(import_module(source)), wp.Kernel)
    ]  # fmt: skip
    modules = {kernel.module.name: kernel.module for kernel in kernels}
    return tuple(_described(name, modules[name]) for name in sorted(modules))


def _kernels(names: dict[str, Any], kind: type) -> list[Any]:
    """The kernels among a Python module's names, those of factories, which are kept in dicts, as well."""
    values = [
        *names.values(),
        *(each for found in names.values() if isinstance(found, dict) for each in found.values()),
    ]
    return [value for value in values if isinstance(value, kind)]


def _described(name: str, module: Any) -> KernelModule:
    devices = ("cpu",) if name in CPU_ONLY else ("cuda",) if name.startswith(CUDA_ONLY) else ("cpu", "cuda")
    return KernelModule(name, module, devices, _blocks(name) if "cuda" in devices else ())


def _blocks(name: str) -> tuple[int, ...]:
    from nuno.solver import grid, shared, soft_blocks

    few, many = shared.FEW_THREADS, shared.MANY_THREADS
    plain = name.rpartition("nuno.solver.")[2]
    if plain in ("run_blocks", "run_blocks_partly", "run_fine_blocks", "run_fine_blocks_partly"):
        return (few, many)
    if plain == "run_blocks_shared":
        return (few,)
    if plain in ("run_grid", "run_fine_grid"):
        return (grid.THREADS,)
    if plain.startswith("run_soft_blocks_shared"):
        return (soft_blocks.MANY_THREADS,)
    return (BLOCK,)
