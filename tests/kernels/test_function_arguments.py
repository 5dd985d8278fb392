"""Functions as arguments of functions: found where there are some, and not looked for where no overload takes any."""

import subprocess
import sys

import pytest
import warp as wp
from warp._src import codegen

from nuno.kernels.function_arguments import look_for_function_arguments_where_taken


@wp.func
def squared(x: float):
    """A function that is handed over."""
    return x * x


@wp.func
def plain(x: float):
    """None of its overloads takes a function."""
    return x


@wp.func
def plain(x: int):  # noqa: D103, F811
    return x


@wp.func
def applied(f: wp.Function, x: float):
    """A function that takes another."""
    return f(x)


@wp.func
def several(x: float):
    """One of its overloads takes a function."""
    return x


@wp.func
def several(f: wp.Function, x: float):  # noqa: D103, F811
    return f(x)


@wp.func
def caller(x: float):
    """Calls of all of them."""
    return plain(x) + applied(squared, x) + several(x) + several(squared, x)


@pytest.fixture
def asked(monkeypatch):
    """The names of functions for which Warp itself looks."""
    names, look = [], codegen.iter_call_callable_arg_targets

    def watch(adj, func, *args):
        names.append(func.key)
        return look(adj, func, *args)

    monkeypatch.setattr(codegen, "iter_call_callable_arg_targets", watch)
    return names


def test_what_is_handed_over_is_found(asked):
    """References of a function are those that Warp finds, and it is asked for no call that can hand over none."""
    expected = caller.adj.get_references()
    assert set(asked) == {"plain", "applied", "several"}
    asked.clear()
    assert look_for_function_arguments_where_taken()
    found = caller.adj.get_references()
    assert found == expected
    assert set(found[2]) >= {squared, plain, applied, several}
    assert set(asked) == {"applied", "several"}


def test_a_warp_of_another_form_is_left(monkeypatch):
    """Nothing is changed where there is no such function."""
    monkeypatch.delattr(codegen, "iter_call_callable_arg_targets")
    assert not look_for_function_arguments_where_taken()


@pytest.mark.long
def test_hashes_are_those_of_warp():
    """Of all modules of kernels, for every size of blocks: what is in a cache is found again."""
    program = """
import hashlib, sys
from nuno.kernels.function_arguments import look_for_function_arguments_where_taken
if sys.argv[1] == "less":
    assert look_for_function_arguments_where_taken()
import warp as wp
wp.config.log_level = wp.LOG_ERROR
from nuno.kernels.kernel_modules import kernel_modules
for each in kernel_modules():
    print(each.name, *(each.module.get_module_hash(block).hex() for block in (1, *each.blocks)))
"""
    told = [
        subprocess.run([sys.executable, "-c", program, kind], capture_output=True, text=True, check=True).stdout
        for kind in ("all", "less")
    ]
    assert "nuno.plans.run_lanes" in told[0] and told[0] == told[1]
