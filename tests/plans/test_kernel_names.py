"""What kernels are called in the cache: the same, whatever was compiled before them."""

import ast
from pathlib import Path

import warp as wp

import nuno

SOURCES = sorted(Path(nuno.__file__).parent.rglob("*.py"))


def kernels_in(source):
    """Yield the functions of a file that Warp compiles."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.FunctionDef):
            marks = {ast.unparse(mark.func if isinstance(mark, ast.Call) else mark) for mark in node.decorator_list}
            if marks & {"wp.func", "wp.kernel"}:
                yield node


def taken_for_constants(function):
    """Return the function's variables whose members Warp reads as a constant of its own, as ``e.a`` where e is 2.718.

    It does so only until the function has been compiled in a process. What a module is called in the cache is made of
    all that, so that it would be another name in another order, and be compiled again.
    """
    own = {node.id for node in ast.walk(function) if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)}
    roots = {node.value.id for node in ast.walk(function) if isinstance(node, ast.Attribute) and is_name(node.value)}
    return {name for name in own & roots if isinstance(getattr(wp, name, None), (int, float))}


def is_name(node):
    """Say whether an expression is a bare name."""
    return isinstance(node, ast.Name)


def test_no_variable_of_a_kernel_is_taken_for_a_constant():
    """Promise: a kernel that was compiled once is found again by later programs, in whatever order they ask."""
    found = {
        f"{path.name}: {function.name}": names
        for path in SOURCES
        for function in kernels_in(path.read_text(encoding="utf-8"))
        if (names := taken_for_constants(function))
    }
    assert not found


def test_such_a_variable_would_be_noticed():
    """The rule by its case: a local ``e`` with members is one, as an argument or without members it is none."""
    bad, fine = (
        f"@wp.func\ndef read(t: Any{argument}):\n    {first}\n    return {member}\n"
        for argument, first, member in (("", "e = Element()", "e.a"), (", e: Element", "k = 0", "e.a"))
    )
    assert [taken_for_constants(function) for function in kernels_in(bad)] == [{"e"}]
    assert [taken_for_constants(function) for function in kernels_in(fine)] == [set()]
