"""Structs passed by reference to functions of Nuno's kernels, which Warp passes by value.

The state of a world is a struct of some fifty array descriptors, 3 kB. Every call copies it, all calls are inlined, and
the compiler's optimiser spends most of its time on taking the copies apart again: of `nuno.plans.run_blocks_shared`,
125 s of CPU time by value and 57 s by reference, with the same instructions in the end; of `nuno.plans.run_lanes` on
the CPU a fifth. Warp has a public annotation for this (``wp.ref[T]``), but not for functions that are generic in the
type, as most of Nuno's are. So the C++ text of a function's parameters is changed where Warp writes it, and only for
functions of Nuno. For CUDA all of them are inlined by force as well, as its compiler would leave some apart and the
state in memory then; for the CPU some are kept out of line (`nuno.kernels.out_of_line`). A parameter that its function
changes, as a whole or in a field, stays a copy.

What is changed is private to Warp. Where a version of Warp has another form of it, nothing is changed and kernels take
longer to compile; `tests/kernels/test_struct_references.py` says so.
"""

from __future__ import annotations

import ast
from typing import Any

from nuno.kernels.out_of_line import OUT_OF_LINE
from nuno.kernels.warp_functions import wrap_function


def pass_structs_by_reference() -> bool:
    """Let Warp write references for Nuno's functions from now on, and return whether this version of it can."""
    from warp._src import codegen

    return wrap_function(codegen, "codegen_func", _with_structs_by_reference)


def _with_structs_by_reference(write: Any) -> Any:
    def codegen_func(adj: Any, *args: Any, **options: Any) -> str:
        if not getattr(adj.func, "__module__", "").startswith("nuno."):
            text: str = write(adj, *args, **options)
            return text
        if options.get("device", "cpu") == "cuda":
            options["inline_hint"] = options.get("inline_hint") or "forceinline"
        elif f"{adj.func.__module__}.{adj.fun_name}" in OUT_OF_LINE:
            options["inline_hint"] = "noinline"
        return _with_references(adj, write(adj, *args, **options), options.get("device", "cpu"))

    return codegen_func


def _with_references(adj: Any, text: str, device: str) -> str:
    """The C++ text of a function with references for the structs that it only reads.

    For the CPU they are also said to be written by nobody else meanwhile: a function out of line would read their
    fields again after every number that it writes.
    """
    from warp._src.codegen import Struct

    assigned = assignments(adj.tree)
    head, brace, body = text.partition("\n{")
    for arg in adj.args:
        if isinstance(arg.type, Struct) and not any(
            name == arg.label and _changes(arg.type, fields, in_array) for name, fields, in_array in assigned
        ):
            passed = "& __restrict__ " if device == "cpu" else "& "
            head = head.replace(f"{arg.ctype()} {arg.emit()}", f"{arg.ctype()}{passed}{arg.emit()}", 1)
    return head + brace + body


def assignments(tree: ast.AST) -> set[tuple[str, tuple[str, ...], bool]]:
    """Return what a function assigns to.

    Returns:
        The variable, the fields from it on, and whether an element of the last one is meant: ``t = ...`` is
        ``("t", (), False)``, ``t.notes = ...`` is ``("t", ("notes",), False)``, and ``t.x[i] = ...`` is
        ``("t", ("x",), True)``.
    """
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Name | ast.Attribute | ast.Subscript) and isinstance(node.ctx, ast.Store):
            fields: list[str] = []
            element = False
            while not isinstance(node, ast.Name):
                if isinstance(node, ast.Attribute):
                    fields.insert(0, node.attr)
                elif isinstance(node, ast.Subscript):  # of what came so far; fields behind it are the element's
                    fields, element = [], True
                else:
                    break
                node = node.value
            else:
                found.add((node.id, tuple(fields), element))
    return found


def _changes(struct: Any, fields: tuple[str, ...], element: bool) -> bool:
    """Tell whether assigning to fields changes their struct, as assigning to elements of its arrays does not."""
    from warp._src.types import is_array

    kind = struct
    for field in fields:
        if not hasattr(kind, "vars"):  # a vector's component
            return True
        kind = kind.vars[field].type
    return not (element and is_array(kind))
