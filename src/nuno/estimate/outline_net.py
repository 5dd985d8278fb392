"""A small convolutional network that looks at two silhouettes, in NumPy.

It was trained on pairs of a seen and an imagined silhouette (benchmarks/outline_training.py) to tell how much likelier
the seen one is, given the imagined one, than a hand-made likelihood says (`nuno.estimate.learned`). Its weights,
290,000 numbers of 8 bits with a scale for every output, lie beside this file.
"""

from __future__ import annotations

from functools import lru_cache
from importlib.resources import files

import numpy as np

from nuno.numbers.blas_threads import one_blas_thread

SIZE = 64
"""[px] Sides of the pictures it looks at."""
SCALARS = 12
LEVELS = 15
"""Pictures were kept in steps of 1/15 for training."""
STRIDES = (2, 2, 2, 1, 2)
AT_ONCE = 32
"""Pairs at a time, so that what lies between two layers stays in the processor's cache."""


@lru_cache(maxsize=1)
def weights() -> dict[str, np.ndarray]:
    """The layers' weights (outputs, ...), biases (outputs,), and the scalars' mean and deviation, float32."""
    with (files("nuno.estimate") / "outline_net.npz").open("rb") as file, np.load(file, allow_pickle=False) as stored:
        found = {name: stored[name] for name in stored.files}
    for name in [name for name in found if f"{name}.scale" in found]:
        layer = found[name].reshape(len(found[name]), -1)
        found[name] = np.ascontiguousarray(layer * found.pop(f"{name}.scale")[:, None], dtype=np.float32)
    return found


def log_ratios(real: np.ndarray, imagined: np.ndarray, scalars: np.ndarray) -> np.ndarray:
    """(n,) float, logarithms of how much likelier a seen silhouette is than the hand-made likelihood says.

    Args:
        real: (SIZE, SIZE) float, share of every pixel that the seen cloth covers, 0 to 1.
        imagined: (n, SIZE, SIZE) float, the same of the imagined ones.
        scalars: (n, SCALARS) float, what else is known of the pairs (`nuno.estimate.learned`).
    """
    net = weights()
    seen = _rounded(real)[None, ..., None]
    with one_blas_thread():
        found = [
            _forward(net, seen, _rounded(imagined[k : k + AT_ONCE])[..., None], scalars[k : k + AT_ONCE])
            for k in range(0, len(imagined), AT_ONCE)
        ]
    return np.concatenate([np.zeros(0), *found])


def _forward(net: dict[str, np.ndarray], seen: np.ndarray, imagined: np.ndarray, scalars: np.ndarray) -> np.ndarray:
    x = np.concatenate([np.broadcast_to(seen, imagined.shape), imagined], axis=-1)
    for k, stride in enumerate(STRIDES):
        x = np.maximum(_convolved(x, net[f"conv{k}"], stride) + net[f"conv{k}.bias"], 0.0)
    x = np.maximum(x.reshape(len(x), -1) @ net["dense"].T + net["dense.bias"], 0.0)
    scaled = ((scalars - net["mean"]) / net["deviation"]).astype(np.float32)
    x = np.concatenate([x, scaled], axis=1)
    for name in ("mix", "narrow"):
        x = np.maximum(x @ net[name].T + net[f"{name}.bias"], 0.0)
    return np.asarray(x @ net["ratio"][0] + net["ratio.bias"][0], dtype=float)


def _convolved(x: np.ndarray, layer: np.ndarray, stride: int) -> np.ndarray:
    """Images (n, h, w, c) by a layer (outputs, side * side * c), the rim padded by zeros."""
    side = round(np.sqrt(layer.shape[1] / x.shape[-1]))
    padded = np.pad(x, ((0, 0), (side // 2, side // 2), (side // 2, side // 2), (0, 0)))
    patches = np.lib.stride_tricks.sliding_window_view(padded, (side, side), axis=(1, 2))[:, ::stride, ::stride]
    n, height, width = patches.shape[:3]
    return (patches.transpose(0, 1, 2, 4, 5, 3).reshape(n * height * width, -1) @ layer.T).reshape(n, height, width, -1)


def _rounded(picture: np.ndarray) -> np.ndarray:
    return np.round(np.asarray(picture, dtype=np.float32) * LEVELS) / np.float32(LEVELS)
