"""A fold is learned: a search over the hands' way (CMA-ES), whose every generation is one batch of environments.

Run: python examples/learn_fold.py [--out FOLDER]

Nobody says how to fold: the way of both hands is three places beside the corners that they take, six numbers, and the
environment's score is the only teacher. The dashed line is what the scripted baseline reaches.
"""

import argparse
from pathlib import Path

import cma
import numpy as np
from matplotlib.figure import Figure

from nuno.envs import ClothVectorEnv, ScriptedPolicy

WORLDS = 16  # a generation
GENERATIONS = 20
STEPS = (2, 4, 4, 5, 2)  # control steps: to the corners, along the three parts of the way, and with open hands
SIZE = 0.15  # [m] of the numbers' unit


def fold(env: ClothVectorEnv, ways: np.ndarray, seed: int) -> np.ndarray:
    """Let each world's hands go its way (worlds, 3, 2), along the cloth and up, and return the scores in the end."""
    env.reset(seed=seed)
    corners = env.vertices[:, env.task.corners]  # (worlds, 4, 3): two of the near side, two of the far one
    along = (corners[:, 2:] - corners[:, :2])[:, None]
    along /= np.linalg.norm(along, axis=-1, keepdims=True)
    shift = SIZE * ways[:, :, None, :1] * along + SIZE * ways[:, :, None, 1:] * np.array((0.0, 0.0, 1.0))
    places = corners[:, None, :2] + np.concatenate([np.zeros((WORLDS, 1, 2, 3)), shift, shift[:, -1:]], axis=1)
    for part, steps in enumerate(STEPS):
        for left in range(steps, 0, -1):
            motion = np.clip((places[:, part] - env.hands) / left / 0.05, -1.0, 1.0)  # an action of 1 is 5 cm
            close = np.full((WORLDS, 2, 1), 1.0 if 0 < part < 4 else -1.0)
            score = env.step(np.concatenate([motion, close], axis=2).reshape(WORLDS, 8))[4]["score"]
    return score


options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
options.add_argument("--out", type=Path, help="a folder for the learning curve and a picture")
out = options.parse_args().out
env = ClothVectorEnv("fold", WORLDS, cells=(8, 8), device="cpu", autoreset_mode="Disabled", render_mode="rgb_array")
search = cma.CMAEvolutionStrategy(np.zeros(6), 0.7, {"popsize": WORLDS, "seed": 1, "verbose": -9})
curve = []
for generation in range(GENERATIONS):
    tried = search.ask()
    scores = fold(env, np.reshape(tried, (WORLDS, 3, 2)), seed=100 * generation)
    search.tell(tried, list(-scores))
    curve.append((scores.mean(), scores.max()))
    print(f"generation {generation:2d}: mean {scores.mean():.2f}, best {scores.max():.2f}")
best = np.broadcast_to(search.result.xfavorite.reshape(3, 2), (WORLDS, 3, 2))
learned = fold(env, best, seed=7)  # cloths that lie as none did before
picture = env.render()[0]

env.reset(seed=7)
policy = ScriptedPolicy(env)
for _ in range(sum(STEPS) - 4):
    scripted = env.step(policy.act())[4]["score"].mean()
print(f"folds of other cloths: {learned.mean():.2f} ({learned.min():.2f} at worst); of the script: {scripted:.2f}")
assert learned.mean() > max(0.6, curve[0][0] + 0.3), "it has learned to fold"

if out:
    out.mkdir(parents=True, exist_ok=True)
    figure = Figure(figsize=(8.4, 3.4), layout="constrained")
    left, right = figure.subplots(1, 2)
    left.plot(np.array(curve), label=["mean of a generation", "best of it"])
    left.axhline(scripted, color="gray", linestyle="--", label="script")
    left.set(xlabel="generation of 16 episodes", ylabel="score of the fold", ylim=(0.0, 1.0))
    left.legend(loc="lower right")
    left.xaxis.get_major_locator().set_params(integer=True)
    right.imshow(picture)
    right.set_axis_off()
    figure.savefig(out / "learn_fold.png", dpi=100)
