"""Hostile calls of every public name: each is refused by a named error before anything changes, or rightly taken.

`hostile_recipes` has a valid call of each, `hostile_values` what is put in the place of one argument, and which of it
an argument of that type must refuse.
"""

import copy
import logging
import pickle
import warnings

import numpy as np
import pytest

import nuno
from hostile_calls import (
    LONG,
    Callers,
    first_of,
    hostile_calls,
    is_named,
    is_of_robots,
    outcome,
    public_calls,
    state_of,
)
from hostile_recipes import CALLS
from hostile_values import VALUES, may_accept

EACH, EACH_OF_ROBOTS = 15, 7
"""Of the calls, every so many is made where all would take long: all arguments and all values come up."""
# Valid calls of which the recipe has no file, robot's sensor or the like
WITHOUT = {"segment_before", "segment_after",
           "read_case", "read_fold_case", "read_sweep", "load_scene", "Recording.load", "triangulate",
           "Viewer.remove_camera", "Viewer.remove_plot", "RobotInterface.read_wrench",
           "CalibrationBoard.find", "calibrate_camera", "camera_above_table", "capture_case", "take_capture",
           "UsbCamera", "find_marker"}  # fmt: skip


@pytest.fixture(autouse=True)
def silence(tmp_path, monkeypatch):
    """Warnings are for callers who mean it; files that a call writes go nowhere else."""
    monkeypatch.chdir(tmp_path)
    logging.disable(logging.CRITICAL)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield
    logging.disable(logging.NOTSET)


@pytest.fixture
def callers():
    """A scene, which is closed at the end."""
    made = Callers()
    yield made
    made.close()


def attack(callers, calls):
    """Make calls; return how many, and those that were raw, wrongly accepted, or changed the world as they failed."""
    made, raw, accepted, changed = 0, [], [], []
    before = state_of(callers.scene.world)
    for call in calls:
        found = outcome(callers, call)
        made += 1
        if found == "refused":
            if state_of(callers.scene.world) == before:
                continue
            changed.append(call[:3])
        elif found.startswith("raw"):
            raw.append((*call[:3], found))
        elif call[3]:
            accepted.append(call[:3])
        callers.renew()
        before = state_of(callers.scene.world)
    return made, raw, accepted, changed


def test_every_public_name_is_attacked():
    """Each function, class and method that takes arguments has a recipe, or a reason why it has none."""
    assert not [name for name in public_calls() if not is_named(name)]
    assert all(first_of(name) in CALLS or is_named(name) for name in CALLS)


def test_the_recipes_are_valid(callers):
    """Otherwise what is refused might be refused for another reason than the hostile value."""
    made, failed = 0, {}
    for name, recipe in CALLS.items():
        if recipe is None or name in LONG or name in WITHOUT or is_of_robots(name) or name.startswith("Viewer"):
            continue
        function, given = callers.prepared(name)
        try:
            function(**given)
        except Exception as error:
            failed[name] = repr(error)
        made += 1
        if name.startswith("World.") or "joint" in name or name in ("hinge", "slider"):
            callers.renew()
    assert made > 150 and not failed


def test_hostile_calls_are_refused(callers):
    """Some thousand calls: none ends in another's traceback, none is taken that must not be, none changes the world."""
    calls = [call for call in hostile_calls(name for name in CALLS if not is_of_robots(name)) if call[0] != "carry_mat"]
    made, raw, accepted, changed = attack(callers, calls[::EACH])
    assert made > 1000 and not raw and not accepted and not changed


@pytest.mark.parametrize(
    "first", [pytest.param(k, marks=pytest.mark.long if k < 4 else pytest.mark.slow) for k in range(1, EACH)]
)
def test_more_hostile_calls_are_refused(callers, first):
    """All others of them."""
    calls = [call for call in hostile_calls(name for name in CALLS if not is_of_robots(name)) if call[0] != "carry_mat"]
    _, raw, accepted, changed = attack(callers, calls[first::EACH])
    assert not raw and not accepted and not changed


@pytest.mark.parametrize(
    "first", [pytest.param(k, marks=pytest.mark.long if k < 4 else pytest.mark.slow) for k in range(EACH_OF_ROBOTS)]
)
def test_hostile_calls_to_robots_are_refused(callers, first):
    """Robots, their drivers and what plans for them."""
    pytest.importorskip("pinocchio")
    names = ["carry_mat", *(name for name in CALLS if is_of_robots(name))]
    made, raw, accepted, changed = attack(callers, list(hostile_calls(names))[first::EACH_OF_ROBOTS])
    assert made > 500 and not raw and not accepted and not changed


def test_the_attack_sees_what_it_looks_for(callers, monkeypatch):
    """A raw error, a wrongly accepted value and a changed world are found."""

    def broken(size, **options):
        callers.scene.world.remove("table") if "table" in [b.name for b in callers.scene.world.bodies] else None
        if size is None:
            raise AttributeError("raw")
        if isinstance(size, str):
            raise nuno.InvalidInputError("late")

    monkeypatch.setattr(nuno, "sphere", broken)
    calls = [("sphere", "size", "none", True), ("sphere", "size", "text", True), ("sphere", "size", "nan", True)]
    monkeypatch.setitem(CALLS, "sphere", {})
    _, raw, accepted, changed = attack(callers, calls)
    assert len(raw) == len(accepted) == len(changed) == 1
    assert "nan" not in may_accept("float | None", None) and "none" in may_accept("float | None", None)


NONSENSE = {
    "half a colour": lambda s: nuno.box((1, 1, 1), color=(1.0, 0.0)),
    "a colour of bytes": lambda s: nuno.box((1, 1, 1), color=(255, 0, 0)),
    "no colour": lambda s: nuno.box((1, 1, 1), color="blurple"),
    "a colour later": lambda s: setattr(s.table, "color", "blurple"),
    "a device that is not there": lambda s: nuno.World(device="cuda:99"),
    "no device": lambda s: nuno.World(device="tpu"),
    "a billion substeps": lambda s: nuno.World(device="cpu", substeps=10**9),
    "no substeps": lambda s: nuno.World(device="cpu", substeps=0),
    "a billion frames": lambda s: nuno.World(device="cpu", frame_rate=1e9),
    "a box of truth": lambda s: nuno.box((True, True, True)),
    "a box beyond the moon": lambda s: nuno.box((1e30, 1, 1)),
    "a box of atoms": lambda s: nuno.box((1e-30, 1, 1)),
    "a flat box": lambda s: nuno.box((0, 1, 1)),
    "triangle soup": lambda s: nuno.cloth_mesh(soup()),
    "an unused vertex": lambda s: nuno.cloth_mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [9, 9, 9]], [[0, 1, 2]]),
    "three faces at an edge": lambda s: nuno.cloth_mesh(
        [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1]], [[0, 1, 2], [0, 1, 3], [0, 1, 4]]
    ),
    "two equal tetrahedra": lambda s: nuno.soft_tetrahedra(
        [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 1, 2, 3], [0, 1, 2, 3]]
    ),
    "two empty masks": lambda s: nuno.similarity(np.zeros((8, 8), bool), np.zeros((8, 8), bool)),
    "probabilities": lambda s: nuno.similarity(np.full((8, 8), 0.1), np.ones((8, 8), bool)),
    "one vertex twice": lambda s: s.world.grip("towel", [1, 1], to=(0, 0, 1)),
    "no vertex": lambda s: s.world.grip("towel", [-1], to=(0, 0, 1)),
    "a vertex that is not there": lambda s: s.world.grip("towel", [99], to=(0, 0, 1)),
    "a body of a body": lambda s: nuno.compound([nuno.box((1, 1, 1))]),
    "parts of nothing": lambda s: nuno.compound(None),
    "a list as a preset": lambda s: nuno.Cloth.preset([]),
    "a number to call": lambda s: s.world.run(0.1, each_frame=3),
    "a camera of 200,000 px": lambda s: nuno.Camera(200_000, 200_000, 8, 8, 4, 4),
    "a copy of a world": lambda s: copy.copy(s.world),
    "a deep copy of a world": lambda s: copy.deepcopy(s.world),
    "a pickled world": lambda s: pickle.dumps(s.world),
    "a recording of nothing": lambda s: nuno.Recording(None),
    "a film of nothing": lambda s: nuno.Film.of(None),
    "elements of nothing": lambda s: nuno.elements(None),
    "a picture by nothing": lambda s: nuno.take_picture(s.world, None),
    "a path that goes back": lambda s: nuno.Path([1.0, 0.0], [(0, 0, 0), (0, 0, 1)]),
    "complex sizes": lambda s: nuno.box((1j, 1, 1)),
    "a quaternion of nothing": lambda s: nuno.box((1, 1, 1), quaternion=(0, 0, 0, 0)),
    "a million worlds of a million": lambda s: s.world.imagine(10**12),
}  # fmt: skip


def soup():
    """Return a square as an STL has it: each triangle with vertices of its own."""
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    return vertices, np.arange(6).reshape(2, 3)


@pytest.mark.parametrize("what", NONSENSE)
def test_nonsense_is_refused_before_anything_changes(callers, what):
    """Values of the right type that mean nothing."""
    before = state_of(callers.scene.world)
    with pytest.raises(nuno.NunoError) as raised:
        NONSENSE[what](callers.scene)
    assert len(str(raised.value)) > 20
    assert state_of(callers.scene.world) == before


def test_messages_are_short_and_say_what_was_received():
    """Also of what cannot be written."""

    class Shy:
        def __repr__(self):
            raise RuntimeError("no")

    for value in (Shy(), 10**5000, "x" * 10_000, [Shy()]):
        with pytest.raises(nuno.InvalidInputError) as raised:
            nuno.sphere(value)
        assert "radius must be" in str(raised.value) and len(str(raised.value)) < 400
    assert len(VALUES) > 30
