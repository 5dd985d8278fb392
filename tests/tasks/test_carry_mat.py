"""Carrying a mat: which ways of holding it do, what is measured, and what is refused."""

import csv
import json

import numpy as np
import pytest

import nuno
from nuno.robot.humanoid import Humanoid
from nuno.tasks import carry_mat as module
from nuno.tasks.carry_mat import carry_mat

DISTANCES = (0.3, 0.36)
FEW = dict(offsets_x=(0.1,), offsets_y=(0.0, 0.24), settle=1.0, seconds=1.0, device="cpu")


@pytest.fixture(scope="module")
def result(talos, glides):
    """Return four trials with a robot that stays where it is; in two the mat's centre is beside both arms."""
    mat = nuno.soft_box((0.6, 0.4, 0.02), cells=(9, 6, 3))
    return carry_mat(talos, mat, arm_distances=DISTANCES, walks=glides(DISTANCES), **FEW)


@pytest.mark.long
def test_a_mat_falls_where_its_middle_is_beside_the_arms(result):
    """Statics: a body stays on two supports if its centre of gravity is between them, and else tips over."""
    assert [trial.offset_y for trial in result.trials] == [0.0, 0.24, 0.0, 0.24]
    assert result.failed.tolist() == [False, True, False, True]
    fallen = result.trials[1]
    assert "lost contact with" in fallen.reason or "fell" in fallen.reason
    assert fallen.value is None and -FEW["settle"] <= fallen.failed_at < 0.0  # as it was laid down


@pytest.mark.long
def test_a_robot_that_stands_carries_steadily(result):
    """Nothing moves, so the mean is where it was: what is left is the mat's settling, under 2 mm in the mean."""
    assert np.nanmax(result.values) < 2e-3 * FEW["seconds"]
    assert result.best in (0, 2)


@pytest.mark.long
def test_a_mat_without_friction_is_left_behind(talos, glides, mat):
    """Newton: nothing pulls a mat along the arms but friction; nothing is gripped or glued.

    Without friction nothing holds it on arms that slope either, so that it may be lost while it is let down (time 0).
    """
    trials = {}
    for mu in (0.0, 0.8):
        material = nuno.Soft(density=60.0, youngs_modulus=5e3, poisson_ratio=0.25, friction=mu, air_drag=1.0)
        found = carry_mat(
            talos, mat, material, arm_distances=[0.34], offsets_x=[0.12], offsets_y=[0.0], settle=1.0, seconds=2.0,
            walks=glides([0.34], 1.5, (-0.5, 0.0, 0.0)), arm_friction=mu, device="cpu",
        )  # fmt: skip
        trials[mu] = found.trials[0]
    assert trials[0.0].value is None and trials[0.0].reason.startswith("lost contact")
    assert trials[0.8].reason == ""


@pytest.mark.long
def test_hands_that_grip_need_no_friction(talos, glides, mat):
    """Gripped edges carry a mat that would slide off: the comparison that hold="grip" is for."""
    material = nuno.Soft(density=60.0, youngs_modulus=5e3, poisson_ratio=0.25, friction=0.0, air_drag=1.0)
    found = carry_mat(
        talos, mat, material, hold="grip", arm_distances=[0.34], offsets_x=[0.12], offsets_y=[0.0], settle=1.0,
        seconds=2.0, walks=glides([0.34], 1.5, (-0.5, 0.0, 0.0)), arm_friction=0.0, device="cpu",
    )  # fmt: skip
    assert found.trials[0].reason == ""


@pytest.mark.long
def test_a_cloth_is_carried_too(talos, glides):
    """A cloth mat lies on the arms by friction alone."""
    cloth = nuno.sheet((0.6, 0.4), cells=(18, 12))
    found = carry_mat(
        talos, cloth, arm_distances=[0.34], offsets_x=[0.12], offsets_y=[0.0], settle=1.0, seconds=1.0,
        walks=glides([0.34], 1.0, (0.1, 0.0, 0.0)), device="cpu",
    )  # fmt: skip
    assert found.trials[0].reason == ""


@pytest.mark.long
def test_files_hold_what_the_result_holds(result, tmp_path):
    """The table, the CSV and the JSON name every trial, and the JSON has no NaN."""
    result.save(tmp_path, pictures=False)
    data = json.loads((tmp_path / "result.json").read_text())
    with open(tmp_path / "trials.csv", newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert len(rows) == len(data["trials"]) == 4
    assert data["failed"] == 2 and data["best"] == result.best
    assert float(rows[0]["value"]) == data["trials"][0]["value"] == result.trials[0].value
    assert rows[1]["value"] == "" and rows[1]["reason"] == result.trials[1].reason
    assert result.table().count("x -") == 2


@pytest.mark.long
def test_a_replay_is_what_was_measured(result):
    """Promise of a batch: world k is what it is alone, to the bit; so F can be taken from the replay."""
    times = np.arange(0.0, 1.0 + 1e-9, 1.0 / 60.0)
    vertices = result.replay(0, times)
    deviation = np.linalg.norm(vertices.mean(axis=1) - vertices[0].mean(axis=0), axis=1)  # the robot stands
    value = np.sum(0.5 * (deviation[1:] + deviation[:-1])) / 60.0
    assert value == pytest.approx(result.trials[0].value, rel=1e-3)  # means in float32 on the device


@pytest.mark.long
def test_a_picture_shows_robot_and_mat(result):
    """Both outcomes have their strip, and the parameters a plot."""
    for trial in (result.best, result.telling_failure):
        figure = result.strip(trial, count=2)
        image = np.asarray(figure.axes[0].images[0].get_array())
        blue = (image[..., 2].astype(int) - image[..., 0] > 30).sum()
        assert 500 < blue < 40000  # the mat, and something besides
    assert len(result.figure().axes) == 1


@pytest.mark.long
def test_finished_trials_are_not_run_again(talos, glides, mat, tmp_path, monkeypatch):
    """A results file that is complete answers without a simulation, with the same numbers."""
    given = dict(arm_distances=DISTANCES, walks=glides(DISTANCES), results=tmp_path / "carry.jsonl", **FEW)
    first = carry_mat(talos, mat, **given)
    monkeypatch.setattr("nuno.tasks.carry_trials.carry", None)
    again = carry_mat(talos, mat, **given)
    assert again.trials == first.trials


@pytest.mark.long
def test_a_trial_that_diverges_has_failed(talos, glides, mat, monkeypatch):
    """Its error is the reason, without a time; the others go on."""
    from nuno.tasks import carry_trials

    real = carry_trials.carry

    def carry(world, plan, walks, offsets, *more, **named):
        if (wild := np.flatnonzero(offsets[:, 1] > 0.1)).size:
            raise nuno.SimulationDiverged("mat", 0.1, tuple(wild.tolist()))
        return real(world, plan, walks, offsets, *more, **named)

    monkeypatch.setattr(carry_trials, "carry", carry)
    given = FEW | {"seconds": 0.2}
    found = carry_mat(talos, mat, arm_distances=[0.34], walks=glides([0.34]), **given)
    assert found.failed.tolist() == [False, True]
    assert found.trials[1].reason.startswith("SimulationDiverged") and found.trials[1].failed_at is None
    assert "error" in found.table()


def test_what_cannot_be_carried_is_refused(talos, tmp_path):
    """Every refusal says what was given and what is valid, before anything is planned or simulated."""
    refused = [
        (dict(hold="glue"), "hold must be one of"),
        (dict(mat="carpet"), "mat must be one of"),
        (dict(mat=nuno.box((0.6, 0.4, 0.02))), "a mat is a cloth or a soft body"),
        (dict(arm_distances=[0.7]), "cannot lie on both"),
        (dict(mat=nuno.sheet((2.5, 0.4), cells=(20, 4))), "wider than the arms"),
        (dict(arms="spheres"), "arms must be hulls or boxes"),
        (dict(hands_at=(0.5, np.nan)), "finite"),
        (dict(arm_distances=[]), "arm_distances"),
        (dict(walks=[]), "walks must be 10"),
        (dict(offsets_x=[0.4], walks=()), "walks must be"),
    ]
    for options, message in refused:
        with pytest.raises(nuno.InvalidInputError, match=message):
            carry_mat(talos, **options)


def test_a_mat_in_the_trunk_is_refused(talos, glides):
    """Hands far ahead of its centre leave the mat no place before the chest."""
    with pytest.raises(nuno.InvalidInputError, match="reaches into the trunk"):
        carry_mat(talos, arm_distances=[0.34], offsets_x=[0.4], offsets_y=[0.0], walks=glides([0.34]), device="cpu")


def test_arms_that_do_not_reach_are_refused(talos):
    """Hands 0.1 m apart would be inside each other."""
    with pytest.raises(nuno.RobotModelError, match=r"cannot be held 0\.100 m apart"):
        carry_mat(talos, arm_distances=[0.1])


def test_a_robot_without_legs_is_refused(talos, tmp_path):
    """A humanoid is read from its URDF alone: its description names no feet."""
    bare = Humanoid(talos.description.urdf, package_dirs=talos.description.package_dirs)
    with pytest.raises(nuno.RobotModelError, match="has no legs"):
        carry_mat(bare, hands_at=(0.5, 1.1))


@pytest.mark.long
def test_the_robot_is_left_as_it_was(talos, glides, result):
    """A robot that is lent stands as before, also where something is refused."""
    before = talos.configuration()
    with pytest.raises(nuno.RobotModelError):
        carry_mat(talos, arm_distances=[0.1])
    np.testing.assert_array_equal(talos.configuration(), before)


@pytest.mark.slow
def test_ninety_trials_have_both_outcomes():
    """The issue: 90 trials of 8 s and four steps; both outcomes occur, and half the substep agrees."""
    from scipy.stats import spearmanr

    coarse = carry_mat(device="cpu")
    assert len(coarse.trials) == 90 and 0 < coarse.failed.sum() < 90
    room = module.make_room(coarse.plan, "cpu")
    mat = room.find("mat")
    room.attach(mat, coarse.plan.material)
    fine = carry_mat(device="cpu", substeps=2 * mat._dynamics.substeps)
    assert (coarse.failed == fine.failed).mean() >= 0.95
    both = ~coarse.failed & ~fine.failed
    assert spearmanr(coarse.values[both], fine.values[both])[0] > 0.8
