"""What all tests share: those marked ``cuda`` need a CUDA device, and are skipped where there is none.

Kernels that the CPU runs in tests alone, to compare plans, are compiled there without optimising: a third of the time.
They give the same bits, which is what those tests compare.
"""

import pytest

FOR_COMPARISON = (
    "plans.run_worlds", "plans.run_double_worlds", "plans.run_soft_worlds", "plans.run_soft_double_worlds",
    "plans.run_grid", "plans.run_double_grid", "plans.run_soft_grid", "plans.run_soft_blocks",
    "plans.run_soft_blocks_sharp",
)  # fmt: skip
"""Modules of worlds by a thread, and of CUDA's kernels: no world on the CPU takes these plans by itself."""


def pytest_collection_modifyitems(items):
    """Skip the tests that this machine cannot run, and compile quickly what only tests run."""
    import warp as wp

    if wp.get_cuda_device_count():
        return  # which would get slow kernels by the same modules
    for name in FOR_COMPARISON:
        wp.get_module(f"nuno.{name}").options["optimization_level"] = 0
    for item in items:
        if item.get_closest_marker("cuda"):
            item.add_marker(pytest.mark.skip(reason="no CUDA device"))
