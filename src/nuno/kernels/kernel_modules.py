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

BLOCK_SIZE = 256
"""Threads of a CUDA block where a launch names no other number: Warp's default, and that of most kernels."""

CPU_ONLY = frozenset(
    f"nuno.plans.{name}"
    for name in (
        "run_worlds", "run_lanes", "run_double_worlds", "run_double_lanes", "run_simd", "run_double_simd",
        "run_soft_worlds", "run_soft_lanes", "run_soft_simd",
        "run_soft_double_worlds", "run_soft_double_lanes", "run_soft_double_simd",
    )
)  # fmt: skip
"""Worlds by a thread, and in lanes of SIMD registers."""

WHEN_NAMED = frozenset(
    f"nuno.plans.{name}" for name in ("run_worlds", "run_double_worlds", "run_soft_worlds", "run_soft_double_worlds")
)
"""A world by a thread on the CPU: no world takes that plan by itself, so these are compiled ahead only by name."""

CUDA_ONLY = tuple(
    f"nuno.{name}"
    for name in (
        "plans.run_blocks", "plans.run_double_blocks", "plans.run_grid", "plans.run_double_grid",
        "plans.run_soft_blocks", "plans.run_soft_few", "plans.run_soft_double_blocks", "plans.run_soft_grid",
        "plans.run_soft_double_grid", "rigid.run_rigid_group", "state.finite",
        "camera.covered_fields",
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
    package = Path(__file__).parents[1]
    declaring = (path for path in package.rglob("*.py") if path != Path(__file__) and "@wp.kernel" in path.read_text())
    return sorted(".".join((package.name, *path.relative_to(package).with_suffix("").parts)) for path in declaring)


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
    from nuno.plans import block_plan, group_kernels, soft_block_plan

    few, many = block_plan.FEW_THREADS, block_plan.MANY_THREADS
    plain = name.rpartition(".")[2]
    if plain in ("run_blocks", "run_blocks_partly", "run_double_blocks", "run_double_blocks_partly"):
        return (few, many)
    if plain == "run_blocks_shared":
        return (few,)
    if plain in ("run_grid", "run_double_grid"):
        return (group_kernels.THREADS,)
    if plain.startswith("run_soft_blocks_shared"):
        return (soft_block_plan.MANY_THREADS,)
    return (BLOCK_SIZE,)
