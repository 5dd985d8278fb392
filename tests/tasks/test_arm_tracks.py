"""Tracks of arms: what a file of them holds, and that they carry as the robot itself does."""

import numpy as np
import pytest

import nuno
from nuno.tasks import carry_mat as module
from nuno.tasks.arm_tracks import BY_WALK, ArmTracks
from nuno.tasks.carry_mat import carry_mat, plan_arms

FEW = dict(arm_distances=(0.3, 0.4), settle=0.3, seconds=0.3)


@pytest.fixture(scope="module")
def tracks(talos, glides):
    """Return the tracks of a robot that stays where it is."""
    return plan_arms(talos, walks=glides(FEW["arm_distances"]), **FEW)


def test_a_file_holds_the_tracks_to_the_bit(tracks, tmp_path):
    """What is read is what was written, shapes and all; boxes too."""
    tracks.save(tmp_path / "arms.npz")
    back = ArmTracks.load(tmp_path / "arms.npz")
    for name in (*BY_WALK, "sides"):
        np.testing.assert_array_equal(getattr(back, name), getattr(tracks, name))
    for a, b in zip(back.parts, tracks.parts, strict=True):
        assert a.kind == b.kind == "hull"
        np.testing.assert_array_equal(a.planes, b.planes)
    assert (back.robot, back.settle, back.seconds) == ("talos", 0.3, 0.3)


@pytest.mark.long
def test_tracks_carry_as_the_robot_does(talos, glides, tracks, mat, tmp_path):
    """The same trials, without a robot: equal to the bit; pictures of the robot are refused by name."""
    ways = dict(mat=mat, offsets_x=(0.1,), offsets_y=(0.0, 0.24), device="cpu")
    tracks.save(tmp_path / "arms.npz")
    alone = carry_mat(ArmTracks.load(tmp_path / "arms.npz"), **ways)
    with_robot = carry_mat(talos, walks=glides(FEW["arm_distances"]), **FEW, **ways)
    assert alone.trials == with_robot.trials
    with pytest.raises(nuno.InvalidInputError, match="only the arms' tracks"):
        alone.strip(0)
    alone.save(tmp_path / "out")
    assert (tmp_path / "out" / "plot.png").exists() and not (tmp_path / "out" / "best.png").exists()


def test_a_narrow_mat_is_refused_with_tracks_too(tracks):
    """Distances are those of the tracks."""
    with pytest.raises(nuno.InvalidInputError, match="cannot lie on both"):
        carry_mat(tracks, nuno.sheet((0.4, 0.3), cells=(8, 6)))


def test_other_files_are_refused(tracks, tmp_path):
    """A file of something else, a damaged one, and a newer one have a named error."""
    np.savez(tmp_path / "other.npz", about=np.zeros(3))
    (tmp_path / "text.npz").write_text("arms")
    tracks.save(tmp_path / "whole.npz")
    content = (tmp_path / "whole.npz").read_bytes()
    (tmp_path / "cut.npz").write_bytes(content[: len(content) // 2])
    for name in ("other", "text", "cut"):
        with pytest.raises(nuno.FileFormatError, match="no tracks of arms"):
            ArmTracks.load(tmp_path / f"{name}.npz")
    with pytest.raises(FileNotFoundError):
        ArmTracks.load(tmp_path / "none.npz")


@pytest.mark.slow
def test_processes_plan_the_same_walks(talos):
    """Walks shared out among processes are, bit for bit, those planned here."""
    import multiprocessing
    from concurrent.futures import ProcessPoolExecutor

    here = module.plan_arms(talos, arm_distances=(0.3, 0.4))
    with ProcessPoolExecutor(2, mp_context=multiprocessing.get_context("spawn")) as executor:
        shared = module.plan_arms(talos, arm_distances=(0.3, 0.4), executor=executor)
    np.testing.assert_array_equal(here.configurations, shared.configurations)
