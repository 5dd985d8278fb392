"""What all tests share: those marked ``cuda`` need a CUDA device, and are skipped where there is none."""

import pytest


def pytest_collection_modifyitems(items):
    """Skip the tests that this machine cannot run."""
    marked = [item for item in items if item.get_closest_marker("cuda")]
    if marked:
        import warp as wp

        if not wp.get_cuda_device_count():
            for item in marked:
                item.add_marker(pytest.mark.skip(reason="no CUDA device"))
