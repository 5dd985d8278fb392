"""Materials in MuJoCo, beside closed forms: what docs/engines.md says of their errors."""

import numpy as np
import pytest

import nuno

pytest.importorskip("mujoco", minversion="4.0")

# the cantilever's tip drop over its reach at G = w L^3 / B, from theta'' = -G (1 - s) cos(theta)
LOADS = (5.0, 7.0, 10.0, 15.0, 20.0)
RATIOS = (0.58572, 0.78857, 1.06680, 1.48432, 1.86393)


def flat_world():
    """A world of MuJoCo without a floor."""
    return nuno.World(device="cpu", engine="mujoco")


@pytest.mark.long
def test_a_cantilever_bends_as_its_rigidity_says():
    """The effective rigidity is within 4 % of the nominal at G = 7.3: the calibration is for small deflections."""
    length, cells, rigidity, density = 0.2, 20, 2e-3, 0.2
    step = length / cells
    world = flat_world()
    strip = world.add(nuno.sheet((length, 0.03), cells=(cells, 3), position=(0.5 * length, 0.0, 0.5)))
    world.attach(strip, nuno.Cloth(bending_rigidity=rigidity, area_density=density, air_drag=6.0))
    world.ignore_contact(strip, strip)
    start = strip.vertices
    held = np.flatnonzero(start[:, 0] < 1.5 * step)
    world.grip(strip, held, to=start[held].mean(axis=0))
    world.run(3.0)
    assert np.abs(strip.velocities).max() < 2e-3
    tip = strip.vertices[start[:, 0] > length - 1e-6].mean(axis=0)
    # two held columns clamp the strip halfway between them
    ratio = (0.5 - tip[2]) / (tip[0] - 0.5 * step)
    felt = np.exp(np.interp(np.log(ratio), np.log(RATIOS), np.log(LOADS)))
    assert density * 9.81 * (length - 0.5 * step) ** 3 / rigidity / felt == pytest.approx(1.0, abs=0.04)


def test_a_hanging_strip_is_as_long_as_its_stiffness_says():
    """Its tip comes down by w L^2 / (2 E t); 2 % for Green's strain, whose square counts."""
    length, stiffness = 0.3, 100.0
    world = flat_world()
    strip = world.add(nuno.sheet((length, 0.1), cells=(12, 4), position=(0.0, 0.0, 1.0)))
    strip.rotate(np.pi / 2.0, (0.0, 1.0, 0.0))
    world.attach(strip, nuno.Cloth(stretch_stiffness=stiffness, shear_stiffness=30.0, air_drag=20.0))
    world.ignore_contact(strip, strip)
    start = strip.vertices
    held = np.flatnonzero(start[:, 2] > start[:, 2].max() - 1e-6)
    world.grip(strip, held, to=start[held].mean(axis=0))
    world.run(1.0)
    longer = start[:, 2].min() - strip.vertices[start[:, 2] < start[:, 2].min() + 1e-6, 2].mean()
    assert longer == pytest.approx(0.2 * 9.81 * length**2 / (2.0 * stiffness), rel=0.02)
    # without a Poisson's ratio it keeps its width
    middle = np.abs(start[:, 2] - 1.0) < 1e-6
    assert np.ptp(strip.vertices[middle, 1]) == pytest.approx(0.1, abs=1e-6)


@pytest.mark.parametrize(("aspect", "expected"), [(1.0, 1.22), (2.0, 1.02)])
def test_the_calibration_of_bending_makes_up_for_what_the_mesh_lacks(aspect, expected):
    """Along warp: an exact cylinder stores the plate energy, and what it relaxes to is less by as much."""
    from nuno.engines.mujoco.mujoco_bending import bending_factors

    warp, weft = bending_factors(1.0, 1.0 / aspect)
    turned = bending_factors(1.0, aspect)
    # the same patch turned by a right angle
    np.testing.assert_allclose((warp, weft), turned[::-1], rtol=1e-6)
    assert warp == pytest.approx(expected, abs=0.01)


def test_hinges_are_those_that_mujoco_compiles():
    """Of an irregular patch of 18 triangles, each inner edge's matrix, to rounding."""
    import mujoco

    from nuno.engines.mujoco.mujoco_bending import BEND, _hinges
    from nuno.engines.mujoco.sheet_triangles import sheet_triangles

    elements, _ = sheet_triangles(3, 3)
    places = np.stack(
        [*(part.ravel() for part in np.meshgrid(1.3 * np.arange(4), 0.8 * np.arange(4))), np.zeros(16)], 1
    )
    places[:, :2] += np.random.default_rng(0).uniform(-0.1, 0.1, (16, 2))
    spec = mujoco.MjSpec()
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_DISCRETE
    for k, place in enumerate(places):
        body = spec.worldbody.add_body(name=f"v{k}", pos=place, mass=1.0, inertia=[1.0] * 3, explicitinertial=True)
        for axis in np.eye(3):
            body.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis)
    flex = spec.add_flex(name="patch", dim=2, radius=0.001)
    flex.vertbody, flex.elem = [f"v{k}" for k in range(16)], elements.ravel().tolist()
    flex.young, flex.poisson, flex.thickness, flex.elastic2d = 12.0, 0.0, 1.0, 1  # 1 N m
    model = spec.compile()
    inner = model.flex_edgeflap[:, 1] >= 0
    compiled = model.flex_bending.reshape(-1, BEND)[inner, :16].reshape(-1, 4, 4)

    def whole(ends, flaps, rows):
        found = np.zeros((16, 16))
        for own, row in zip(np.concatenate([ends, flaps], axis=1), rows.reshape(-1, 4, 4), strict=True):
            found[np.ix_(own, own)] += row
        return found

    expected = whole(model.flex_edge[inner], model.flex_edgeflap[inner], compiled)
    np.testing.assert_allclose(whole(*_hinges(places, elements)), expected, atol=1e-12)


def test_a_soft_cube_is_pressed_by_its_weight():
    """Its top comes down by rho g h^2 / (2 E), within 10 % on 3 cells, less its sideways hold on the floor."""
    world = flat_world()
    world.add(nuno.plane())
    cube = world.add(nuno.soft_box((0.1, 0.1, 0.1), cells=(3, 3, 3), position=(0.0, 0.0, 0.05)))
    world.attach(cube, nuno.Soft(density=500.0, youngs_modulus=2e4, poisson_ratio=0.0))
    world.run(1.0)
    pressed = 0.1 - np.ptp(cube.vertices[:, 2])
    assert pressed == pytest.approx(500.0 * 9.81 * 0.1**2 / (2.0 * 2e4), rel=0.1)
    assert cube.mass == pytest.approx(0.5)


def test_worlds_of_a_batch_have_their_own_moduli():
    """Twice Young's modulus is half the strain; the Poisson's ratio of one world is not that of another."""
    world = flat_world()
    world.add(nuno.plane())
    world.add(nuno.soft_box((0.1, 0.1, 0.1), cells=(2, 2, 2), position=(0.0, 0.0, 0.05), name="cube"))
    batch = world.imagine(3)
    batch.attach("cube", nuno.Soft(density=500.0, youngs_modulus=np.array([2e4, 4e4, 2e4]),
                                   poisson_ratio=np.array([0.0, 0.0, 0.4])))  # fmt: skip
    batch.run(1.0)
    vertices = batch.find("cube").vertices
    pressed = 0.1 - np.ptp(vertices[:, :, 2], axis=1)
    assert pressed[0] / pressed[1] == pytest.approx(2.0, rel=0.02)
    wider = np.ptp(vertices[:, :, 0], axis=1) - 0.1
    assert wider[2] > 2.0 * abs(wider[0])


@pytest.mark.parametrize("touches", [True, False])
def test_parts_of_a_soft_body_touch_where_its_material_asks_for_it(touches):
    """Two slabs of one body, 20 mm thick: the upper one falls on the lower one, or through it, to 0.1 mm."""
    vertices, tetrahedra = (np.asarray(part) for part in nuno.box_tetrahedra((0.1, 0.1, 0.02), (3, 3, 1)))
    count = len(vertices)
    both = np.concatenate([vertices + np.array((0.0, 0.0, z)) for z in (0.011, 0.035)])
    world = nuno.World(device="cpu", engine="mujoco")
    world.add(nuno.plane())
    slabs = world.add(nuno.soft_tetrahedra(both, np.concatenate([tetrahedra, tetrahedra + count])))
    world.attach(slabs, nuno.Soft(density=200.0, youngs_modulus=1e5, damping=0.02, self_contact=touches))
    world.run(0.4)
    assert slabs.vertices[:count, 2].min() == pytest.approx(0.0, abs=1e-4)
    assert slabs.vertices[count:, 2].min() == pytest.approx(0.02 if touches else 0.0, abs=1e-4)


def test_a_cloth_bends_alike_after_a_soft_body():
    """Its numbers are read where its own edges are, whatever was added before it: the same bits."""
    tips = []
    for soft_first in (False, True):
        world = nuno.World(device="cpu", engine="mujoco")
        kinds = ("soft", "cloth") if soft_first else ("cloth", "soft")
        for kind in kinds:
            if kind == "soft":
                soft = world.add(nuno.soft_box((0.1, 0.1, 0.1), cells=(1, 1, 1), position=(5.0, 0.0, 1.0)))
                world.attach(soft, nuno.Soft(youngs_modulus=5e4))
                continue
            cloth = world.add(nuno.sheet((0.3, 0.1), cells=(6, 2), name="cloth", position=(0.0, 0.0, 1.0)))
            world.attach(cloth, nuno.Cloth(bending_rigidity=1e-3, air_drag=3.0))
            world.grip(cloth, [0, 7, 14], to=cloth.vertices[[0, 7, 14]].mean(axis=0))
        world.run(0.1)
        tips.append(world.find("cloth").vertices[6])
    np.testing.assert_allclose(tips[1], tips[0], atol=1e-12)
