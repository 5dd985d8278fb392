"""What all tests share: those marked ``cuda`` need a CUDA device, and are skipped where there is none.

Kernels of CUDA that one short test runs on the CPU are compiled there without optimising: a third of the time, and the
same bits, which is what it compares. Where tests run kernels for longer that costs more than it saves.
"""

import os

import pytest

from warm_process import warm_programs

RUN_SHORTLY = ("plans.run_soft_blocks", "plans.run_soft_blocks_sharp")
"""Their modules."""


def pytest_collection_modifyitems(items):
    """Skip the tests that this machine cannot run, and compile quickly what one test runs."""
    import warp as wp

    if wp.get_cuda_device_count():
        return  # which would get slow kernels by the same modules
    for name in RUN_SHORTLY:
        wp.get_module(f"nuno.{name}").options["optimization_level"] = 0
    for item in items:
        if item.get_closest_marker("cuda"):
            item.add_marker(pytest.mark.skip(reason="no CUDA device"))


@pytest.fixture(scope="session")
def run_warm():
    """Return what runs a long test's program in a process of its own, without a display, Nuno imported already."""
    headless = {key: value for key, value in os.environ.items() if "DISPLAY" not in key}
    with warm_programs(headless | {"MPLBACKEND": "agg", "BROWSER": "true"}) as run:
        yield run
