"""Flags of Warp's compiler for the CPU, by which Nuno's kernels compile sooner, with the same bits.

Warp asks it to inline functions of any size, for which kernels as long as a substep take half as long again to compile,
and are no faster than with a ninth of that size (docs/reports/profiles.md).
"""

from typing import Any

import warp as wp

RAISED = ("-mllvm=-inline-", "-mllvm=-slp-")
"""Beginnings of Warp's flags that are left out. Options of LLVM's (``-mllvm``) are the process's: a module that has
others than one that is being compiled waits for it, so that an estimate's modules must all have the same."""

INLINED = "-mllvm=-inline-threshold=1000"
"""Warp has 9,000, LLVM 225, at which a twentieth of a run's speed is lost."""

UNCHECKED = "-discard-value-names -disable-llvm-verifier"
"""As a compiler by itself is called: its own code is neither given names nor checked on the way, for a twentieth of the
time. The machine code is the same to the byte."""


def compile_quickly(*modules: str) -> None:
    """Leave out adjoints of Warp modules, and of the compiler's flags in Warp's configuration what takes long.

    Args:
        modules: Their names. They may be declared later.
    """
    flags = "-march=native" if wp.config.cpu_compiler_flags is None else wp.config.cpu_compiler_flags
    kept = [flag for flag in flags.split() if not flag.startswith(RAISED)]
    for name in modules:
        options: dict[str, Any] = wp.get_module(name).options
        options["enable_backward"] = False
        options["cpu_compiler_flags"] = " ".join([*kept, INLINED, UNCHECKED])
