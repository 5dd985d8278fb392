"""The protocol of engines: names, capabilities, and refusals before anything changes."""

import re
from pathlib import Path

import numpy as np
import pytest

import nuno
from nuno.engines.engine import CAPABILITIES
from nuno.engines.engine_registry import engine_class, make_engine
from nuno.engines.engine_table import ENGINES, engines_with

DOCS = Path(__file__).parents[2] / "docs" / "engines.md"


def test_an_unknown_engine_is_refused_with_the_names_that_there_are():
    """The error lists them and guesses what was meant; imagine refuses as World does."""
    with pytest.raises(nuno.UnknownNameError, match=r"mujoco, .*nuno.*did you mean 'mujoco'"):
        nuno.World(engine="mujco")
    world = nuno.World(device="cpu")
    with pytest.raises(nuno.UnknownNameError):
        world.imagine(2, engine="odd")
    with pytest.raises(nuno.UnknownNameError):
        nuno.World(engine=3)


def test_the_default_engine_has_all_capabilities():
    """Nuno's own is what the others are measured by; all other capabilities have names of the table."""
    assert nuno.World(device="cpu").engine.name == "nuno"
    assert nuno.engine_capabilities("nuno") == set(CAPABILITIES)
    for name in ENGINES:
        assert engine_class(name).name == name
        assert nuno.engine_capabilities(name) <= set(CAPABILITIES)


def test_the_docs_have_the_table_of_capabilities():
    """The table in docs/engines.md says of each engine exactly what it tells of itself."""
    rows = [line for line in DOCS.read_text(encoding="utf-8").splitlines() if line.startswith("| ")]
    head = next(row for row in rows if row.startswith("| capability"))
    engines = [cell.strip().strip("`") for cell in head.strip("|").split("|")][2:]
    assert set(engines) == set(ENGINES)
    told = {}
    for row in rows[rows.index(head) + 1 :]:
        cells = [cell.strip() for cell in row.strip("|").split("|")]
        if len(cells) == len(engines) + 2 and cells[0] in CAPABILITIES:
            told[cells[0]] = [cell == "yes" for cell in cells[2:]]
    assert told == {name: [name in nuno.engine_capabilities(engine) for engine in engines] for name in CAPABILITIES}


@pytest.fixture
def with_newton(monkeypatch):
    """Newton as if it were installed, for what refuses before anything of it runs.

    `pytest.importorskip` does not tell: the folder of its tests, which is on the path, counts as a package of its name.
    """
    monkeypatch.setattr("nuno.engines.newton.newton_engine.find_spec", lambda name: True)


@pytest.mark.usefixtures("with_newton")
def test_what_an_engine_lacks_is_refused_by_name_and_names_those_that_have_it():
    """The message has the engine, the capability and the engines that have it, and so have the attributes."""
    world = nuno.World(device="cpu", engine="newton")
    ball = world.add(nuno.sphere(0.05, name="ball", position=(0.0, 0.0, 1.0)))
    world.attach(ball)
    with pytest.raises(nuno.EngineCapabilityError) as caught:
        world.grip(ball, to=ball.position, max_force=5.0)
    assert re.match(r"newton has no limited welds and joints; engines that have: nuno, mujoco", str(caught.value))
    assert (caught.value.engine, caught.value.capability) == ("newton", "limited welds and joints")
    assert caught.value.others == engines_with("limited welds and joints")
    assert ball._dynamics.grips == []  # nothing holds it


@pytest.mark.usefixtures("with_newton")
def test_a_world_that_an_engine_lacks_something_for_is_not_imagined_there():
    """Newton has no joints here; the world that was to be imagined stays as it is."""
    world = nuno.World(device="cpu")
    box = world.attach(world.add(nuno.box((0.1, 0.1, 0.1), position=(0.0, 0.0, 0.5))))
    nuno.ball_joint(box, None, point=(0.0, 0.0, 0.6), limit=0.5)
    before = np.array(box.position)
    with pytest.raises(nuno.EngineCapabilityError, match="ball joints"):
        world.imagine(2, engine="newton")
    np.testing.assert_array_equal(box.position, before)
    world.set_velocity(box, (0.1, 0.0, 0.0))
    world.run(0.1)
    assert box.position[0] > before[0]


@pytest.mark.long
@pytest.mark.usefixtures("with_newton")
def test_dynamics_of_a_robot_are_refused_before_it_enters_the_world():
    """Newton has no joints here; neither bodies nor a driver are left in the world."""
    pytest.importorskip("pinocchio")
    world = nuno.World(device="cpu", engine="newton")
    match = "newton has no robots with dynamics; engines that have: nuno, mujoco"
    with pytest.raises(nuno.EngineCapabilityError, match=match):
        nuno.SimulatedRobot(nuno.Humanoid("talos"), world, dynamics=True)
    assert not world.bodies and not world.drivers


def test_a_device_that_an_engine_does_not_run_on_is_refused():
    """MuJoCo runs on the CPU."""
    pytest.importorskip("mujoco", minversion="4.0")
    world = nuno.World(device="cpu")
    with pytest.raises(nuno.EngineCapabilityError, match="mujoco has no cuda"):
        make_engine("mujoco", world, "cuda:0", world.engine.rules)
