"""Newton behind the protocol of engines: what it moves against closed forms, and what it refuses by name."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import nuno
from nuno.engines.engine_registry import engine_class
from nuno.engines.newton.newton_model import membrane
from nuno.estimate.hypotheses import DISCRETISATIONS

GRAVITY = 9.81  # [m/s2]


def test_a_missing_package_is_named(monkeypatch):
    """The error names the extra, and the capabilities are told without the package."""
    import nuno.engines.newton.newton_engine as module

    monkeypatch.setattr(module, "find_spec", lambda name: None)
    with pytest.raises(nuno.MissingPackageError, match=r"newton.*\[newton\]"):
        nuno.World(device="cpu", engine="newton")
    assert "cloth" in engine_class("newton").capabilities


@pytest.mark.parametrize(("stretch", "shear"), [(1000.0, 450.0), (200.0, 90.0), (50.0, 25.0)])
def test_a_membrane_is_as_stiff_as_the_cloth(stretch, shear):
    """A plane membrane pulled one way has the stiffness 4 mu (lambda + mu) / (lambda + 2 mu), in shear mu."""
    values = nuno.Cloth(stretch_stiffness=stretch, shear_stiffness=shear).resolved(1, 1)
    mu, second = membrane(values)
    assert 4 * mu * (second + mu) / (second + 2 * mu) == pytest.approx(stretch)
    assert mu == pytest.approx(shear)


def test_a_membrane_keeps_the_stretch_where_shear_cannot_be_met():
    """The default cloth's shear of 300 N/m would ask for a Poisson ratio of 2/3; it gets 385 and 0.3."""
    mu, second = membrane(nuno.Cloth().resolved(1, 1))
    assert 4 * mu * (second + mu) / (second + 2 * mu) == pytest.approx(1000.0)
    assert mu == pytest.approx(1000.0 / 2.6)


newton = pytest.mark.slow  # SolverVBD's kernels take minutes to compile where they are not in Warp's cache
on_devices = pytest.mark.parametrize("device", ["cpu", pytest.param("cuda:0", marks=pytest.mark.cuda)])


@newton
@on_devices
def test_all_kinds_fall_alike(device):
    """Free fall by g t^2 / 2 of cloth, soft and rigid bodies; steps of dt fall short or too far by g t dt / 2."""
    pytest.importorskip("newton.solvers")
    world = nuno.World(device=device, engine="newton")
    bodies = [
        world.add(nuno.sheet((0.2, 0.2), (3, 3), name="cloth", position=(0, 0, 2))),
        world.add(nuno.soft_box((0.1, 0.1, 0.1), (1, 1, 1), name="soft", position=(1, 0, 2))),
        world.add(nuno.box((0.1, 0.2, 0.3), name="rigid", position=(2, 0, 2))),
    ]
    world.attach(bodies[0], nuno.Cloth(air_drag=0.0))
    world.attach(bodies[1])
    world.attach(bodies[2], velocity=(0.5, 0, 0), angular_velocity=(0, 0, 1.0))
    world.run(0.3)
    allowed = 0.5 * GRAVITY * 0.3 / (60 * world.bodies[0]._dynamics.substeps) + 1e-5
    for body in bodies:
        fallen = 2.0 - float(body.vertices[:, 2].mean())
        assert fallen == pytest.approx(0.5 * GRAVITY * 0.09, abs=allowed), body.name
    assert bodies[2].position[0] == pytest.approx(2.15, abs=1e-4)
    assert np.degrees(2 * np.arcsin(bodies[2].quaternion[3])) == pytest.approx(np.degrees(0.3), abs=0.1)


@newton
@on_devices
def test_a_box_slides_down_an_incline_as_coulomb_says(device):
    """Closed form a = g (sin - mu cos), within 3 %: contacts of finite stiffness, found anew every substep."""
    pytest.importorskip("newton.solvers")
    slope, mu = np.radians(30.0), 0.3
    world = nuno.World(device=device, engine="newton")
    world.add(nuno.box((2.0, 0.6, 0.1), name="ramp", friction=mu).rotate(slope, "y"))
    normal, down = np.array([np.sin(slope), 0, np.cos(slope)]), np.array([np.cos(slope), 0, -np.sin(slope)])
    box = world.add(nuno.box((0.1, 0.1, 0.04), position=0.07 * normal - 0.5 * down).rotate(slope, "y"))
    start = np.array(box.position)
    world.attach(box, nuno.Rigid(friction=mu))
    world.run(0.5)
    expected = 0.5 * GRAVITY * (np.sin(slope) - mu * np.cos(slope)) * 0.25
    assert (box.position - start) @ down == pytest.approx(expected, rel=0.03)


@newton
@on_devices
def test_worlds_of_a_batch_have_their_own_material_and_grips_lead_vertices(device):
    """A strip of half the stiffness stretches by twice as much, w L^2 / (2 E t); a grip's vertices are on its path."""
    pytest.importorskip("newton.solvers")
    world = nuno.World(device=device, engine="newton")
    strip = world.add(nuno.sheet((0.3, 0.05), (6, 1), name="strip", position=(0, 0, 1)).rotate(0.5 * np.pi, "y"))
    futures = world.imagine(2)
    strip = futures.find("strip")
    futures.ignore_contact(strip, strip)
    start = strip.vertices[0]
    top, low = np.flatnonzero(start[:, 2] > 1.149), np.flatnonzero(start[:, 2] < 0.851)
    stiffness = np.array([30.0, 15.0])
    futures.attach(strip, nuno.Cloth(stretch_stiffness=stiffness, shear_stiffness=0.5 * stiffness, air_drag=6.0))
    goal = start[top].mean(axis=0)
    raised = goal + np.array([0.0, 0.0, 0.05])
    futures.grip(strip, top, to=nuno.Path([0.0, 0.5], [goal, raised], interpolation="minimum_jerk"))
    futures.run(2.0)
    ends = strip.vertices
    assert ends[:, top].mean(axis=1) == pytest.approx(np.stack([raised, raised]), abs=1e-5)
    found = start[low, 2].mean() + 0.05 - ends[:, low, 2].mean(axis=1)
    # lumped masses and a strain of 3 and 6 %, at which the membrane is not Hooke's any more
    assert found == pytest.approx(0.2 * GRAVITY * 0.09 / (2 * stiffness), rel=0.06)


@newton
@on_devices
def test_attaching_and_detaching_carries_the_state_over(device):
    """A box that is attached while another falls changes nothing of the other; a detached one stays where it is."""
    pytest.importorskip("newton.solvers")

    def falling(with_other):
        world = nuno.World(device=device, engine="newton")
        ball = world.attach(world.add(nuno.sphere(0.05, position=(0, 0, 2))))
        box = world.add(nuno.box((0.1, 0.1, 0.1), position=(1, 0, 1)))
        world.run(0.1)
        if with_other:
            world.attach(box)
        world.run(0.1)
        if with_other:
            world.detach(box)
            before = box.position[2]
        world.run(0.1)
        if with_other:
            assert box.position[2] == before < 1.0
        return ball.position

    # coordinates have another origin with the box; SolverVBD reads velocities off floats, and the last digit of half a
    # metre, 6e-8 m in a substep of 0.4 ms, is 0.15 mm/s: 720 of them, at random, make 1 mm in 0.3 s
    assert falling(True) == pytest.approx(falling(False), abs=1e-3)


@newton
def test_a_recorded_frame_copies_nothing_from_the_host(monkeypatch):
    """CUDA replays a recorded copy from where the host's array was; a box once slid 2 mm instead of 424 by that."""
    pytest.importorskip("newton.solvers")
    from nuno.engines.newton.newton_substeps import NewtonSubsteps

    recorded, found = [], []
    go, kept = NewtonSubsteps._go, NewtonSubsteps._kept

    def watched(self, *args):
        recorded.append(True)
        go(self, *args)
        recorded.pop()

    def told(self, name, *args):
        found.append((name, bool(recorded)))
        return kept(self, name, *args)

    monkeypatch.setattr(NewtonSubsteps, "_go", watched)
    monkeypatch.setattr(NewtonSubsteps, "_kept", told)
    world = nuno.World(device="cpu", engine="newton")
    world.attach(world.add(nuno.sphere(0.05, position=(0, 0, 2))))
    world.run(0.05)
    assert {name for name, _ in found} >= {"drag", "body drag"} and not any(during for _, during in found)


@newton
def test_what_newton_lacks_is_refused_before_anything_changes():
    """By name, with the engines that have it; the body is static as before."""
    pytest.importorskip("newton.solvers")
    world = nuno.World(device="cpu", engine="newton")
    box, other = (world.add(nuno.box((0.1, 0.1, 0.1), position=(k, 0, 1))) for k in range(2))
    with pytest.raises(nuno.EngineCapabilityError, match="newton has no restitution; engines that have: nuno"):
        world.attach(box, nuno.Rigid(restitution=0.5))
    assert not box.is_dynamic
    world.attach(box)
    with pytest.raises(nuno.EngineCapabilityError, match="pair friction"):
        world.set_friction(box, other, 0.2)
    with pytest.raises(nuno.EngineCapabilityError, match="newton has no"):
        nuno.hinge(box, other, point=(0.5, 0, 1), axis=(0, 0, 1))


@newton
def test_newton_tells_the_same_corner_as_nuno():
    """Newton says that the example's cloth was picked at the corner (0, 0), on a coarse mesh and one guess."""
    pytest.importorskip("newton.solvers")
    coarse = replace(DISCRETISATIONS[0], cells=8, hypotheses=DISCRETISATIONS[0].hypotheses[:1])
    case = nuno.read_case(Path(__file__).parents[3] / "examples" / "pick-case")
    found = case.estimate(candidates=(2, 2), engine="newton", discretisations=[coarse], device="cpu", progress=False)
    assert found.best == (0, 0)
