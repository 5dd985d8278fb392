"""Environments against Gymnasium's own checks and its own vector environment, to the bit."""

import warnings

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from gymnasium.wrappers.vector import ClipReward, NormalizeObservation, RecordEpisodeStatistics

import nuno.envs
from nuno import BodyStateError, InvalidInputError, UnknownNameError
from nuno.envs import ClothEnv, ClothVectorEnv, FoldTask

SMALL = {"cells": (4, 4), "substeps": 5, "device": "cpu"}


class ShortFold(FoldTask):
    """A fold of four steps, which worlds begin with one after the other."""

    horizon = 4


def short(**options):
    """Return the task with few cells."""
    return ShortFold(**(SMALL | options))


def actions_of(count, steps, seed=0):
    """Return random actions (steps, worlds, 8)."""
    return np.random.default_rng(seed).uniform(-1.0, 1.0, (steps, count, 8)).astype(np.float32)


def assert_equal(found, expected):
    """Check that two infos, or what is in them, are equal to the bit."""
    if isinstance(expected, dict):
        assert found.keys() == expected.keys()
        for name in expected:
            assert_equal(found[name], expected[name])
    elif isinstance(expected, np.ndarray) and expected.dtype.hasobject:
        for a, b in zip(found, expected, strict=True):
            assert (a is None) == (b is None)
            np.testing.assert_array_equal(a, b)
    else:
        np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize("name", [pytest.param("Spread", marks=pytest.mark.long), "Fold", "Hang", "Cover"])
def test_gymnasium_has_nothing_to_say(name):
    """Gymnasium's checker goes through spaces, seeds, steps and pictures of each registered task."""
    env = gym.make(f"nuno/{name}-v0", render_mode="rgb_array", width=16, height=12, disable_env_checker=True, **SMALL)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(env.unwrapped)
    env.reset(seed=0)
    assert env.render().shape == (12, 16, 3)
    env.close()


@pytest.mark.parametrize(
    ("mode", "thorough"),
    [
        (AutoresetMode.NEXT_STEP, True), (AutoresetMode.SAME_STEP, False),
        pytest.param(AutoresetMode.NEXT_STEP, False, marks=pytest.mark.long),
        pytest.param(AutoresetMode.SAME_STEP, True, marks=pytest.mark.long),
    ],
)  # fmt: skip
def test_a_batch_is_gymnasiums_vector_of_single_environments(mode, thorough):
    """Observations, rewards, ends and infos of nine steps are those of single worlds, to the bit, resets included."""
    ours = ClothVectorEnv(short(), 3, autoreset_mode=mode, thorough=thorough)
    theirs = SyncVectorEnv([lambda: ClothEnv(short(), thorough=thorough)] * 3, autoreset_mode=mode)
    for found, expected in zip(ours.reset(seed=5), theirs.reset(seed=5), strict=True):
        assert_equal(found, expected)
    # one of them begins anew by itself, so that they end at different times from now on
    mask = np.array([False, True, False])
    ours.step(np.ones((3, 8)))
    theirs.step(np.ones((3, 8), dtype=np.float32))
    ours.reset(seed=9, options={"reset_mask": mask})
    theirs.reset(seed=9, options={"reset_mask": mask})
    ended = 0
    for actions in actions_of(3, 9):
        found, expected = ours.step(actions), theirs.step(actions)
        for a, b in zip(found, expected, strict=True):
            assert_equal(a, b)
        ended += found[3].sum()
    assert ended >= 4


def test_without_autoreset_a_mask_resets():
    """A step after an episode's end is refused; the worlds of a mask begin anew, the others go on."""
    env = ClothVectorEnv(short(), 2, autoreset_mode="Disabled")
    env.reset(seed=0)
    for actions in actions_of(2, 4):
        ends = env.step(actions)[3]
    assert ends.all()
    with pytest.raises(BodyStateError, match=r"\[0, 1\] have ended"):
        env.step(np.zeros((2, 8)))
    before = env.vertices[0]
    env.reset(options={"reset_mask": np.array([False, True])})
    np.testing.assert_array_equal(env.vertices[0], before)
    assert env.episode_steps.tolist() == [4, 0]


def test_the_same_seed_is_the_same_episode():
    """To the bit, whatever was before, and with pictures or without; another seed is another one."""
    runs = []
    for options in ({}, {"render_mode": "rgb_array", "width": 16, "height": 12}, {}):
        env = ClothVectorEnv("cover", 2, **SMALL, **options)
        if not runs:
            env.reset(seed=1)
            env.step(np.ones((2, 8)))
        seen = [env.reset(seed=3)[0]]
        for actions in actions_of(2, 3):
            seen.append(env.step(actions)[0])
            env.render()
        runs.append(np.array(seen))
    np.testing.assert_array_equal(runs[0], runs[1])
    np.testing.assert_array_equal(runs[0], runs[2])
    assert (env.reset(seed=4)[0] != runs[0][0]).any()
    # world 1 of seed 3 is world 0 of seed 4
    np.testing.assert_array_equal(env.reset(seed=4)[0][0], runs[0][0][1])


def test_gymnasiums_vector_wrappers_and_make_vec():
    """Statistics, normalised observations and clipped rewards; pictures and arrays on the device."""
    base = gym.make_vec("nuno/Fold-v0", 2, vectorization_mode="vector_entry_point", render_mode="rgb_array",
                        width=16, height=12, **SMALL)  # fmt: skip
    assert isinstance(base.unwrapped, ClothVectorEnv) and base.unwrapped.metadata["render_modes"] == ["rgb_array"]
    env = ClipReward(NormalizeObservation(RecordEpisodeStatistics(base)), -0.1, 0.1)
    env.reset(seed=0)
    total = 0.0
    for actions in actions_of(2, base.unwrapped.task.horizon):
        observations, rewards, _, truncations, infos = env.step(actions)
        assert env.single_observation_space.contains(observations[0].astype(np.float32))
        total = total + rewards
    assert truncations.all() and infos["episode"]["l"].tolist() == [32, 32]
    pictures = env.render()
    assert len(pictures) == 2 and pictures[0].shape == (12, 16, 3) and pictures[0].std() > 10.0
    state = base.unwrapped.device_state()
    np.testing.assert_array_equal(np.from_dlpack(state["positions"]), np.float32(base.unwrapped.vertices))
    env.close()


def test_the_reward_is_what_the_score_grows_by():
    """Rewards of an episode add up to its last score less its first."""
    env = ClothVectorEnv(short(), 2, autoreset_mode="Disabled")
    first = env.reset(seed=0)[1]["score"]
    total = sum(env.step(actions)[1] for actions in actions_of(2, 3))
    *_, rewards, _, _, infos = env.step(np.zeros((2, 8)))
    np.testing.assert_allclose(first + total + rewards, infos["score"], atol=1e-12)


def test_what_cannot_be_done_is_named():
    """Names, modes, options, actions and orders that do not fit."""
    with pytest.raises(UnknownNameError, match="cover"):
        ClothVectorEnv("iron")
    with pytest.raises(InvalidInputError, match="rgb_array"):
        ClothVectorEnv("fold", render_mode="human")
    with pytest.raises(InvalidInputError, match="NextStep"):
        ClothVectorEnv("fold", autoreset_mode="later")
    with pytest.raises(InvalidInputError, match="num_envs"):
        ClothVectorEnv("fold", 0)
    with pytest.raises(InvalidInputError, match="cells, substeps"):
        ClothVectorEnv("fold", colour="red")
    with pytest.raises(InvalidInputError, match="own options"):
        ClothVectorEnv(short(), cells=(3, 3))
    with pytest.raises(InvalidInputError, match="a name or"):
        ClothVectorEnv(3)
    with pytest.raises(InvalidInputError, match="cells"):
        ClothVectorEnv("fold", cells=4)
    env = ClothVectorEnv(short(), 2)
    with pytest.raises(BodyStateError, match="reset"):
        env.step(np.zeros((2, 8)))
    env.reset(seed=[3, None])
    for wrong in (np.zeros((2, 7)), np.zeros(8), np.full((2, 8), np.nan)):
        with pytest.raises(InvalidInputError, match="actions"):
            env.step(wrong)
    with pytest.raises(InvalidInputError, match="seed"):
        env.reset(seed=[1, 2, 3])
    for wrong in (np.zeros(2, bool), np.ones(3, bool), np.ones(2)):
        with pytest.raises(InvalidInputError, match="reset_mask"):
            env.reset(options={"reset_mask": wrong})
    assert env.render() is None and set(nuno.envs.TASKS) == {"spread", "fold", "hang", "cover"}
