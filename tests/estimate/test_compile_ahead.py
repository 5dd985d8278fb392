"""Kernels compiled ahead: all that an estimate launches on the CPU, and what goes wrong comes to light."""

import numpy as np
import pytest
import warp as wp

from nuno.camera import raster
from nuno.camera.camera import Camera
from nuno.camera.rectangle import ClothRectangle
from nuno.camera.table import Table
from nuno.estimate import compile_ahead
from nuno.estimate.futures import imagine_picks
from nuno.estimate.hypotheses import HYPOTHESES, Discretisation
from nuno.estimate.pick_sight import score_futures
from nuno.estimate.similarity import Silhouette


@pytest.fixture
def asked(monkeypatch):
    """The names of modules that were asked for, instead of loading them."""
    names = []
    monkeypatch.setattr(wp, "load_module", lambda module, device: names.append(module.name))
    return names


def test_what_an_estimate_launches_is_asked_for(asked, monkeypatch):
    """Every kernel of a small batch that is imagined, drawn and scored is in a module that is compiled ahead."""
    compile_ahead.compile_ahead("cpu")()
    ahead, launched, launch = set(asked), set(), wp.launch

    def watch(kernel, *arguments, **options):
        launched.add(kernel.module.name)
        return launch(kernel, *arguments, **options)

    monkeypatch.undo()
    monkeypatch.setattr(wp, "launch", watch)
    corners = np.array([(-0.1, -0.1, 0.002), (0.1, -0.1, 0.002), (0.1, 0.1, 0.002), (-0.1, 0.1, 0.002)])
    rectangle = ClothRectangle(corners, 0.2, 0.2, corners.mean(axis=0), 0.0, 0.0)
    futures = imagine_picks(
        rectangle, np.array([(0.0, 0.0), (1.0, 1.0)]), (2, 2), Discretisation(4, 8, HYPOTHESES[:1]), table=Table(0.0),
        hand=np.array((0.0, 0.0, 0.3)), rest_height=0.002, device="cpu", lift_seconds=0.1,
    )  # fmt: skip
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = np.diag((1.0, -1.0, -1.0)), (0.0, 0.0, 1.0)
    camera = Camera(80, 60, 60.0, 60.0, 39.5, 29.5, pose)
    score_futures(futures, camera, Silhouette(np.ones((60, 80), bool)), Table(0.0))
    assert launched >= {"nuno.plans.run_lanes", raster.__name__}
    assert launched <= ahead


def test_what_goes_wrong_is_raised_by_the_wait(monkeypatch):
    """An error of the compiler is not lost on its thread."""

    def fail(module, device):
        raise RuntimeError(f"no compiler for {module.name}")

    monkeypatch.setattr(wp, "load_module", fail)
    wait = compile_ahead.compile_ahead("cpu")
    with pytest.raises(RuntimeError, match="no compiler"):
        wait()


def test_nothing_is_compiled_ahead_on_cuda(asked):
    """What is compiled there depends on how many worlds there are."""
    compile_ahead.compile_ahead("cuda:0")()
    assert asked == []
