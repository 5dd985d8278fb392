"""Devices by name: "auto", "cpu", "cuda", "cuda:0" ..."""

from __future__ import annotations

import re
from typing import Any

from nuno.errors import InvalidInputError
from nuno.kernels.function_arguments import look_for_function_arguments_where_taken
from nuno.kernels.kernel_cache import take_machine_code
from nuno.kernels.quiet import quiet_warp
from nuno.kernels.struct_references import pass_structs_by_reference


def checked_device(name: Any) -> str:
    """Return a device's name as it is written; whether there is such a device here is another question.

    Raises:
        InvalidInputError: not a device's name.
    """
    if not isinstance(name, str) or not re.fullmatch(r"auto|cpu|cuda(:\d+)?", name):
        raise InvalidInputError(f'device must be "auto", "cpu", "cuda" or "cuda:0" ..., got {name!r}')
    return name


def found_device(name: str) -> str:
    """Return "cpu" or "cuda:0" ... for a device's name.

    Raises:
        InvalidInputError: there is no such device here.
    """
    quiet_warp()
    pass_structs_by_reference()
    look_for_function_arguments_where_taken()
    if name == "cpu":
        return name
    import warp as wp

    available = wp.get_cuda_device_count()
    if name == "auto" and not available:
        return "cpu"
    index = int(name.partition(":")[2] or 0)
    if index >= available:
        valid = ", ".join(["cpu", *(f"cuda:{i}" for i in range(available))])
        raise InvalidInputError(f"there is no device {name!r} here; there are: {valid}")
    take_machine_code(f"cuda:{index}")
    return f"cuda:{index}"
