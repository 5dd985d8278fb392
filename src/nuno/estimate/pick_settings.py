"""The settings of an estimate of a pick, checked once: camera, table, hand, candidates and ways of comparing."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from numbers import Integral
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from nuno.camera.camera import Camera
from nuno.camera.table import Table, table_margin
from nuno.errors import InvalidInputError
from nuno.estimate.hand_error import Poses, poses_of
from nuno.estimate.hypotheses import Discretisation
from nuno.estimate.lift_path import checked_path
from nuno.estimate.lift_prior import HAND_STD
from nuno.estimate.ranking import EVIDENCE, RANKINGS
from nuno.estimate.rotations import checked_turns
from nuno.validation import LONGEST_WAIT, finite_array, number
from nuno.world.device import checked_device, found_device
from nuno.world.world import World

MAX_HAND_STD = 0.2
"""[m] A hand that is known no better tells nothing of where a cloth hangs."""
MAX_HAND_RADIUS = 1.0
"""[m] Around a hand, of what hides the cloth."""
MAX_REST_HEIGHT = 0.2
"""[m] Of a cloth's middle surface above the table that it lies on."""
MAX_CANDIDATES = 1024
"""Each is imagined several times, on a mesh with a vertex there: more would take hours, and memory that few have."""


@dataclass(frozen=True, eq=False, kw_only=True)
class PickSettings:
    """Valid arguments of `nuno.estimate_pick` that are no images, under its names where nothing else is said.

    Attributes:
        table: The table.
        hand: (3,) float [m].
        labels: (k, 2) the candidates: (i, j) of a grid, or the (u, v) that were given.
        uv: (k, 2) float, the candidates as fractions of the sides.
        grid: Candidates along both sides; (2, 2) where points were given.
        turns: (t,) float [rad]; 0 alone where something else than evidence ranks.
        poses: How futures are moved to be compared: turned, or shifted, for the hand may be elsewhere than told.
        hand_path: (k, 3) float [m], from the time when it held to ``hand``; None is not known.
        sure: None is as much as is usual of what the cloth is taken for.
        device: "cpu" or "cuda:0" ...
        engine: What moves the imagined cloths.
        spacing: Of candidates that are spread over an outline [m]; None of others.
    """

    camera: Camera
    table: Table
    hand: np.ndarray
    labels: np.ndarray
    uv: np.ndarray
    grid: tuple[int, int]
    rest_height: float
    hand_radius: float
    lift_seconds: float
    discretisations: Sequence[Discretisation]
    sure: float | None
    turns: np.ndarray
    poses: Poses
    hand_std: float
    hand_path: np.ndarray | None
    learned: bool
    sideways: float | None
    score: str
    device: str
    progress: bool | None
    engine: str = "nuno"
    spacing: float | None = None

    @property
    def with_evidence(self) -> bool:
        """True where evidence ranks, of which the network and the prior of the lift are parts."""
        return self.score in EVIDENCE


def check_settings(
    *, camera: Camera | Mapping[str, Any], table: Table, hand: ArrayLike, candidates: tuple[int, int] | ArrayLike,
    discretisations: Sequence[Discretisation], turns: Sequence[float], score: str, device: str, rest_height: float,
    hand_radius: float, lift_seconds: float, sure: float | None, sideways: float | None, engine: str = "nuno",
    hand_std: float = HAND_STD, hand_path: Any = None, **others: Any,
) -> PickSettings:  # fmt: skip
    """Check the arguments of `nuno.estimate_pick` that are no images.

    Raises:
        InvalidInputError: as `nuno.estimate_pick`.
        UnknownNameError, MissingPackageError, EngineCapabilityError: of the engine, likewise.
    """
    if not isinstance(engine, str):
        raise InvalidInputError(f"engine must be a name, got {type(engine).__name__}")
    if engine != "nuno":
        # what is imagined there is a batch of cloths that are gripped
        World(device="cpu" if device == "auto" else device, engine=engine).engine.require(
            "cloth", "batch", "worlds' materials", "grips of vertices"
        )
        device = "cpu"
    camera = camera if isinstance(camera, Camera) else Camera.from_dict(camera)
    hand = finite_array("hand", hand, (3,))
    _check_hand(camera, hand, table)
    labels, uv, grid = _candidates(candidates)
    number("rest_height", rest_height, above=0.0, high=MAX_REST_HEIGHT)
    number("hand_radius", hand_radius, low=0.0, high=MAX_HAND_RADIUS)
    number("lift_seconds", lift_seconds, above=0.0, high=LONGEST_WAIT)
    if sure is not None:
        number("sure", sure, above=0.0, high=1.0)
    if sideways is not None:
        number("sideways", sideways, above=0.0)
    if not isinstance(score, str) or score not in RANKINGS:
        raise InvalidInputError(f"score must be one of {', '.join(RANKINGS)}, got {score!r}")
    if not isinstance(discretisations, Sequence) or not all(isinstance(d, Discretisation) for d in discretisations):
        raise InvalidInputError(f"discretisations must be a sequence of Discretisation, got {discretisations!r}")
    if not discretisations or discretisations[0].best is not None:
        raise InvalidInputError("discretisations must begin with one that looks at all candidates (best=None)")
    angles = checked_turns(turns)
    if score not in EVIDENCE:
        angles = np.zeros(1)
    number("hand_std", hand_std, low=0.0, high=MAX_HAND_STD)
    path = None if hand_path is None else checked_path(hand_path, hand, hand_std)
    return PickSettings(
        camera=camera, table=table, hand=hand, labels=labels, uv=uv, grid=grid, rest_height=rest_height,
        hand_radius=hand_radius, lift_seconds=lift_seconds, discretisations=discretisations, sure=sure,
        turns=angles, poses=poses_of(camera, angles, hand_std if score in EVIDENCE else 0.0), hand_std=hand_std,
        hand_path=path, sideways=sideways, score=score,
        device=found_device(checked_device(device)), engine=engine, **others,
    )  # fmt: skip


def check_table(
    height: float, half_extents: Sequence[float] | None, centre: Sequence[float] | None, thickness: float
) -> Table:
    """Return the table that the arguments of `nuno.estimate_pick` describe, each under ``table_`` in messages."""
    return Table(
        number("table_height", height),
        None if half_extents is None else _pair("table_half_extents", half_extents),
        None if centre is None else _pair("table_centre", centre),
        number("table_thickness", thickness, above=0.0),
    )


def _pair(name: str, value: Sequence[float]) -> tuple[float, float]:
    a, b = finite_array(name, value, (2,))
    return float(a), float(b)


def _check_hand(camera: Camera, hand: np.ndarray, table: Table) -> None:
    depth = float(camera.depth_of(hand))
    if depth <= 0:
        raise InvalidInputError(f"the hand at {hand.tolist()} m is {-depth:.3f} m behind the camera")
    u, v = camera.project(hand)
    if not (-camera.width < u < 2 * camera.width and -camera.height < v < 2 * camera.height):
        raise InvalidInputError(
            f"the hand at {hand.tolist()} m projects to pixel ({u:.0f}, {v:.0f}), far outside of the "
            f"{camera.width} x {camera.height} image"
        )
    if hand[2] < table.height and (table.half_extents is None or float(table_margin(table, hand[:2])) > 0.0):
        raise InvalidInputError(f"the hand at {hand.tolist()} m is below the table's top, z = {table.height:g} m")


def _candidates(candidates: Any) -> tuple[np.ndarray, np.ndarray, tuple[int, int]]:
    """Labels (k, 2), fractions (k, 2) of the sides, and the grid that the mesh's vertices should lie on."""
    is_pair = isinstance(candidates, tuple | list) and len(candidates) == 2
    if is_pair and all(isinstance(c, Integral) for c in candidates):
        n, m = (int(c) for c in candidates)
        if n < 2 or m < 2:
            raise InvalidInputError(f"a grid of candidates needs at least 2 x 2 points, got {n} x {m}")
        if n * m > MAX_CANDIDATES:
            raise InvalidInputError(f"a grid of candidates has at most {MAX_CANDIDATES} points, got {n} x {m}")
        ij = np.stack(np.meshgrid(np.arange(n), np.arange(m), indexing="ij"), axis=-1).reshape(-1, 2)
        return ij, ij / (n - 1, m - 1), (n, m)
    uv = finite_array("candidates", candidates, ("k", 2))
    if len(uv) > MAX_CANDIDATES or uv.min() < 0 or uv.max() > 1:
        raise InvalidInputError(
            f"candidates must be up to {MAX_CANDIDATES} fractions (u, v) of the cloth's sides, each from 0 to 1"
        )
    return uv, uv, (2, 2)
