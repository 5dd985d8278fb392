"""A cloth that was moved in a known way, and what a camera saw of it; and how guesses at its material compare."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp
from numpy.typing import ArrayLike

from nuno.camera import raster
from nuno.camera.camera import Camera
from nuno.camera.image import check_mask
from nuno.camera.image_region import Region, view
from nuno.camera.render import render_masks
from nuno.errors import BodyStateError, InvalidInputError
from nuno.estimate.fold import HAND_MARGIN, REACH
from nuno.estimate.fold_result import FoldResult
from nuno.estimate.fold_view import hand_spheres
from nuno.estimate.futures import DRAWN_THICKNESS
from nuno.estimate.hand_sight import disc
from nuno.estimate.imagined_fold import imagine_fold
from nuno.estimate.similarity import Silhouette, score_masks
from nuno.materials import Cloth
from nuno.validation import check_fields, finite_array, number
from nuno.world.world import World

Scores = dict[str, np.ndarray]


@dataclass(frozen=True, eq=False)
class Footage:
    """A cloth that was moved in a known way, and what a camera saw of it.

    Attributes:
        world: A single world at the start, with the cloth in it, static; its time is the footage's.
        cloth: The cloth's name.
        move: Is called with a batch of copies of the world in which the cloth is attached, and sets up what moves it:
            grips on paths and the like.
        camera: The camera.
        times: (k,) float [s], of the masks, increasing.
        masks: (k, h, w), where the cloth was seen.
        ignored: (k, h, w), pixels that do not count, or None.
        drawn_thickness: [m], how thick the cloth is seen, which is less than the distance that contact keeps.

    Raises:
        InvalidInputError: shapes that do not fit each other, times that do not increase, or masks without cloth.
        BodyStateError: the cloth is dynamic.
    """

    world: World
    cloth: str
    move: Callable[[World], Any]
    camera: Camera
    times: np.ndarray
    masks: Sequence[np.ndarray] | np.ndarray
    ignored: Sequence[np.ndarray] | np.ndarray | None = None
    drawn_thickness: float = DRAWN_THICKNESS

    if TYPE_CHECKING:  # arrays may be given as lists

        def __init__(
            self, world: World, cloth: str, move: Callable[[World], Any], camera: Camera, times: ArrayLike,
            masks: Sequence[ArrayLike] | ArrayLike, ignored: Sequence[ArrayLike] | ArrayLike | None = None,
            drawn_thickness: float = DRAWN_THICKNESS,
        ) -> None: ...  # fmt: skip

    def __post_init__(self) -> None:
        check_fields(self)
        number("drawn_thickness", self.drawn_thickness, low=0.0)
        times = finite_array("times", self.times, ("k",))
        if (np.diff(times) <= 0.0).any() or times[0] < self.world.time:
            raise InvalidInputError(f"times must increase from the world's {self.world.time:g} s on")
        for name in ("masks", "ignored"):
            given = getattr(self, name)
            if given is not None and not isinstance(given, Sequence | np.ndarray):
                raise InvalidInputError(f"{name} must be images, one for each time, got {getattr(self, name)!r}")
        if len(self.masks) != len(times):
            raise InvalidInputError(f"there must be a mask for each of {len(times)} times, got {len(self.masks)}")
        if self.ignored is not None and len(self.ignored) != len(times):
            raise InvalidInputError(f"ignored must have {len(times)} images, one a mask, got {len(self.ignored)}")
        check_static(self.world, self.cloth)
        for k, mask in enumerate(self.masks):
            if not check_mask(mask, self.camera, f"mask {k}").any():
                raise InvalidInputError(f"mask {k} is empty; leave out times at which no cloth was seen")
        object.__setattr__(self, "times", times)

    def watch(self, material: Cloth, device: str | None) -> Callable[[Mapping[str, np.ndarray]], Scores]:
        """Return a function from guesses at the material, (n,) by name, to scores (n, k); the rest is ``material``."""
        real = [
            Silhouette(mask, None if self.ignored is None else self.ignored[k]) for k, mask in enumerate(self.masks)
        ]

        def scores(guesses: Mapping[str, np.ndarray]) -> Scores:
            futures = self.world.imagine(_count(guesses), device=device)
            cloth = futures.find(self.cloth)
            futures.attach(cloth, replace(material, **guesses))
            self.move(futures)
            found = []
            for time, silhouette in zip(self.times, real, strict=True):
                futures.run(time - futures.time, progress=False)
                masks = render_masks(futures, self.camera, cloth, cloth_thickness=self.drawn_thickness)
                found.append(score_masks(masks, silhouette))
            return _by_frame(found)

        return scores


@dataclass(frozen=True, eq=False)
class FoldFootage:
    """A fold that was replayed, seen in some frames of its video.

    Attributes:
        result: The replay; its world as it was before the fold.
        frames: Which frames of those with a real mask are compared.

    Raises:
        InvalidInputError: there is no real mask to compare with.
        BodyStateError: the fold was adopted.
    """

    result: FoldResult
    frames: tuple[int, ...]

    def __post_init__(self) -> None:
        check_static(self.result.world, self.result.fold.body.name)
        if not self.frames:
            raise InvalidInputError("the fold has no frame with a mask to compare with")

    def watch(self, material: Cloth, device: str | None) -> Callable[[Mapping[str, np.ndarray]], Scores]:
        """Return a function from guesses at the material, (n,) by name, to scores (n, k); the rest is ``material``."""
        result, rows = self.result, list(self.frames)
        there, radius = result.hands_seen[rows], max(result.hand_radius, 1e-4)
        spheres, triangles = hand_spheres(result.hands_at[rows], there, radius)
        real = []
        for k in rows:
            ignored = np.zeros_like(result.real[k], dtype=bool)
            for centre in result.hands_at[k][result.hands_seen[k]]:
                ignored |= disc(result.camera, centre, result.hand_radius, HAND_MARGIN)
            real.append(Silhouette(result.real[k], ignored))
        world = result.world
        cloth, table = world.find(result.fold.body.name), world.find("table")
        looking, full = view(result.camera), Region.full(result.camera)

        def scores(guesses: Mapping[str, np.ndarray]) -> Scores:
            count = _count(guesses)
            materials = [replace(material, **{name: float(v[w]) for name, v in guesses.items()}) for w in range(count)]
            fold = imagine_fold(
                world, cloth, result.hands, materials, begin=float(result.times[0]),
                end=float(result.times[rows[-1]]), reach=result.hand_radius + REACH,
            )  # fmt: skip
            at = np.stack([fold.at(result.times[rows], w) for w in range(count)], axis=1)
            where: Any = fold.world.device
            faces = _faces(fold.body.faces, where)
            layer = raster.key_images(1, full, where)
            if table.shape.kind != "plane":
                raster.draw(
                    layer, _points(np.asarray(table.vertices)[None], where), _faces(table.faces, where), looking, 1
                )
            keys = raster.key_images(count, full, where)
            found = []
            for k, silhouette in enumerate(real):
                raster.clear(keys, layer)
                raster.draw(keys, _points(at[k], where), faces, looking, 0, thickness=DRAWN_THICKNESS)
                hands = np.repeat(spheres[k][None], count, axis=0)
                raster.draw(keys, _points(hands, where), _faces(triangles, where), looking, 1)
                found.append(score_masks(keys, silhouette))
            return _by_frame(found)

        return scores


def check_static(world: World, cloth: str) -> None:
    """Raise unless a single world has that cloth, as it was before it was moved.

    Raises:
        InvalidInputError: the world is a batch, or the body no cloth.
        BodyStateError: it is dynamic.
    """
    if world.world_count != 1:
        raise InvalidInputError(f"a single world is needed, got a batch of {world.world_count}")
    body = world.find(cloth)
    if not getattr(body.shape, "is_cloth", False):
        raise InvalidInputError(f"{cloth!r} is no cloth, but a {body.shape.kind}")
    if body.is_dynamic:
        raise BodyStateError(f"{cloth!r} is dynamic; the world must be as it was before the cloth was moved")


def _count(guesses: Mapping[str, np.ndarray]) -> int:
    return len(next(iter(guesses.values())))


def _by_frame(found: list[dict[str, np.ndarray]]) -> Scores:
    return {name: np.stack([scores[name] for scores in found], axis=1) for name in ("chamfer", "iou")}


def _points(values: np.ndarray, device: Any) -> wp.array:
    return wp.array(np.ascontiguousarray(values, dtype=np.float32), dtype=wp.vec3, device=device)


def _faces(values: np.ndarray, device: Any) -> wp.array:
    return wp.array(np.ascontiguousarray(values, dtype=np.int32), dtype=wp.vec3i, device=device)
