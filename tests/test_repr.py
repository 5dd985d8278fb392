"""What a program prints of a thing fits on a line, and says what it is."""

import numpy as np
import pytest

import nuno


@pytest.fixture
def world():
    """A table and a towel."""
    world = nuno.World(device="cpu")
    world.add(nuno.box((1, 1, 0.02), name="table", position=(0, 0, 0.7)))
    world.add(nuno.sheet((0.3, 0.2), cells=(3, 2), name="towel", position=(0.1, -0.2, 0.72)))
    return world


def test_world_and_bodies(world):
    """Name, kind, place, and whether it moves."""
    assert repr(world) == "<World at t = 0.000 s, 2 bodies>"
    assert repr(world.find("towel")) == "<sheet 'towel' at (0.100, -0.200, 0.720) m, static>"
    assert "36 worlds" in repr(world.imagine(36))


def test_a_snapshot_is_not_spelled_out(world):
    """A world of many vertices has a snapshot of one line."""
    assert repr(world.save()) == "<Snapshot at t = 0.000 s, 2 bodies, 0 of them dynamic>"


def test_a_body_in_a_batch(world):
    """Places that differ by world are counted."""
    futures = world.imagine(2)
    towel = futures.find("towel")
    towel.locate(np.array([(0.0, 0.0, 0.8), (0.0, 0.0, 0.9)]))
    assert repr(towel) == "<sheet 'towel' in 2 worlds, static>"


def test_cases():
    """A case with its images fits on a line."""
    from pathlib import Path

    examples = Path(__file__).parents[1] / "examples"
    pick, fold = nuno.read_case(examples / "pick-case"), nuno.read_fold_case(examples / "fold-case")
    assert repr(pick).startswith("<PickCase: two images of 640 x 480 px, table at ")
    assert repr(fold) == "<FoldCase: 113 frames, 14 images of 320 x 240 px, 2 hands>"
