"""docs/extending.md: its examples fit the sources, take four files each, and work in all plans."""

import ast
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
TITLES = {"constraint": "A constraint of cloths", "shape": "A shape by formula"}
PAGE = (ROOT / "docs/extending.md").read_text("utf-8")


def steps(name):
    """Return an example's steps: file, text before, text after."""
    section = re.search(rf"^## {TITLES[name]}\n(.*?)(?=^## |\Z)", PAGE, re.M | re.S)
    for block in re.findall(r"^```diff\n(.*?)^```", section.group(1), re.M | re.S):
        head, *lines = block.splitlines()
        before, after = ("\n".join(line[1:] for line in lines if line[:1] != sign) for sign in "+-")
        yield head.removeprefix("# "), before, after


def extend(folder, name):
    """Write the sources as an example changes them, and return the files that it changed."""
    shutil.copytree(ROOT / "src", folder / "src", ignore=shutil.ignore_patterns("__pycache__"))
    changed = set()
    for place, before, after in steps(name):
        path = folder / place
        if before.strip():
            text = path.read_text("utf-8")
            assert text.count(before) == 1, f"{place} has not once:\n{before}"
            path.write_text(text.replace(before, after), "utf-8")
        else:
            assert not path.exists()
            path.write_text(after + "\n", "utf-8")
        changed.add(path)
    return changed


@pytest.mark.parametrize("name", TITLES)
def test_an_example_fits_the_sources(name, tmp_path):
    """Each step finds its place once; no more than four files; what comes of it is Python."""
    changed = extend(tmp_path, name)
    assert len(changed) == 4
    for path in changed:
        text = path.read_text("utf-8")
        ast.parse(text)
        assert len(text.splitlines()) <= 400


def run(folder, program):
    """Run a program with the extended sources, where none of the tests' own settings count."""
    paths = os.pathsep.join(map(str, (folder / "src", ROOT / "tests")))
    done = subprocess.run(
        [sys.executable, "-c", program], env=os.environ | {"PYTHONPATH": paths}, text=True, capture_output=True,
        cwd=folder,
    )  # fmt: skip
    assert not done.returncode, done.stderr[-4000:]


AREA = """
import numpy as np
import nuno
from nuno.bodies.cloth_measures import elastic_energy
from nuno.solvers.cloth_solver import ClothSolver
from nuno.topology.cloth_topology import ClothTopology

cloth = ClothTopology.sheet((13, 9), (0.39, 0.27))
wide = cloth.rest * (1.1, 1.0, 1.0)
soft = dict(stretch_stiffness=1e-12, shear_stiffness=1e-12, bending_rigidity=0.0)
energy = elastic_energy(cloth, wide[None], nuno.Cloth(**soft, area_stiffness=500.0))[0]
np.testing.assert_allclose(energy, 0.5 * 500.0 * 0.1**2 * 0.39 * 0.27, rtol=1e-6)  # 1/2 k e^2 over the area


def found(plan, worlds, substeps, stiffness):
    x = np.repeat(wide[None], worlds, axis=0)
    made = ClothSolver(
        cloth, nuno.Cloth(stretch_stiffness=5.0, shear_stiffness=5.0, area_stiffness=stiffness), x, np.zeros_like(x),
        device="cpu", substeps=substeps, self_contact=False, plan=plan,
    )
    made.run(0.0, 0.1)
    return made.local_positions()[0]


for substeps in SUBSTEPS:
    expected = found("vector", 1, substeps, 50.0)
    assert np.abs(expected - found("vector", 1, substeps, 0.0)).max() > 1e-3
    assert np.abs(expected - found("vector", 1, substeps, np.full(117, 50.0))).max() == 0.0
    for plan, worlds in (("fused", 3), ("grid", 1)):
        np.testing.assert_array_equal(found(plan, worlds, substeps, 50.0), expected)
"""

PTX = """
import warp as wp
from nuno.kernels.kernel_modules import kernel_modules
from nuno.kernels.struct_references import pass_structs_by_reference

pass_structs_by_reference()
for each in kernel_modules():
    if each.name.rpartition(".")[2] in NAMES:
        wp.set_module_options({"block_dim": each.blocks[0], "mode": "debug"}, module=each.module)
        (made,) = wp.compile_aot_module(each.module, arch=90, use_ptx=True)
        assert ".entry" in made.read_text()
"""

TORUS = """
import numpy as np
import nuno
from nuno.solvers.cloth_solver import ClothSolver
from nuno.tables.colliders import Colliders
from nuno.topology.cloth_topology import ClothTopology

RADIUS, TUBE = 0.1, 0.03


def gap(points, body):
    x, y, z = np.moveaxis(np.asarray(points) - body.position, -1, 0)
    return np.hypot(np.hypot(x, y) - RADIUS, z) - TUBE


def found(plan, worlds, substeps):
    cloth = ClothTopology.sheet((40, 40), (0.4, 0.4))
    x = np.repeat((cloth.rest + (0.013, 0.0, 0.06))[None], worlds, axis=0)
    made = ClothSolver(
        cloth, nuno.Cloth(thickness=0.002), x, np.full_like(x, (0.0, 0.0, -8.0)), device="cpu", substeps=substeps,
        self_contact=False, plan=plan,
    )
    body = nuno.torus(RADIUS, TUBE)
    made.set_colliders(Colliders.from_bodies([body], worlds, "cpu"))
    made.run(0.0, 0.05)
    return made.local_positions()[0], gap(made.positions()[0], body)


for substeps in SUBSTEPS:
    expected, room = found("vector", 1, substeps)
    assert room.min() > 0.001 - 1e-5  # half the thickness, by a float's digits
    for plan, worlds in (("fused", 3), ("grid", 1)):
        np.testing.assert_array_equal(found(plan, worlds, substeps)[0], expected)
"""

ROOM = """
import numpy as np
import nuno

RADIUS, TUBE = 0.1, 0.03
world = nuno.World(device="cpu")
torus = world.add(nuno.torus(RADIUS, TUBE, position=(0.0, 0.0, TUBE), name="torus"))
world.add(nuno.plane())
mat = world.add(nuno.soft_box((0.4, 0.1, 0.04), (12, 4, 2), position=(0.0, 0.0, 0.1)))
ball = world.add(nuno.sphere(0.03, position=(0.0, 0.0, 0.3)))
world.attach(mat, nuno.Soft())
world.run(1.0)
apart = np.hypot(np.hypot(mat.vertices[:, 0], mat.vertices[:, 1]) - RADIUS, mat.vertices[:, 2] - TUBE) - TUBE
assert apart.min() > -1e-4 and mat.vertices[:, 2].min() > 0.04  # it lies on the torus
world.remove(mat)
world.attach(ball, nuno.Rigid())
world.run(1.0)
assert abs(ball.position[2] - 0.03) < 1e-3  # through the hole
above = nuno.Camera.look_at((0.0, 1e-3, 1.0), (0.0, 0.0, 0.0), 0.5)
seen = np.squeeze(np.asarray(world.masks(above, torus)))
assert seen.any() and not seen[238:243, 318:323].any()  # the hole is no part of its outline
for kind in KINDS:
    nuno.save_scene(world, "scene." + kind)
    again = nuno.load_scene("scene." + kind).bodies["torus"]
    assert type(again.shape).__name__ == "Torus" and again.shape == torus.shape
    np.testing.assert_allclose(again.position, torus.position, atol=1e-6)
nuno.Viewer(world)
"""


FLOATS, DOUBLES = 12, 36  # substeps a frame


@pytest.mark.parametrize(
    ("name", "substeps"),
    [
        pytest.param("constraint", FLOATS, marks=pytest.mark.long),
        pytest.param("constraint", DOUBLES, marks=pytest.mark.slow),
        pytest.param("shape", FLOATS, marks=pytest.mark.slow),
        pytest.param("shape", DOUBLES, marks=pytest.mark.slow),
    ],
)  # fmt: skip
def test_an_example_gives_the_same_bits_in_all_plans(name, substeps, tmp_path):
    """Area's energy is 1/2 k e^2, nothing comes into a torus at 8 m/s; one world, lanes and groups of blocks agree."""
    extend(tmp_path, name)
    run(tmp_path, f"SUBSTEPS = ({substeps},){AREA if name == 'constraint' else TORUS}")


@pytest.mark.slow
def test_a_torus_is_seen_touched_and_saved(tmp_path):
    """A soft mat lies on it, a ball falls through its hole, its outline has one, and a scene file gives it back."""
    extend(tmp_path, "shape")
    run(tmp_path, f"KINDS = ('xml', 'usda'){ROOM}")


@pytest.mark.slow
@pytest.mark.parametrize("name", TITLES)
def test_an_example_compiles_for_cuda(name, tmp_path):
    """Blocks and groups of blocks, in floats and doubles, to PTX for an H100."""
    extend(tmp_path, name)
    run(tmp_path, f"NAMES = ('run_blocks_shared', 'run_double_blocks', 'run_grid', 'run_double_grid'){PTX}")
