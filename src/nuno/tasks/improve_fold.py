"""Improving a taught fold in imagination until it is square."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from nuno.bodies.body import Body
from nuno.errors import InvalidInputError, SimulationDiverged
from nuno.estimate.imagined_fold import batched
from nuno.materials import Cloth
from nuno.search.minimise import Minimum, minimise
from nuno.tasks.fold_motion import SETTLE, FoldMotion, world_without_robots
from nuno.validation import LONGEST_WAIT, count, number
from nuno.world.world import World

FARTHEST = 0.25
"""Share of the longer side by which a way may end elsewhere than it was taught."""
HEIGHTS = (0.6, 1.5)
"""Factors of the ways' height."""
SHARES = np.linspace(0.25, 2.0, 8)
"""Shares of the corners' errors that are first taken off the ways' ends: a cloth that is dragged along needs more
or less than all of it."""
STEP = 0.04
"""Standard deviation of the first guesses around the best of these, as a share of the ranges."""


DOUBTS = ((0.0, 1.0), (0.0015, 0.7), (-0.0015, 1.4))
"""Every guess is imagined so often: as it is, and with ways that end so far aside [m] of a cloth so much stiffer. How a
crease falls may depend on less than hands and materials are known to; such folds are not wanted."""


@dataclass(frozen=True, eq=False)
class ImprovedFold:
    """A fold that was searched for.

    Attributes:
        motion: The best motion that was found.
        errors: (hands,) float [m], how far its corners lie beside those they cover, as imagined.
        doubtful_errors: (doubts, hands) float [m], likewise where hands and cloth are a little different (``DOUBTS``).
        taught_errors: (hands,) float [m], those of the motion as it was taught.
        vertices: (n, 3) float [m], how the cloth would come to lie.
        taught_vertices: (n, 3) float [m], and how by the motion as it was taught.
        minimum: What the search tried.
    """

    motion: FoldMotion
    errors: np.ndarray
    doubtful_errors: np.ndarray
    taught_errors: np.ndarray
    vertices: np.ndarray = field(repr=False)
    taught_vertices: np.ndarray = field(repr=False)
    minimum: Minimum = field(repr=False)


class FoldTrials:
    """The trial of the search: carries the cloth as each row of parameters says, in worlds of its own.

    Args:
        motion: The motion that is changed.
        world: The world that is imagined.
        cloth: Name of the cloth.
        settle: How long it is given to come to rest [s].
        device: Where the worlds are imagined; None is the world's own.
    """

    def __init__(self, motion: FoldMotion, world: World, cloth: str, settle: float, device: str | None) -> None:
        self.motion, self.world, self.cloth, self.settle, self.device = motion, world, cloth, settle, device

    def __call__(self, _: None, params: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Return "loss" (n,) and "errors" (n, doubts, hands) [m], and the "vertices" [m] in the end where all is right.

        The loss is the mean error of the hands, of the worst of the doubts.
        """
        heights = np.asarray(params["height"])
        guesses, doubts, hands = len(heights), len(DOUBTS), self.motion.hand_count
        shifts = np.stack([params[f"{side}{hand}"] for hand in range(hands) for side in "uv"], axis=1)
        shifts = shifts.reshape(guesses, 1, hands, 2) + np.array([aside for aside, _ in DOUBTS])[:, None, None]
        futures = self.world.imagine(guesses * doubts, device=self.device)
        cloth = futures.find(self.cloth)
        material = self.world.find(self.cloth).material
        assert isinstance(material, Cloth)
        futures.set_material(cloth, batched([_stiffer(material, factor) for _, factor in DOUBTS] * guesses))
        ways = self.motion.ways_with(shifts.reshape(-1, hands, 2), np.repeat(heights, doubts))
        try:
            vertices = self.motion.carry(futures, cloth, ways, settle=self.settle)
        except SimulationDiverged as error:
            raise SimulationDiverged(error.body, error.time, tuple({k // doubts for k in error.worlds})) from error
        vertices = vertices.reshape(guesses, doubts, *vertices.shape[1:])
        errors = self.motion.corner_errors(vertices)
        return {"loss": errors.mean(axis=2).max(axis=1), "errors": errors, "vertices": vertices[:, 0]}


def _stiffer(material: Cloth, factor: float) -> Cloth:
    """Return a material with another bending rigidity."""
    own = material.bending_rigidity
    return replace(
        material, bending_rigidity=tuple(factor * b for b in own) if isinstance(own, tuple) else factor * own
    )


def improve_fold(
    motion: FoldMotion, cloth: Body, *, enough: float = 0.004, population: int = 16, generations: int = 12,
    settle: float = SETTLE, seed: int = 0, device: str | None = None, progress: bool | None = None,
) -> ImprovedFold:  # fmt: skip
    """Search for changes of a motion by which the corners that it carries come to lie on those they are to cover.

    Where each hand's way ends along u and v, and how high they go, is changed. First the ways end shorter by as much as
    the corners came too far, in several shares; from the best of these on, CMA-ES searches. Each generation is one
    batch of imagined worlds, in which points of the cloth are led along the ways, without the robot.

    Args:
        motion: The motion, from ``TaughtFold.on``.
        cloth: The cloth, dynamic, where it lies before; it stays as it is.
        enough: A loss at which to stop: the corners' mean distance in the worst of the doubts [m].
        population: Candidates in a generation.
        generations: At most so many.
        settle: How long the cloth is given to come to rest [s].
        seed: Of the search.
        device: Where the worlds are imagined; None is the world's own.
        progress: Progress bar; None shows one in a terminal.

    Raises:
        BodyStateError: the cloth is static, or lies elsewhere.
        InvalidInputError: the fold does not carry corners onto corners.
        MissingPackageError: the package cma is not installed.
        EstimationError: every trial failed.
    """
    if not isinstance(motion, FoldMotion):
        raise InvalidInputError(f"motion must be a FoldMotion, from TaughtFold.on, got {type(motion).__name__}")
    motion.check_place(cloth)
    motion.goals  # noqa: B018  raises where there are none, before anything is computed
    world = world_without_robots(cloth)
    far = FARTHEST * float(motion.frame.size.max())
    names = [f"{side}{hand}" for hand in range(motion.hand_count) for side in "uv"]
    trial = FoldTrials(motion, world, cloth.name, number("settle", settle, low=0.0, high=LONGEST_WAIT), device)
    before = motion.imagine(cloth, settle=settle)
    wrong = motion.corner_offsets(before).ravel()
    guesses = np.clip(-SHARES[:, None] * wrong, -far, far)
    columns = dict(zip(names, guesses.T, strict=True)) | {"height": np.ones(len(SHARES))}
    first = int(trial(None, columns)["loss"].argmin())
    found = minimise(
        trial, {name: (-far, far) for name in names} | {"height": HEIGHTS},
        start={name: float(column[first]) for name, column in columns.items()}, step=STEP, enough=enough,
        population=count("population", population, low=3), generations=generations, seed=seed,
        progress=progress,
    )  # fmt: skip
    shifts = np.array([found.params[name] for name in names]).reshape(-1, 2)
    errors = found.values["errors"]
    return ImprovedFold(
        motion.changed(shifts, found.params["height"]), errors[0], errors, motion.corner_errors(before),
        found.values["vertices"], before, found,
    )  # fmt: skip
