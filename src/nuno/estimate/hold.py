"""Estimating by which point a garment is held up that hangs free, from one image or several (Kita's question).

Kita, Ueshiba, Neo and Kita asked it of a pullover and answered it with a model that they deformed for every hold
("Clothes state recognition using 3D observed data", ICRA 2009). Here every candidate is imagined, in one batch.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from nuno.bodies.garment import Garment
from nuno.camera.camera import Camera
from nuno.camera.image import check_image, check_mask
from nuno.errors import InvalidInputError
from nuno.estimate.hold_result import HoldResult
from nuno.estimate.hold_views import HoldView, compare_holds, hold_mask, hold_view
from nuno.estimate.imagined_holds import Holds, imagine_holds
from nuno.validation import checked, count, finite_array, instance, number

TURNS = 24
"""Turns about the vertical at which garments are compared, over the whole circle."""
MAX_IMAGES = 16


@checked
def estimate_hold(
    garment: Garment, images: Sequence[ArrayLike] | ArrayLike, cameras: Camera | Sequence[Camera], hand: ArrayLike, *,
    backgrounds: Sequence[ArrayLike] | ArrayLike | None = None,
    hidden: Sequence[ArrayLike | None] | ArrayLike | None = None, hand_radius: float = 0.014,
    turns: int = TURNS, holds: Holds | None = None, device: str = "auto", progress: bool | None = None,
    **options: Any,
) -> HoldResult:  # fmt: skip
    """Estimate by which point a garment is held up that hangs free.

    The garment is held by every candidate, on both layers, in simulation (`nuno.imagine_holds`), and each result is
    drawn at all turns about the vertical as the cameras would see it and compared with the real silhouettes. What
    counts is how likely they are, averaged over guesses at the material and over turns, which are all as likely as each
    other.

    Args:
        garment: What is held; its cells are those of the imagined cloth.
        images: One, or one for each camera: a mask (h, w) bool of the garment without the hand, or, with
            ``backgrounds``, an RGB image (h, w, 3) uint8.
        cameras: One, or as many. All see the garment at the same moment.
        hand: (3,) the held point [m].
        backgrounds: RGB images of the same scene without the garment, by which it is found.
        hidden: Pixels (h, w) of each image that show something before the garment, such as the arm; None is nothing.
        hand_radius: Radius of what hides the garment around the held point [m].
        turns: How many turns over the whole circle it is compared at.
        holds: What `nuno.imagine_holds` returned for this garment, to use it again; None imagines it.
        device: "auto", "cpu", "cuda:0" ..., where it is imagined.
        progress: Progress bar; None shows one on a terminal.
        options: Those of `nuno.imagine_holds`.

    Raises:
        InvalidInputError: images and cameras do not go together, or holds are of another garment.
        ImageError: an image of another size than its camera's, or without a garment.
        EstimationError: nothing stayed finite.
    """
    instance("garment", garment, Garment)
    point = finite_array("hand", hand, (3,))
    seen_by = [cameras] if isinstance(cameras, Camera) else list(cameras)
    if not seen_by or len(seen_by) > MAX_IMAGES or not all(isinstance(camera, Camera) for camera in seen_by):
        raise InvalidInputError(f"cameras must be a Camera or 1 to {MAX_IMAGES} of them, got {cameras!r}")
    given = _one_each("images", images, len(seen_by))
    without = _one_each("backgrounds", backgrounds, len(seen_by))
    covered = _one_each("hidden", hidden, len(seen_by))
    number("hand_radius", hand_radius, low=0.0, high=1.0)
    count("turns", turns, high=720)
    views = [_seen(*each, point, hand_radius) for each in zip(given, seen_by, without, covered, strict=True)]
    if holds is None:
        holds = imagine_holds(garment, device=device, progress=progress, **options)
    elif not isinstance(holds, Holds) or holds.garment is not garment:
        raise InvalidInputError(f"holds must be what imagine_holds returned for this very garment, got {holds!r}")
    elif options:
        raise InvalidInputError(f"{', '.join(options)} are for imagine_holds, and holds are given")
    angles = np.linspace(0.0, 2.0 * np.pi, turns, endpoint=False)
    return HoldResult.of(holds, tuple(views), point, angles, compare_holds(holds, views, point, angles))


def _one_each(name: str, given: Any, wanted: int) -> list[Any]:
    """Return one value for each camera: those of a sequence, or a single array."""
    if given is None:
        return [None] * wanted
    if isinstance(given, str | Mapping) or not hasattr(given, "__len__"):
        raise InvalidInputError(f"{name} must be an array, or one for each camera, got {type(given).__name__}")
    several = isinstance(given, Sequence) and not (len(given) and np.isscalar(given[0]))
    values = list(given) if several and (wanted > 1 or len(given) == 1) else [given]
    if len(values) != wanted:
        raise InvalidInputError(f"{name} must be one for each of {wanted} cameras, got {len(values)}")
    return values


def _seen(image: Any, camera: Camera, background: Any, hidden: Any, hand: np.ndarray, hand_radius: float) -> HoldView:
    depth = float(camera.depth_of(hand))
    if depth <= 0.0:
        raise InvalidInputError(f"the hand at {hand.tolist()} m is {-depth:.3f} m behind a camera")
    if background is None:
        if isinstance(image, np.ndarray) and image.ndim == 3:
            raise InvalidInputError("an RGB image needs backgrounds, the same scene without the garment; masks do not")
        mask = check_mask(image, camera, "images")
    else:
        mask = hold_mask(check_image(image, camera, "images"), check_image(background, camera, "backgrounds"), camera,
                         hand)  # fmt: skip
    return hold_view(mask, camera, hand, hand_radius, None if hidden is None else check_mask(hidden, camera, "hidden"))
