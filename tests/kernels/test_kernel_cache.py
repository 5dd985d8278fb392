"""Warp's kernel cache: the same names in every process, filled ahead of use, and left alone once it is full."""

import ast
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

import nuno
from nuno.__main__ import main
from nuno.errors import InvalidInputError
from nuno.kernels.kernel_cache import compile_kernels
from nuno.kernels.kernel_modules import CPU_ONLY, CUDA_ONLY, WHEN_NAMED, kernel_modules, kernel_sources

CASE = Path(__file__).parents[2] / "examples" / "pick-case"


def run(cache, *arguments, **environment):
    """Run Python in a process of its own with a kernel cache of its own; return what it wrote."""
    done = subprocess.run(
        [sys.executable, *arguments], capture_output=True, text=True, timeout=3000,
        env=os.environ | {"WARP_CACHE_PATH": str(cache)} | environment,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout


def contents(cache):
    """Every file of a cache with the time at which it was written."""
    return {str(path.relative_to(cache)): path.stat().st_mtime_ns for path in cache.rglob("*") if path.is_file()}


def is_kernel(node):
    """Whether a node of a syntax tree is a function that is declared as a kernel."""
    marks = node.decorator_list if isinstance(node, ast.FunctionDef) else []
    return any(ast.unparse(mark).startswith("wp.kernel") for mark in marks)


def test_every_kernel_is_of_a_module_that_is_known():
    """Those that the sources declare, by factories too; and each takes concrete types, or has declared overloads."""
    declared = set()
    for source in kernel_sources():
        path = Path(nuno.__file__).parent.joinpath(*source.split(".")[1:]).with_suffix(".py")
        declared |= {node.name for node in ast.walk(ast.parse(path.read_text())) if is_kernel(node)}
    kernels = [kernel for module in kernel_modules() for kernel in module.module.kernels.values()]
    assert {kernel.func.__name__ for kernel in kernels} == declared
    assert [kernel.key for kernel in kernels if kernel.is_generic and not kernel.overloads] == []


def test_devices_are_told_of_modules_that_there_are():
    """A name that has changed would leave a module out."""
    names = {module.name for module in kernel_modules()}
    assert names >= CPU_ONLY >= WHEN_NAMED
    assert all(any(name.startswith(beginning) for name in names) for beginning in CUDA_ONLY)
    assert all(module.blocks for module in kernel_modules() if "cuda" in module.devices)


def test_what_no_world_runs_is_compiled_only_by_name(monkeypatch):
    """Of worlds on the CPU those by a thread are left out: one world takes SIMD's plan, and a batch takes its lanes."""
    loaded = []
    monkeypatch.setattr("warp.load_module", lambda module, device: loaded.append(module.name))
    compile_kernels("cpu")
    expected = {module.name for module in kernel_modules() if "cpu" in module.devices}
    assert set(loaded) == expected - WHEN_NAMED
    world = nuno.World(device="cpu")
    cloth = world.add(nuno.sheet((0.1, 0.1), cells=(2, 2), position=(0, 0, 1)))
    world.attach(cloth)
    plans = [each.find(cloth.name)._dynamics.solver for each in (world, world.imagine(3))]
    assert [(made.plan, made.lanes > 1) for made in plans] == [("vector", False), ("fused", True)]
    compile_kernels("cpu", only=["nuno.plans.run_worlds"])
    assert loaded[-1] == "nuno.plans.run_worlds"


@pytest.mark.long
def test_names_in_the_cache_do_not_depend_on_what_was_imported_when(tmp_path):
    """Two processes that import in other orders: a name of another hash would be compiled again.

    The first does without any extra: `nuno compile` works where none is installed, as what declares kernels imports
    none.
    """
    told = """
import json, warp
warp.config.log_level = warp.LOG_ERROR
from nuno.kernels.kernel_modules import kernel_modules
print(json.dumps([each.module.get_module_identifier(block_dim=1) for each in kernel_modules()]))
"""
    bare = """
import sys
for name in ("gymnasium", "mujoco", "newton", "pinocchio", "matplotlib", "meshcat", "pytetwild", "pxr"):
    sys.modules[name] = None
"""
    first = run(tmp_path, "-c", bare + told, PYTHONHASHSEED="1")
    assert len(json.loads(first)) == len(kernel_modules())
    late = "import nuno.tasks.mat_sight, nuno.plans.cloth_worlds, nuno.plans.block_plan, nuno.camera.picture\n"
    assert run(tmp_path, "-c", late + told, PYTHONHASHSEED="2") == first


@pytest.mark.long
def test_cuda_is_compiled_for_without_a_device_and_once(tmp_path):
    """Machine code where Warp looks for it; a second time nothing in the folder changes."""
    command = ("-m", "nuno", "compile", "--arch", "sm_90", "--only", "nuno.state.finite", "nuno.camera.extent")
    told = run(tmp_path, *command)
    files = contents(tmp_path)
    made = sorted(Path(name).name for name in files if name.endswith(".cubin"))
    assert [name.rpartition("_")[0] for name in made] == ["wp_nuno.camera.extent", "wp_nuno.state.finite"]
    assert all(name.endswith(".sm90.cubin") for name in made)
    assert all(Path(name).parent.name == Path(name).name.partition(".sm90")[0] for name in files if "cubin" in name)
    assert told.startswith("2 modules of kernels for sm_90 in ") and str(tmp_path) in told
    run(tmp_path, *command)
    assert contents(tmp_path) == files


@pytest.mark.slow
def test_a_second_pick_compiles_nothing(tmp_path):
    """With an empty cache at first: the second process leaves the folder as it is."""
    command = ("-m", "nuno", "pick", str(CASE), "--device", "cpu", "--candidates", "2x2", "--out")
    run(tmp_path / "cache", *command, str(tmp_path / "first"))
    files = contents(tmp_path / "cache")
    run(tmp_path / "cache", *command, str(tmp_path / "second"))
    assert contents(tmp_path / "cache") == files


@pytest.mark.slow
def test_what_was_compiled_ahead_is_all_that_a_picture_needs(tmp_path):
    """Masks, depths, bodies and a picture by modules that were named: none gets another kernel, and so another name."""
    run(tmp_path, "-m", "nuno", "compile", "--only", "nuno.camera.raster", "nuno.camera.shading", "nuno.camera.extent")
    files = contents(tmp_path)
    code = """
import nuno
world = nuno.World(device="cpu")
box = world.add(nuno.box((0.2, 0.2, 0.2), position=(0, 0, 2)))
camera = nuno.Camera(32, 32, 30.0, 30.0, 15.5, 15.5)
world.masks(camera, box), world.depth(camera), world.ids(camera), nuno.take_picture(world, camera)
"""
    run(tmp_path, "-c", code)
    assert contents(tmp_path) == files


@pytest.mark.cuda
def test_a_device_takes_what_was_compiled_ahead(tmp_path):
    """Loading leaves the folder as it is."""
    run(tmp_path, "-m", "nuno", "compile", "--device", "cuda", "--only", "nuno.state.finite", "nuno.camera.raster")
    files = contents(tmp_path)
    code = """
import warp
from nuno.world.device import found_device
import nuno.camera.raster, nuno.state.pack
device = found_device("cuda")
for name in ("nuno.state.finite", "nuno.camera.raster"):
    warp.load_module(name, device=device)
"""
    run(tmp_path, "-c", code)
    assert contents(tmp_path) == files


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (dict(device="tpu"), "tpu"),
        (dict(device="cpu", arch="sm_90"), "sm_90"),
        (dict(device="cuda", arch="sm_1"), "sm_75, "),
        (dict(device="cuda", arch="hopper"), "hopper"),
        (dict(device="cpu", only=["nuno.plans.run_blocks"]), "run_blocks"),
    ],
)
def test_what_cannot_be_compiled_is_refused(arguments, told):
    """By name, before anything is compiled."""
    with pytest.raises(InvalidInputError, match=told):
        compile_kernels(**arguments)


def test_command_refuses_no_jobs(capsys):
    """Status 2."""
    assert main(["compile", "--jobs", "0"]) == 2
    assert "--jobs must be at least 1" in capsys.readouterr().err
