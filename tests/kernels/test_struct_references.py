"""Structs by reference in the source of kernels, and the copies that have to stay."""

import ast
import re
from importlib import import_module

import pytest
import warp as wp
from warp._src import codegen

from nuno.kernels import struct_references
from nuno.kernels.kernel_modules import kernel_modules
from nuno.kernels.out_of_line import OUT_OF_LINE
from nuno.kernels.struct_references import assignments, pass_structs_by_reference


@pytest.fixture
def by_value(monkeypatch):
    """Warp as it is, put back afterwards."""
    monkeypatch.setattr(codegen, "codegen_func", codegen.codegen_func)


@pytest.mark.parametrize(
    ("line", "what"),
    [
        ("t = other", {("t", (), False)}),
        ("t, other = both", {("t", (), False), ("other", (), False)}),
        ("t.notes = figures", {("t", ("notes",), False)}),
        ("t.point.x += 1.0", {("t", ("point", "x"), False)}),
        ("t.x[i] = 1.0", {("t", ("x",), True)}),
        ("t.x[i] += t.y[i]", {("t", ("x",), True)}),
        ("t.parts[i].mass = 1.0", {("t", ("parts",), True)}),
        ("for i in range(t.count): pass", {("i", (), False)}),
        ("t.x.fill(1.0)", set()),
    ],
)
def test_what_is_assigned_to(line, what):
    """A variable, a field, an element: by Python's own grammar."""
    assert assignments(ast.parse(line)) == what


@wp.struct
class Holder:
    """A struct with an array, a vector and a number."""

    x: wp.array(dtype=float)
    place: wp.vec3
    count: int


def _read(t: Holder, i: int):
    t.x[i] = t.x[i] + t.place[0]


def _count(t: Holder, i: int):
    t.count = i
    t.x[i] = float(t.count)


def _move(t: Holder, i: int):
    t.place[0] = 1.0
    t.x[i] = t.place[0]


def _replace(t: Holder, i: int):
    t = Holder()
    t.count = i


@pytest.mark.parametrize(("function", "kept"), [(_read, False), (_count, True), (_move, True), (_replace, True)])
def test_what_changes_its_struct_has_a_copy(by_value, function, kept):
    """A field, a vector's component and the whole would change for the caller, too, if there were no copy."""
    assert pass_structs_by_reference()
    function.__module__ = "nuno.tests"
    made = wp.Function(function, function.__name__, "nuno", module=wp.get_module(__name__))
    made.adj.build(None)
    for device in ("cpu", "cuda"):
        head = codegen.codegen_func(made.adj, "f", device=device, inline_hint=None).partition("\n{")[0]
        passed = " " if kept else "& __restrict__ " if device == "cpu" else "& "
        assert re.search(rf"Holder_\w+{passed}var_t", head)
        assert ("WP_FORCEINLINE" in head) == (device == "cuda")


def test_out_of_line_on_the_cpu_alone(by_value, monkeypatch):
    """A function that is listed is kept out of line there; CUDA inlines it like any other."""
    monkeypatch.setattr(struct_references, "OUT_OF_LINE", {"nuno.tests._count"})
    assert pass_structs_by_reference()
    for function in (_read, _count):
        function.__module__ = "nuno.tests"
        made = wp.Function(function, function.__name__, "nuno", module=wp.get_module(__name__))
        made.adj.build(None)
        text = {device: codegen.codegen_func(made.adj, "f", device=device) for device in ("cpu", "cuda")}
        assert ("WP_NOINLINE" in text["cpu"]) == (function is _count)
        assert "WP_NOINLINE" not in text["cuda"]


@pytest.mark.parametrize("name", sorted(OUT_OF_LINE))
def test_every_listed_function_is_there(name):
    """What is kept out of line is a function of Nuno's kernels; one that is renamed must be renamed in the list."""
    module, _, function = name.rpartition(".")
    assert isinstance(getattr(import_module(module), function), wp.Function)


def test_functions_of_others_are_left(by_value):
    """What is written for them is Warp's own."""
    before = codegen.codegen_func
    assert pass_structs_by_reference()
    made = wp.Function(_read, "_read", "other", module=wp.get_module(__name__))
    made.adj.build(None)
    _read.__module__ = "other.things"
    made.adj.func = _read
    for device in ("cpu", "cuda"):
        assert codegen.codegen_func(made.adj, "f", device=device) == before(made.adj, "f", device=device)


def test_a_warp_of_another_form_is_left(monkeypatch):
    """Nothing is changed where there is no such function."""
    monkeypatch.delattr(codegen, "codegen_func")
    assert not pass_structs_by_reference()


def test_tables_are_passed_by_reference(by_value, tmp_path):
    """In what is compiled: functions that only read their tables take them so."""
    module = next(each.module for each in kernel_modules() if each.name == "nuno.coupled.shape_bounds")
    assert pass_structs_by_reference()
    wp.compile_aot_module(module, arch=90, use_ptx=True, module_dir=tmp_path)
    source = next(tmp_path.glob("*.cu")).read_text()
    for name in ("Particles", "Shapes"):
        assert re.search(rf"{name}_[0-9a-f]{{8}}& var_", source)
