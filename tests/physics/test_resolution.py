"""The stiffness that comes out of a body's substeps, against the nominal one and against what ``resolution`` says."""

import logging

import numpy as np
import pytest
from triangles import rectangle
from world_with import attached, rows

import nuno
from nuno.constraints.relaxation import stiffness_share, sweeps_for
from nuno.solvers.cloth_substeps import default_substeps, wanted_substeps


def shear_under_traction(cells, h, stiffness, substeps=None, frame_rate=60.0):
    """Return the mean shear angle over the nominal one of a free square under equal tractions along its sides."""
    material = nuno.Cloth(shear_stiffness=stiffness, air_drag=20.0, bending_rigidity=1e-4)
    sheet = nuno.sheet((cells * h, cells * h), cells=(cells, cells), position=(0, 0, 1))
    world, body = attached(sheet, material, gravity=(0, 0, 0), substeps=substeps, frame_rate=frame_rate)
    traction = 0.001 * stiffness  # [N/m], so little that the square does not buckle
    share = np.full(cells + 1, traction * h)
    share[[0, -1]] *= 0.5
    force = np.zeros((cells + 1, cells + 1, 3))
    force[:, -1, 1] += share
    force[:, 0, 1] -= share
    force[-1, :, 0] += share
    force[0, :, 0] -= share
    world.push(body, force.reshape(-1, 3))
    world.run(1.0)
    x = rows(body)[0].reshape(cells + 1, cells + 1, 3)
    u = 0.5 * (x[:-1, 1:] - x[:-1, :-1] + x[1:, 1:] - x[1:, :-1]) / h
    v = 0.5 * (x[1:, :-1] - x[:-1, :-1] + x[1:, 1:] - x[:-1, 1:]) / h
    return (u * v).sum(axis=-1).mean() * stiffness / traction, body


@pytest.mark.parametrize(("cells", "h"), [(10, 0.02), (15, 0.02), (16, 0.01), (16, 0.005)])
def test_a_sheet_shears_as_its_stiffness_says_at_default_substeps(cells, h):
    """Closed form gamma = tau / S of pure shear, S = 300 N/m, without gravity, which is no reason for few substeps."""
    found, body = shear_under_traction(cells, h, 300.0)
    assert found == pytest.approx(1.0, abs=0.05)  # as docs/physics.md promises
    assert not body.resolution.capped and body.resolution.shear > 0.95


@pytest.mark.parametrize("substeps", [20, 60])
def test_one_plain_pass_shears_as_much_too_far_as_the_resolution_says(substeps):
    """Derived: a compliance of alpha + dt^2 D / 2 of elements with all neighbours; those at the rim are stiffer."""
    found, body = shear_under_traction(16, 0.02, 300.0, substeps)
    assert 1.0 <= 1.0 / found / body.resolution.shear < 1.25
    assert body.resolution.given and body.resolution.sweeps == 1


def pulled_mesh(angle, substeps=None, tension=12.5, cell=0.01, gravity=0.0, stiffness=1000.0, frame_rate=60.0):
    """Return the strain over the nominal one in the middle of a pulled strip of jittered triangles, and the body."""
    length, width = 0.24, 0.08
    points, faces = rectangle("jittered", (length, width), cell)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    hung = np.stack([np.zeros(len(points)), points[:, 1], -points[:, 0]], axis=1)
    strip = nuno.cloth_mesh(hung, faces, rest=points @ turn.T)
    material = nuno.Cloth(stretch_stiffness=stiffness, shear_stiffness=300.0, air_drag=15.0)
    world, body = attached(strip, material, gravity=(0, 0, -gravity), substeps=substeps, frame_rate=frame_rate)
    start = rows(body)[0]
    top, low = (np.flatnonzero(np.abs(points[:, 0] - end) < 1e-6) for end in (0.0, length))
    world.grip(body, top, to=start[top].mean(axis=0))
    order = low[np.argsort(points[low, 1])]
    y = points[order, 1]
    reach = np.concatenate([[y[0]], 0.5 * (y[1:] + y[:-1]), [y[-1]]])
    force = np.zeros_like(start)
    force[order, 2] = -tension * np.diff(reach)
    world.push(body, force)
    world.run(2.0)
    middle = np.abs(points[:, 0] - 0.5 * length) < 0.3 * length
    strain = np.polyfit(start[middle, 2], (rows(body)[0] - start)[middle, 2], 1)[0]
    c, s = np.cos(angle) ** 2, np.sin(angle) ** 2
    modulus = 1.0 / ((c**2 + s**2) / stiffness + c * s / 300.0)
    return strain * modulus / (tension + 0.2 * gravity * 0.5 * length), body


@pytest.mark.parametrize(
    ("angle", "cell", "gravity"),
    [(0.0, 0.02, 9.81), (np.pi / 4, 0.02, 0.0), pytest.param(0.0, 0.01, 0.0, marks=pytest.mark.long)],
)
def test_a_mesh_stretches_as_its_stiffness_says_at_default_substeps(angle, cell, gravity):
    """Closed form strain = T / E of an orthotropic membrane without Poisson effect, E by the angle of the pattern."""
    found, body = pulled_mesh(angle, cell=cell, gravity=gravity)
    assert found == pytest.approx(1.0, abs=0.05)  # as docs/physics.md promises
    assert body.resolution.least > 0.95


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["sheet", "mesh"])
def test_a_stiffness_fitted_at_one_cell_size_predicts_at_others(kind):
    """Promise: a value that fits what was seen at one cell size and step is the same cloth at others, within 10 %."""

    def compliance(value, cell, frame_rate):
        if kind == "sheet":
            return shear_under_traction(round(0.2 / cell), cell, value, frame_rate=frame_rate)[0] / value
        return pulled_mesh(0.0, cell=cell, stiffness=value, frame_rate=frame_rate)[0] / value

    seen, value = 1.0 / 250.0 if kind == "sheet" else 1.0 / 800.0, 500.0
    for _ in range(3):
        value *= compliance(value, 0.02, 60.0) / seen
    for cell, frame_rate in ((0.0125, 60.0), (0.01, 100.0)):
        assert compliance(value, cell, frame_rate) == pytest.approx(seen, rel=0.1)


def test_a_mesh_in_plain_passes_stretches_as_much_too_far_as_the_resolution_says():
    """Derived: a compliance of alpha + dt^2 D / 2 in the mean over the triangles; those at the rim are stiffer."""
    found, body = pulled_mesh(0.0, substeps=60, cell=0.02)
    assert 1.0 <= 1.0 / found / body.resolution.stretch < 1.25
    assert body.resolution.stretch < 0.8


@pytest.mark.parametrize(("share", "bears"), [(0.7, True), (1.3, False)])
def test_a_sheet_bears_the_tension_that_the_resolution_says(share, bears):
    """Derived: with a share of forces that turn a grid line is stable up to 9/8 rho h^2 / dt^2, an eighth more."""
    length, cells, stiffness = 0.3, 30, 5000.0
    sheet = nuno.sheet((length, 0.03), cells=(cells, 3), position=(0, 0, 1))
    material = nuno.Cloth(stretch_stiffness=stiffness, bending_rigidity=5e-6)
    world, body = attached(sheet, material, gravity=(0, 0, 0), substeps=40)
    tension = share * body.resolution.tension
    start = rows(body)[0]
    left, right = (np.flatnonzero(np.abs(start[:, 0] - x) < 1e-6) for x in (-0.5 * length, 0.5 * length))
    world.grip(body, left, to=start[left].mean(axis=0))
    end = start[right].mean(axis=0)
    path = nuno.Path(
        [0.0, 0.3], [end, end + np.array([length * tension / stiffness, 0, 0])], interpolation="minimum_jerk"
    )
    grip = world.grip(body, right, to=path)
    world.push(body, np.tile([0.0, 0.0, 1e-4], (len(start), 1)), duration=0.1)
    world.run(1.0)
    assert (abs(grip.wrench[0][0]) / 0.03 > 0.97 * tension) == bears


def borne(stiffness, tension, h, substeps=None):
    """Return the share of a tension [N/m] that a strip bears whose ends are drawn apart by its nominal strain."""
    length, cells = 0.3, (round(0.3 / h), 4)
    sheet = nuno.sheet((length, 4 * h), cells=cells, position=(0, 0, 1))
    world, body = attached(sheet, nuno.Cloth(stretch_stiffness=stiffness, air_drag=2.0), substeps=substeps)
    start = rows(body)[0]
    left, right = (np.flatnonzero(np.abs(start[:, 0] - x) < 1e-6) for x in (-0.5 * length, 0.5 * length))
    world.grip(body, left, to=start[left].mean(axis=0))
    end = start[right].mean(axis=0)
    drawn = end + np.array([length * tension / stiffness, 0.0, 0.0])
    grip = world.grip(body, right, to=nuno.Path([0.0, 0.5], [end, drawn], interpolation="minimum_jerk"))
    world.run(1.5)
    return abs(grip.wrench[0][0]) / (4 * h) / tension, body.resolution


@pytest.mark.parametrize("h", [0.01, 0.02])
@pytest.mark.parametrize(("stiffness", "tension"), [(1000.0, 200.0), (1000.0, 300.0), (5000.0, 800.0)])
def test_a_drawn_strip_bears_its_load_at_default_substeps(stiffness, tension, h):
    """Closed form T = E strain: up to 30 % of strain and 900 N/m the rule promises all of it."""
    found, resolution = borne(stiffness, tension, h)
    assert found == pytest.approx(1.0, abs=0.01) and resolution.tension >= tension


@pytest.mark.parametrize(("h", "substeps"), [(0.01, 40), (0.02, 25)])
def test_a_load_beyond_is_borne_with_as_many_substeps_as_the_resolution_says(h, substeps):
    """Closed form T = E strain of 1.7 times what is borne, 4 and 6 %: that goes with the square of the substeps."""
    load = 1.7 * borne(5000.0, 10.0, h, substeps)[1].tension
    assert borne(5000.0, load, h, substeps)[0] < 0.95  # this is what is told
    enough = int(np.ceil(substeps * np.sqrt(1.7)))
    assert borne(5000.0, load, h, enough)[0] == pytest.approx(1.0, abs=0.01)


@pytest.mark.slow
@pytest.mark.parametrize(("tension", "stiffness"), [(40.0, 5000.0), (200.0, 5000.0), (100.0, 1000.0)])
def test_a_strip_slips_over_a_drum_by_the_capstan_equation(tension, stiffness):
    """Closed form T2 / T0 = exp(mu pi) of half a turn, R = 50 mm, mu = 0.3, at default substeps."""
    radius, h, mu, across, free, width = 0.052, 0.01, 0.3, 3, 0.08, 0.03
    drum = nuno.cylinder(0.05, 0.2, friction=mu)
    drum.rotate(np.pi / 2, "x")
    half = np.pi * radius / 2 + free
    cells = 2 * round(half / h)
    sheet = nuno.sheet((2 * half, width), cells=(cells, across), position=(0, 0, radius))
    material = nuno.Cloth(stretch_stiffness=stiffness, friction=mu, bending_rigidity=5e-6, air_drag=2.0)
    world, body = attached(sheet, material, drum, gravity=(0, 0, 0))
    world.ignore_contact(body, body)
    world.set_friction(body, drum, 0.02)
    start = rows(body)[0]
    left, right = (np.flatnonzero(np.abs(start[:, 0] - x) < 1e-6) for x in (-half, half))
    times = np.linspace(0.0, 0.6, 41)
    angle = times / 0.6 * np.pi / 2
    x = radius * np.sin(angle) + (half - radius * angle) * np.cos(angle)
    z = radius * np.cos(angle) - (half - radius * angle) * np.sin(angle)
    flat = np.zeros_like(x)
    loose = world.grip(body, left, to=nuno.Path(times, np.stack([-x, flat, z], axis=1)))
    held = world.grip(body, right, to=nuno.Path(times, np.stack([x, flat, z], axis=1)))
    world.run(0.65)
    world.set_friction(body, drum, mu)
    loose.release()
    force = np.zeros_like(start)
    force[left, 2] = -tension * width / across * np.where(np.isin(np.arange(across + 1), (0, across)), 0.5, 1.0)
    for k in range(6):
        world.push(body, force * (k + 1) / 6)
        world.run(0.05)
    end = rows(body)[0][right].mean(axis=0)
    held.release()
    way = 0.04 + 0.8 * tension / stiffness  # what is free on this side stretches by 0.3 m T2 / k, too
    down = nuno.Path([world.time, world.time + 0.8], [end, end - [0, 0, way]])
    grip = world.grip(body, right, to=down)
    pulls = []
    for _ in range(48):
        world.step()
        pulls.append(abs(grip.wrench[0][2]) / width)
    assert np.mean(pulls[24:]) / tension == pytest.approx(np.exp(mu * np.pi), rel=0.05)


def test_resolution_says_what_was_chosen():
    """Promise: substeps chosen or given, the rule's wish, the bound; nothing for what is static or rigid."""
    world = nuno.World(device="cpu")
    box = world.add(nuno.box((0.1, 0.1, 0.1)))
    assert box.resolution is None
    assert world.attach(box).resolution is None
    cloth = world.attach(world.add(nuno.sheet((0.3, 0.3), cells=(15, 15), position=(0, 0, 1))))
    found = cloth.resolution
    assert not found.given and not found.capped and found.wanted == found.substeps
    assert found.sweeps > 1 and found.least > 0.95 and found.tension > 50.0
    world.detach(cloth)
    assert cloth.resolution is None


def test_ordinary_bodies_are_not_warned_of(caplog):
    """Promise: none at default substeps of every preset, a mesh and a soft cube, with and without gravity."""
    with caplog.at_level(logging.WARNING, logger="nuno"):
        for gravity in (0.0, 9.81):
            world = nuno.World(device="cpu", gravity=(0, 0, -gravity))
            for k, name in enumerate(nuno.Cloth.PRESETS):
                sheet = nuno.sheet((0.5, 0.5), cells=(25, 25), position=(k, 0, 1))
                world.attach(world.add(sheet), nuno.Cloth.preset(name))
            points, faces = rectangle("jittered", (0.2, 0.2), 0.02)
            flat = np.concatenate([points, np.zeros((len(points), 1))], axis=1)
            world.attach(world.add(nuno.cloth_mesh(flat, faces)))
            world.attach(world.add(nuno.soft_box((0.08, 0.08, 0.08), cells=(4, 4, 4))))
    assert not caplog.records


def test_too_few_substeps_are_told_once_with_the_cure(caplog):
    """Promise: one warning a body, by name, with what mends it; none for its copies."""
    world = nuno.World(device="cpu", substeps=12)
    towel = world.add(nuno.sheet((0.3, 0.3), cells=(30, 30), name="towel"))
    with caplog.at_level(logging.WARNING, logger="nuno"):
        world.attach(towel)
        world.set_material(towel, nuno.Cloth(shear_stiffness=299.0))
        futures = world.imagine(2)
        futures.set_material(futures.find("towel"), nuno.Cloth(shear_stiffness=301.0))
    assert len(caplog.records) == 1
    text = caplog.records[0].getMessage()
    for part in ("'towel'", "shear", "12 substeps", "World(substeps=None)", "coarser cells"):
        assert part in text


def test_a_bound_that_makes_a_body_softer_is_told(caplog):
    """Promise: a soft body and a sheet over the bound of the rule say so, and how many substeps would do."""
    world = nuno.World(device="cpu")
    with caplog.at_level(logging.WARNING, logger="nuno"):
        beam = world.add(nuno.soft_box((0.02, 0.02, 0.06), cells=(4, 4, 12), name="beam"))
        world.attach(beam, nuno.Soft(youngs_modulus=1e6))
        plate = world.add(nuno.sheet((0.1, 0.1), cells=(25, 25), name="plate"))
        world.attach(plate, nuno.Cloth(bending_rigidity=1e-2))
    assert [r.getMessage().split(" will")[0] for r in caplog.records] == ["'beam'", "'plate'"]
    for body in (beam, plate):
        assert body.resolution.capped and body.resolution.substeps == 240 < body.resolution.wanted
        assert any(f"World(substeps={body.resolution.wanted})" in r.getMessage() for r in caplog.records)
    assert beam.resolution.bending < 0.8 and plate.resolution.bending < 0.9


def test_a_copy_of_a_swept_cloth_goes_on_with_the_same_bits():
    """Invariant: sweeps leave nothing between substeps, so that imagined, saved and restored worlds are the world."""
    world = nuno.World(device="cpu")
    towel = world.add(nuno.sheet((0.3, 0.3), cells=(10, 10), position=(0, 0, 0.3), name="towel"))
    world.attach(towel)
    assert towel.resolution.sweeps > 1
    world.grip(towel, [0], to=towel.vertices[0])
    world.run(0.1)
    saved, futures = world.save(), world.imagine(3)
    world.run(0.1)
    futures.run(0.1)
    expected = towel.vertices
    for found in futures.find("towel").vertices:
        np.testing.assert_array_equal(found, expected)
    world.restore(saved)
    world.run(0.1)
    np.testing.assert_array_equal(towel.vertices, expected)


def test_the_rule_sees_shear_and_tension():
    """Without gravity dt goes with h, as q and a grid line's tension have it, and not to the fewest substeps."""
    from nuno.topology.cloth_topology import ClothTopology

    coarse, fine = (ClothTopology.sheet((n, n), (0.4, 0.4)) for n in (20, 40))
    frame = 1.0 / 60.0
    few = default_substeps(coarse, 0.0, frame)
    assert default_substeps(coarse, 0.0, frame, softening=1e8) > few
    assert default_substeps(coarse, 0.0, frame, stretch=1000.0) > few
    taut = [wanted_substeps(t, 0.0, frame, stretch=5000.0) for t in (coarse, fine)]
    assert taut[1] == pytest.approx(2 * taut[0], abs=1)


@pytest.mark.parametrize("q", [0.1, 0.3, 1.0, 2.0, 3.0])
def test_as_many_sweeps_as_are_chosen_meet_the_stiffness(q):
    """The law for uniform stress: within 5 % with the sweeps chosen, and 1 / (1 + q) in one plain pass."""
    assert stiffness_share(q, sweeps_for(q, False)) == pytest.approx(1.0, abs=0.05)
    assert stiffness_share(q, 0) == pytest.approx(1.0 / (1.0 + q), rel=1e-9)
