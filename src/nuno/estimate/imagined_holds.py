"""A garment held up by every candidate point, imagined in one batch: attach, grip, let hang.

How a garment hangs from a point depends on the garment alone, not on where the hand is nor on any image, so it is
imagined once and compared with as many images as there are. A hold of a two-layered garment is by one layer. It starts
flat, the held layer up, as it is picked up from a table; or upright in its own plane, the held point on top.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from nuno.bodies.garment import Garment
from nuno.errors import EstimationError, InvalidInputError
from nuno.estimate.coming_to_rest import LOOK_SECONDS, REST_SPEED
from nuno.estimate.futures import rest_speed
from nuno.materials import Cloth
from nuno.mesh.sewn import BACK
from nuno.validation import check_fields, checked, count, instance, number
from nuno.world.device import checked_device, found_device
from nuno.world.progress import with_bar
from nuno.world.world import World

SPACING = 0.1
"""[m] About how far candidates are from each other on the cloth."""
FALL_SECONDS, SETTLE_SECONDS = 1.5, 2.5
"""[s] How long garments fall, and may take to come to rest then."""
SUBSTEPS = 14
MAX_HOLDS = 1024
"""Candidates: of more the images would hardly tell, and they would take hours."""


@dataclass(frozen=True)
class HoldGuess:
    """One guess at a garment's material and at how it came to hang.

    Attributes:
        bending_rigidity: [N m].
        friction: Coulomb's coefficient against itself.
        upright: Whether it starts upright in its own plane, below the held point; else flat.
        air_drag: [1/s].
        area_density: [kg/m2].
        thickness: Contact thickness [m].
    """

    bending_rigidity: float
    friction: float = 0.4
    upright: bool = False
    air_drag: float = 2.5
    area_density: float = 0.2
    thickness: float = 0.003

    def __post_init__(self) -> None:
        check_fields(self)
        for name in ("bending_rigidity", "friction", "air_drag", "area_density", "thickness"):
            least = {"above": 0.0} if name in ("area_density", "thickness") else {"low": 0.0}
            number(name, getattr(self, name), high=1e6, **least)


HOLD_GUESSES = (HoldGuess(2e-5, 0.3), HoldGuess(2e-4, 0.5), HoldGuess(8e-5, 0.4, upright=True))
"""Three guesses that differ in all that is not known: how a garment folds is a matter of chance."""


@dataclass(frozen=True, eq=False)
class Holds:
    """A garment as it hangs from every candidate.

    Attributes:
        garment: The garment.
        candidates: (k,) int, the vertices by which it is held.
        guesses: The guesses.
        positions: (guesses, k, n, 3) float32, its vertices [m] from the held one.
        finite: (guesses, k) bool, which of them are numbers.
        device: Where they were imagined, "cpu" or "cuda:0" ...
    """

    garment: Garment
    candidates: np.ndarray
    guesses: tuple[HoldGuess, ...]
    positions: np.ndarray
    finite: np.ndarray
    device: str

    def __repr__(self) -> str:
        return f"<Holds: {self.garment.name}, {len(self.candidates)} candidates, {len(self.guesses)} guesses>"


def hold_candidates(garment: Garment, spacing: float) -> np.ndarray:
    """Return vertices (k,) int that are about evenly spread over a garment, on both layers and its seams and hems.

    Each is as far as can be, on the cloth, from those before it (farthest point sampling, Gonzalez 1985), until all
    vertices are within 0.7 spacings of one. With a point come those that the garment's symmetries take it to.

    Args:
        garment: The garment.
        spacing: About how far candidates are from each other [m].
    """
    maps = garment.symmetries
    top = int(np.lexsort((garment.rest[:, 0], garment.rest[:, 1]))[-1])
    chosen: list[int] = []
    away = np.full(len(garment.vertices), np.inf)
    following = top
    while not chosen or away[following] > 0.7 * spacing:
        orbit = sorted({int(one[following]) for one in maps})
        chosen += orbit
        away = np.minimum(away, garment.distances(np.array(orbit)).min(axis=0))
        # to the last digit symmetric points are not as far as each other: the first of those that nearly are
        following = int(np.flatnonzero(away >= away.max() - 1e-9)[0])
        if len(chosen) > MAX_HOLDS:
            raise InvalidInputError(f"spacing {spacing:g} m gives more than {MAX_HOLDS} candidates on this garment")
    return np.array(sorted(chosen))


@checked
def imagine_holds(
    garment: Garment, *, spacing: float = SPACING, candidates: ArrayLike | None = None,
    guesses: Sequence[HoldGuess] = HOLD_GUESSES, substeps: int = SUBSTEPS, device: str = "auto",
    progress: bool | None = None,
) -> Holds:  # fmt: skip
    """Hold a garment up by every candidate under every guess, and let it come to rest.

    Args:
        garment: The garment; its cells are those of the imagined cloth. Cells of 4 cm are fine enough for a shirt.
        spacing: About how far candidates are from each other on the cloth [m].
        candidates: (k,) int, vertices instead.
        guesses: Guesses at the material.
        substeps: Substeps per 1/60 s.
        device: "auto", "cpu", "cuda:0" ...
        progress: Progress bar; None shows one on a terminal.

    Raises:
        InvalidInputError: candidates that are no vertices, or too many.
        EstimationError: nothing stayed finite.
    """
    instance("garment", garment, Garment)
    tried = tuple(guesses)
    if not tried or not all(isinstance(guess, HoldGuess) for guess in tried):
        raise InvalidInputError(f"guesses must be a sequence of HoldGuess, got {guesses!r}")
    number("spacing", spacing, above=0.0)
    count("substeps", substeps, high=10_000)
    held = hold_candidates(garment, spacing) if candidates is None else np.asarray(candidates)
    if held.ndim != 1 or held.dtype.kind not in "iu" or not 0 < len(held) <= MAX_HOLDS:
        raise InvalidInputError(f"candidates must be up to {MAX_HOLDS} vertices (k,) int, got {candidates!r}")
    if held.min() < 0 or held.max() >= len(garment.vertices):
        raise InvalidInputError(f"candidates must be from 0 to {len(garment.vertices) - 1}, got {candidates!r}")
    where = found_device(checked_device(device))
    world = World(device=where, substeps=substeps)
    world._quiet = True
    body = world.add(garment.body())
    worlds = len(held) * len(tried)
    futures = world.imagine(worlds)
    cloth = futures.find(body.name)

    def each(name: str) -> np.ndarray:
        return np.repeat([getattr(guess, name) for guess in tried], len(held))

    names = ("bending_rigidity", "friction", "air_drag", "area_density", "thickness")
    futures.attach(cloth, Cloth(**{name: each(name) for name in names}))
    start = np.concatenate([[begin(garment, int(v), guess.upright) for v in held] for guess in tried])
    vertices = np.tile(held, len(tried))[:, None]
    shape = (worlds, len(garment.vertices), 3)
    futures.set_vertices(cloth, start if worlds > 1 else start[0])
    futures.grip(cloth, vertices if worlds > 1 else vertices[0], to=np.zeros((worlds, 3)) if worlds > 1 else (0, 0, 0))
    steps = [FALL_SECONDS] + [LOOK_SECONDS] * round(SETTLE_SECONDS / LOOK_SECONDS)
    for seconds in with_bar(steps, f"hanging a {garment.name}", progress, "look"):
        futures.run(seconds, progress=False)
        if rest_speed(cloth) < REST_SPEED:
            break
    found = np.asarray(cloth.vertices, dtype=np.float32).reshape(shape)
    finite = np.isfinite(found).all(axis=(1, 2)).reshape(len(tried), len(held))
    if not finite.any():
        raise EstimationError("no imagined garment stayed finite; more substeps or softer guesses are needed")
    return Holds(garment, held, tried, found.reshape(len(tried), len(held), *shape[1:]), finite, where)


def begin(garment: Garment, vertex: int, upright: bool) -> np.ndarray:
    """Return (n, 3) where a garment's vertices are before it falls [m], the held one at the origin.

    Args:
        garment: The garment.
        vertex: The held one.
        upright: Whether it stands in its own plane, its middle below the held point; else it lies flat, the held
            layer up.
    """
    x = garment.vertices - garment.vertices[vertex]
    if garment.layer[vertex] == BACK:
        x = x * (-1.0, 1.0, -1.0)  # turned over
    if not upright:
        return np.asarray(x)
    down = x.mean(axis=0)
    angle = math.atan2(-down[0], -down[1])  # by which the middle comes to be below
    c, s = math.cos(angle), math.sin(angle)
    return np.stack([c * x[:, 0] - s * x[:, 1], -x[:, 2], s * x[:, 0] + c * x[:, 1]], axis=1)
