"""Whole-body control: what linear systems find is what the quadratic program finds, in any number of worlds."""

import daqp
import numpy as np
import pytest

import nuno
from nuno.robot import whole_body
from nuno.robot.whole_body import WholeBodyControl


class Programs:
    """Tasks, contacts, masses and forces of some worlds, as ``WholeBodyControl._minimised`` takes them.

    Every row of the tasks is wanted to go by up to ``pull`` [m/s2].
    """

    def __init__(self, robot, worlds, pull):
        rng = np.random.default_rng(0)
        n = robot.model.nv
        tasks, wanted = rng.normal(size=(worlds, n + 12, n)), rng.uniform(-pull, pull, size=(worlds, n + 12, 1))
        self.hessians, self.linears = tasks.swapaxes(1, 2) @ tasks, -(tasks.swapaxes(1, 2) @ wanted)[:, :, 0]
        self.touching = rng.normal(size=(worlds, 2, 4, 3, n))
        half = rng.normal(size=(worlds, n, n))
        self.mass = half @ half.swapaxes(1, 2) + np.eye(n)
        self.bias = np.zeros((worlds, n))
        self.bias[:, 2] = 9.81 * robot.mass
        # feet bear both, one, and none
        self.bears = np.array([(True, True), (True, False), (False, False)])[np.arange(worlds) % 3]

    def of(self, rows):
        """Return the arguments in some of the worlds."""
        parts = self.hessians, self.linears, self.touching, self.bears, self.mass, self.bias
        return tuple(part[rows] for part in parts)


@pytest.fixture(scope="module")
def talos():
    """Talos."""
    return nuno.Humanoid("talos")


def without_limits(talos):
    """Return the control of a robot whose friction and efforts have no limits that bind."""
    control = WholeBodyControl(talos)
    control._efforts = np.full(len(control._efforts), 1e9)
    control._pyramid = np.zeros_like(control._pyramid)
    return control


def test_without_a_limit_that_binds_it_is_what_the_program_finds(talos, monkeypatch):
    """Accelerations and torques of the linear systems are those of DAQP, which keeps its equalities to 1e-6."""
    control, programs = without_limits(talos), Programs(talos, 6, 1.0)
    found, motions, efforts = control._minimised(*programs.of(slice(None)))
    assert found.all()
    monkeypatch.setattr(
        WholeBodyControl, "_unbounded",
        lambda self, *parts: (np.zeros(6, dtype=bool), np.zeros_like(motions), np.zeros_like(efforts)),
    )  # fmt: skip
    known, others, torques = control._minimised(*programs.of(slice(None)))
    assert known.all()
    np.testing.assert_allclose(motions, others, atol=1e-6 * np.abs(others).max())
    np.testing.assert_allclose(efforts, torques, atol=1e-6 * np.abs(torques).max())


def test_where_a_limit_binds_the_program_is_solved(talos, monkeypatch):
    """Efforts above a motor's limit are found nowhere: only such worlds go to DAQP, which keeps to the limits."""
    control, programs = without_limits(talos), Programs(talos, 6, 1.0)
    _, _, free = control._minimised(*programs.of(slice(None)))
    most = np.abs(free).max(axis=1)
    control._efforts[:] = np.sort(most)[2] * (1.0 + 1e-9)
    asked = []
    solve = daqp.solve
    monkeypatch.setattr(whole_body.daqp, "solve", lambda *parts, **options: asked.append(1) or solve(*parts, **options))
    found, _, efforts = control._minimised(*programs.of(slice(None)))
    assert len(asked) == 3
    assert (np.abs(efforts[found]) <= control._efforts * (1.0 + 1e-6)).all()
    np.testing.assert_array_equal(efforts[np.argsort(most)[:3]], free[np.argsort(most)[:3]])


def test_a_world_of_a_batch_is_what_it_is_alone(talos):
    """Found by linear systems or by the program, a world of six has the bits that it has by itself."""
    control, programs = without_limits(talos), Programs(talos, 6, 1.0)
    _, _, free = control._minimised(*programs.of(slice(None)))
    control._efforts[:] = np.median(np.abs(free).max(axis=1))
    together = control._minimised(*programs.of(slice(None)))
    for k in range(6):
        for one, every in zip(control._minimised(*programs.of(slice(k, k + 1))), together, strict=True):
            np.testing.assert_array_equal(one[0], every[k])
