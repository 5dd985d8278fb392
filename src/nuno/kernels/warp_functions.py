"""Functions of Warp's own that Nuno replaces by wrappers of them, each once."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any


def wrap_function(owner: Any, name: str, wrapped: Callable[[Any], Callable[..., Any]]) -> bool:
    """Replace a function by a wrapper unless that was done before, and return whether there is such a function.

    Args:
        owner: What has it, a module or an object of Warp's.
        name: Its name there.
        wrapped: Returns the wrapper of the function that it is given.
    """
    own = getattr(owner, name, None)
    if own is None:
        return False
    if not getattr(own, "is_nuno_wrapper", False):
        wrapper: Any = wrapped(own)
        wrapper.is_nuno_wrapper = True
        setattr(owner, name, wrapper)
    return True
