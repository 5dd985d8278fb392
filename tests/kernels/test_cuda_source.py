"""CUDA's side of every kernel, seen without a GPU: each module that CUDA runs is compiled to PTX for an H100 or H200.

Native snippets have a branch for CUDA, which no other test looks at on a machine without a device. Where the source
alone is looked at, nothing is optimised (Warp's mode "debug") or inlined. Warp keeps what was compiled in its cache, by
a hash of the source, so that only what has changed is compiled again.
"""

import gc

import pytest
import warp as wp

from nuno.kernels.kernel_modules import kernel_modules
from nuno.kernels.struct_references import pass_structs_by_reference

ARCHITECTURE = 90
MODULES = {module.name: module for module in kernel_modules() if "cuda" in module.devices}
WHOLE = {
    "run_blocks_shared", "run_grid", "run_soft_blocks_shared_sharp", "run_soft_double_blocks_partly_sharp",
    "run_rigid_group",
}  # fmt: skip
"""Of the modules that go through the substeps of bodies, those that between them have all native snippets, in floats
and doubles: only these have a branch for CUDA. The others have the same snippets over other memory, and functions that
the CPU compiles too; they are slow tests, named "again-..."."""


def _again(name):
    """Return whether a module has the snippets of others."""
    last = name.rpartition(".")[2]
    return name.startswith(("nuno.plans.run_", "nuno.rigid.run_")) and last not in WHOLE


@pytest.fixture
def functions_apart():
    """Keep Nuno's functions out of line; Warp names what is made of them by another hash than what is launched.

    A test that ran one of Nuno's commands in this process has frozen what was there, which `gc.get_objects` leaves out.
    """
    gc.unfreeze()
    found = [each for each in gc.get_objects() if isinstance(each, wp.Function)]
    apart = [
        each
        for each in found
        if each.inline_hint is None
        and each.native_snippet is None
        and each.func is not None
        and each.func.__module__.startswith("nuno.")
    ]
    for each in apart:
        each.inline_hint = "noinline"
    yield apart
    for each in apart:
        each.inline_hint = None


def compile_to_ptx(name, mode):
    """Compile a module, and look for all its kernels in what was made."""
    module, blocks = MODULES[name].module, MODULES[name].blocks
    pass_structs_by_reference()
    kept = dict(wp.get_module_options(module))
    wp.set_module_options({"block_dim": blocks[0], "mode": mode, "optimization_level": 3}, module=module)
    try:
        (made,) = wp.compile_aot_module(module, arch=ARCHITECTURE, use_ptx=True)
    finally:
        wp.set_module_options(kept, module=module)
    ptx = made.read_text()
    kernels = [each for kernel in module.kernels.values() for each in (kernel.overloads or {"": kernel}).values()]
    assert kernels
    for kernel in kernels:
        assert f".entry {kernel.key}_" in ptx, kernel.key


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, id=f"again-{name}", marks=pytest.mark.slow) if _again(name)
        else pytest.param(name, id=name, marks=pytest.mark.long)
        for name in MODULES
    ],
)  # fmt: skip
def test_module_compiles_to_ptx(functions_apart, name):
    """All overloads of its kernels, also of those that a factory made; an error names the line of Nuno's source."""
    assert len(functions_apart) > 100
    compile_to_ptx(name, "debug")


@pytest.mark.slow
@pytest.mark.parametrize("name", MODULES, ids=lambda name: f"again-{name}")
def test_module_compiles_as_it_is_launched(name):
    """The same inlined and optimised, as on a device: many times as long."""
    compile_to_ptx(name, "release")
