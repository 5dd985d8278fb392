"""The way of a hand that lifts a cloth: as it was seen, or a guess at it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from nuno.errors import InvalidInputError
from nuno.estimate.hand_path import HandPath
from nuno.shapes.path import Path, minimum_jerk
from nuno.validation import finite_array

if TYPE_CHECKING:
    from nuno.estimate.hypotheses import Hypothesis

STEPS = 90
"""A guessed way is so many straight pieces, whatever it is: so a world is the same in any batch, to the bit."""
AWAY = 0.02
"""[m] A path's end may be as far from the hand, or three standard deviations if that is more."""


def checked_path(path: Any, hand: np.ndarray, std: float) -> np.ndarray:
    """Return a hand's way (k, 3) [m], at even times.

    Args:
        path: (k, 3), two points or more at even times; or a HandPath, of which what it held counts.
        hand: (3,) where it has to end [m].
        std: Standard deviation of where the hand is [m].

    Raises:
        InvalidInputError: no such array, or one that ends elsewhere.
    """
    points = held_part(path) if isinstance(path, HandPath) else finite_array("hand_path", path, ("k", 3))
    if len(points) < 2:
        raise InvalidInputError(f"hand_path needs two points or more, from the cloth to the hand, got {len(points)}")
    away = float(np.linalg.norm(points[-1] - hand))
    if away > max(AWAY, 3.0 * std):
        raise InvalidInputError(
            f"hand_path must end where the hand is, {hand.tolist()} m, but its last point is {away:.3f} m away"
        )
    return points


def held_part(path: HandPath) -> np.ndarray:
    """(STEPS + 1, 3) float [m], where a hand was at even times from the beginning of its last hold to its end.

    Raises:
        InvalidInputError: it never held.
    """
    if not path.holds:
        raise InvalidInputError("hand_path never held, so it lifted no cloth")
    begin, end = path.holds[-1]
    return np.asarray(path.at(np.linspace(begin, min(end, float(path.times[-1])), STEPS + 1)))


def paths_of_hands(
    begin: np.ndarray, hand: ArrayLike, hypotheses: Sequence[Hypothesis], seconds: float, std: float,
    seen: np.ndarray | None,
) -> Path:  # fmt: skip
    """Return the ways of the hands of all hypotheses, the candidates of one after those of the other.

    Args:
        begin: (c, 3) where the candidates lie [m].
        hand: (3,) where the hand is told to end [m].
        hypotheses: They say how it went, and by how many standard deviations it is elsewhere.
        seconds: How long it took [s].
        std: Standard deviation of where it is [m].
        seen: (k, 3) the way as it was seen [m], or None. It is bent so that it begins at the candidate: the offset
            there fades out towards the end.
    """
    ends = np.asarray(hand, dtype=float) + std * np.array([h.hand for h in hypotheses])
    ends[:, 2] += [h.mistake for h in hypotheses]
    if seen is not None:
        share = np.linspace(0.0, 1.0, len(seen))[:, None]
        ways = [
            seen + (1.0 - share) * (begin[:, None] - seen[0]) + share * (end - seen[-1]) for end in ends
        ]  # fmt: skip
    else:
        ways = [_guessed(begin, end, h.up_first) for end, h in zip(ends, hypotheses, strict=True)]
    keys = np.concatenate(ways)
    return Path(np.linspace(0.0, seconds, keys.shape[1]), keys, None, "linear")


def _guessed(begin: np.ndarray, end: np.ndarray, up_first: bool) -> np.ndarray:
    """(c, STEPS + 1, 3): straight with minimum jerk, or up and then sideways, each with minimum jerk."""
    share = np.linspace(0.0, 1.0, STEPS + 1)
    up, sideways = (
        (minimum_jerk(np.minimum(2.0 * share, 1.0)), minimum_jerk(np.maximum(2.0 * share - 1.0, 0.0)))
        if up_first else (minimum_jerk(share),) * 2
    )  # fmt: skip
    shares = np.stack([sideways, sideways, up], axis=1)
    return begin[:, None] + shares * (end - begin)[:, None]
