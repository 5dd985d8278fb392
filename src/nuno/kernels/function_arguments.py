"""Functions that kernels hand to functions as arguments, which Warp looks for at every call.

It does so as a function is declared and once more for its module's hash: at every call it tells the arguments' types,
and binds them to each overload. That is a quarter of what declaring Nuno's functions takes, and more than half of a
hash, 0.25 s of CPU time in each process that estimates. A function none of whose overloads takes a function is told by
its annotations alone, and nearly all are such. The hashes are the same.

What is changed is private to Warp. Where a version of Warp has another form of it, nothing is changed and a process
takes longer to start; `tests/kernels/test_function_arguments.py` says so.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from nuno.kernels.warp_functions import wrap_function


def look_for_function_arguments_where_taken() -> bool:
    """Let Warp look for them only where a function takes some from now on, and return whether this version can."""
    from warp._src import codegen

    return wrap_function(codegen, "iter_call_callable_arg_targets", _looking_where_taken)


def _looking_where_taken(look: Any) -> Any:
    from warp._src.context import Function

    def iter_call_callable_arg_targets(adj: Any, func: Any, *args: Any, **options: Any) -> Iterable[Any]:
        if isinstance(func, Function) and not func.is_builtin() and not _takes_functions(func, Function):
            return ()
        found: Iterable[Any] = look(adj, func, *args, **options)
        return found

    return iter_call_callable_arg_targets


def _takes_functions(func: Any, kind: type) -> bool:
    overloads = (func, *func.user_overloads.values(), *func.user_templates.values())
    for overload in overloads:
        for annotation in overload.input_types.values():
            if annotation is kind:
                return True
    return False
