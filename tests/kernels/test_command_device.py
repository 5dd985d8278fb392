"""Where a command runs that names no device."""

import logging
from types import SimpleNamespace

import pytest
import warp as wp

from nuno.kernels.command_device import device_of_command

KERNELS = "nuno.plans.run_blocks_shared"


@pytest.fixture
def cache(monkeypatch, tmp_path):
    """An empty cache on a machine with a device of architecture 90."""
    monkeypatch.setattr(wp, "get_cuda_device_count", lambda: 1)
    monkeypatch.setattr(wp, "get_device", lambda name: SimpleNamespace(arch=90, name="a device"))
    monkeypatch.setattr(wp.config, "kernel_cache_dir", str(tmp_path))
    return tmp_path


def test_nothing_compiled_is_told_with_the_cure(cache, caplog):
    """The CPU answers meanwhile."""
    with caplog.at_level(logging.WARNING):
        assert device_of_command("auto", KERNELS) == "cpu"
    assert "--device cuda" in caplog.text
    assert "nuno compile" in caplog.text


@pytest.mark.parametrize(
    ("file", "device"),
    [
        (f"wp_{KERNELS}_0123456/wp_{KERNELS}_0123456.sm90.cubin", "auto"),
        (f"wp_{KERNELS}_0123456/wp_{KERNELS}_0123456.sm75.ptx", "auto"),
        (f"wp_{KERNELS}_0123456/wp_{KERNELS}_0123456.sm80.cubin", "cpu"),  # another architecture's
        (f"wp_{KERNELS}_0123456/wp_{KERNELS}_0123456.cu", "cpu"),  # the source alone
        ("wp_nuno.plans.run_blocks_0123456/wp_nuno.plans.run_blocks_0123456.sm90.cubin", "cpu"),  # another module's
    ],
)
def test_what_is_compiled_is_taken(cache, file, device):
    """Machine code of the device's own architecture, or PTX, of the module that is asked for."""
    path = cache / file
    path.parent.mkdir()
    path.touch()
    assert device_of_command("auto", KERNELS) == device


@pytest.mark.parametrize("name", ["cpu", "cuda", "cuda:1"])
def test_a_named_device_stays(cache, caplog, name):
    """Whatever is compiled."""
    assert device_of_command(name, KERNELS) == name
    assert not caplog.text


def test_without_cuda_it_is_the_cpu(monkeypatch, caplog):
    """Without a word, as there is no choice."""
    monkeypatch.setattr(wp, "get_cuda_device_count", lambda: 0)
    assert device_of_command("auto", KERNELS) == "cpu"
    assert not caplog.text
