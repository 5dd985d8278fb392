"""Fitting a cloth's material: bending, stretch and friction, from masks of it as it was moved in a known way."""

from __future__ import annotations

import logging
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from nuno.errors import InvalidInputError, UnknownNameError
from nuno.estimate.case import PickCase
from nuno.estimate.coming_to_rest import SETTLE_SECONDS
from nuno.estimate.fold_case import FoldCase
from nuno.estimate.fold_result import FoldResult
from nuno.estimate.footage import FoldFootage, Footage
from nuno.estimate.futures import LIFT_SECONDS, is_turned
from nuno.estimate.hand_sight import disc
from nuno.estimate.pick_result import PickResult
from nuno.estimate.seeing import HAND_MARGIN
from nuno.files.html_table import html_table
from nuno.materials import Cloth
from nuno.search.minimise import Minimum, minimise
from nuno.shapes.path import Path
from nuno.validation import checked, count, finite_array, number
from nuno.world.world import World

log = logging.getLogger(__name__)

BOUNDS: Mapping[str, tuple[float, float]] = {
    "bending_rigidity": (1e-6, 2e-3),
    "stretch_stiffness": (100.0, 10000.0),
    "friction": (0.05, 1.5),
}
"""[N m], [N/m] and 1: from the limpest silk to stiff canvas, from knitwear to tight weaves."""
FITTED = ("bending_rigidity", "stretch_stiffness", "shear_stiffness", "friction", "area_density", "damping", "air_drag")
ALIKE = 0.05
"""[px] Guesses whose outlines are no farther off than the best one's by this, and a twentieth of its own distance, are
as good: about what the mesh changes."""
AT_BOUND = 0.01
"""Share of the range within which a value counts as lying on its bound."""
VAGUE = 3.0
"""Ratio of the largest to the smallest of the values that are as good, from which on one is said not to be told."""
HAND_RADIUS = 0.014
"""[m] Of what hides a picked cloth around the hand."""


@dataclass(frozen=True, eq=False)
class MaterialFit:
    """The material that explains best what was seen.

    Attributes:
        material: The material.
        params: The values that were found, by name.
        ranges: By name, the lowest and highest value of the guesses that explain what was seen about as well.
        name: The preset of ``Cloth`` whose bending rigidity by area density, which is what the shape of a cloth under
            its own weight tells, is nearest.
        distance: Mean distance of the outlines from those seen [px].
        overlap: Mean intersection over union.
        frames: (k,) float [px], the distance in each frame.
        minimum: How it was found.
        warnings: What a reader should know.
    """

    material: Cloth
    params: dict[str, float]
    ranges: dict[str, tuple[float, float]]
    name: str
    distance: float
    overlap: float
    frames: np.ndarray
    minimum: Minimum = field(repr=False)
    warnings: list[str] = field(default_factory=list)

    def _repr_html_(self) -> str:
        rows = [
            (name, f"{value:.3g}", "{:.3g} to {:.3g}".format(*self.ranges[name])) for name, value in self.params.items()
        ]
        title = f"MaterialFit: nearest to {self.name}, {self.distance:.2f} px off, overlap {self.overlap:.3f}"
        return html_table(title, rows, columns=("parameter", "value", "range"), notes=self.warnings)


@checked
def fit_material(
    seen: Footage | FoldCase | FoldResult | PickCase,
    *,
    bounds: Mapping[str, tuple[float, float]] = BOUNDS,
    known: Cloth | None = None,
    pick: Sequence[float] | None = None,
    frames: int = 16,
    population: int = 16,
    generations: int = 25,
    tolerance: float = 5e-3,
    seed: int = 0,
    device: str | None = None,
    progress: bool | None = None,
) -> MaterialFit:
    """Find a cloth's material from masks of it as it was moved in a known way.

    Guesses are moved alike, a generation of them in one batch, and drawn as the camera would see them; what is lowered
    is the mean distance of their outlines from those that were seen (the chamfer distance), by CMA-ES. Masks tell the
    ratio of stiffness to weight: the area density is taken as known.

    Args:
        seen: What was seen: ``Footage``; a fold as a case or as it was replayed; or a pick as a case.
        bounds: What is looked for, between which values; attributes of ``Cloth``, all on a logarithmic scale.
        known: The rest of the material; None is what the replay or the pick's estimate found best, else ``Cloth()``.
        pick: Where a cloth was picked, (u, v) in [0, 1] along its sides from corner C00; None estimates it.
        frames: At most so many frames of a fold are compared, evenly spread.
        population: Guesses a generation; a CPU core takes 16 at once.
        generations: At most so many.
        tolerance: Stop when a generation spreads over less than this share of the bounds' (logarithmic) range.
        seed: Of the search.
        device: Where guesses are run; None is where the world is, "auto" for cases.
        progress: Progress bar; None shows one in a terminal after two seconds.

    Raises:
        InvalidInputError: an argument that cannot be used, or nothing to compare with.
        MissingPackageError: the package cma is not installed.
        EstimationError: every guess failed.
    """
    number("tolerance", tolerance, above=0.0)
    for name in bounds:
        if name not in FITTED:
            raise UnknownNameError("value of a cloth that can be found", name, list(FITTED))
    if known is not None and not isinstance(known, Cloth):
        raise InvalidInputError(f"known must be a Cloth, got {type(known).__name__}")
    if pick is not None and not isinstance(seen, PickCase):
        raise InvalidInputError(f"pick goes with a PickCase, not with a {type(seen).__name__}")
    footage, found = _footage(seen, count("frames", frames), pick, device)
    rest = known or found
    scores = footage.watch(rest, device)

    def trial(world: Any, guesses: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        got = scores(guesses)
        return {"loss": got["chamfer"].mean(axis=1), "iou": got["iou"].mean(axis=1), "chamfer": got["chamfer"]}

    start = {name: _inside(_one(getattr(rest, name)), bounds[name]) for name in bounds}
    minimum = minimise(
        trial, bounds, log_scale=list(bounds), start=start, population=population, generations=generations,
        tolerance=tolerance, seed=seed, progress=progress,
    )  # fmt: skip
    ranges = minimum.near(ALIKE + 0.05 * minimum.value)
    material = replace(rest, **minimum.params)
    warnings = _warnings(minimum, bounds, ranges)
    for warning in warnings:
        log.warning("%s", warning)
    return MaterialFit(
        material, minimum.params, ranges, _nearest_preset(material), minimum.value, float(minimum.values["iou"]),
        minimum.values["chamfer"], minimum, warnings,
    )  # fmt: skip


def _footage(
    seen: Any, frames: int, pick: Sequence[float] | None, device: str | None
) -> tuple[Footage | FoldFootage, Cloth]:
    """Return what is compared, and the material that is taken for what is not looked for."""
    where = device or "auto"
    if isinstance(seen, Footage):
        return seen, Cloth()
    if isinstance(seen, FoldCase):
        seen = seen.replay(materials=["towel", "canvas"], device=where, progress=False)
    if isinstance(seen, FoldResult):
        there = [k for k in sorted(seen.real) if seen.times[k] > seen.times[0]]
        chosen = np.unique(np.linspace(0, len(there) - 1, min(frames, len(there))).round().astype(int))
        return FoldFootage(seen, tuple(there[k] for k in chosen)), seen.material
    if isinstance(seen, PickCase):
        return _pick_footage(seen, pick, where)
    raise InvalidInputError(f"seen must be Footage, FoldCase, FoldResult or PickCase, got {type(seen).__name__}")


def _pick_footage(case: PickCase, pick: Sequence[float] | None, device: str) -> tuple[Footage, Cloth]:
    """The image after a pick: the cloth at rest in the hand."""
    given: Any = (6, 6) if pick is None else [finite_array("pick", pick, (2,))]
    result = case.estimate(candidates=given, device=device, progress=False)
    uv = _fractions(result)
    if is_turned(result.rectangle):
        uv[1] = 1.0 - uv[1]
    world, name = result.world, result.futures.body.name
    points = world.find(name).at(*uv)
    begin = points.positions(world.find(name).vertices, world.find(name).faces)[0]
    path = Path(
        np.array((0.0, LIFT_SECONDS)),
        np.stack([begin, np.asarray(case.hand, dtype=float)]),
        interpolation="minimum_jerk",
    )

    def move(futures: World) -> None:
        futures.grip(name, points, to=path)

    assert result.mask_after is not None
    hidden = disc(case.camera, np.asarray(case.hand), HAND_RADIUS, HAND_MARGIN)
    end = LIFT_SECONDS + SETTLE_SECONDS
    seen = Footage(world, name, move, case.camera, np.array([end]), [result.mask_after & ~hidden], [hidden])
    batch = result.futures.world
    dynamics: Any = batch.find(name)._dynamics
    return seen, dynamics.material.of_world(result.best_index, batch.world_count)


def _fractions(result: PickResult) -> np.ndarray:
    """(2,) float, the best candidate as fractions of the sides."""
    best = np.array(result.best, dtype=float)
    return best / (np.array(result.grid) - 1) if np.issubdtype(result.labels.dtype, np.integer) else best


def _one(value: Any) -> float:
    """One number for a value that may differ by direction or element."""
    parts = [np.asarray(part, dtype=float).ravel() for part in (value if isinstance(value, tuple) else (value,))]
    return float(np.exp(np.mean(np.log(np.maximum(np.concatenate(parts), 1e-12)))))


def _inside(value: float, bounds: Any) -> float:
    """A value to start from: not on a bound, from which half of the guesses would lie outside."""
    low, high = finite_array("bounds", bounds, (2,))
    if not 0.0 < low < high:
        return value  # minimise says what is wrong
    share = math.log(max(value, 1e-300) / low) / math.log(high / low)
    return float(low * (high / low) ** min(max(share, 0.2), 0.8))


def _nearest_preset(material: Cloth) -> str:
    def limpness(cloth: Cloth) -> float:
        return math.log(max(_one(cloth.bending_rigidity), 1e-12) / _one(cloth.area_density))

    return min(Cloth.PRESETS, key=lambda name: abs(limpness(Cloth.preset(name)) - limpness(material)))


def _warnings(minimum: Minimum, bounds: Mapping[str, Any], ranges: Mapping[str, tuple[float, float]]) -> list[str]:
    found = []
    for name, value in minimum.params.items():
        low, high = bounds[name]
        share = math.log(value / low) / math.log(high / low)
        smallest, greatest = ranges[name]
        if not AT_BOUND < share < 1.0 - AT_BOUND:
            found.append(f"{name} lies at its bound, {value:.3g} of {low:g} to {high:g}")
        elif greatest / smallest > VAGUE:
            found.append(f"{name} is hardly told: {smallest:.3g} to {greatest:.3g} explain what was seen about as well")
    return found
