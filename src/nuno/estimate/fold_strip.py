"""The picture of a replayed fold: frames of the video above, the same frames as they were imagined below."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

import numpy as np

from nuno.estimate.fold_view import hand_spheres, paint

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from nuno.camera.camera import Camera
    from nuno.world.world import World


class ReplayedFold(Protocol):
    """A replayed fold as its strip of pictures takes it; `FoldResult` says what each member is."""

    times: np.ndarray
    vertices: np.ndarray
    faces: np.ndarray
    masks: np.ndarray
    real: dict[int, np.ndarray]
    agreement: dict[int, float]
    camera: Camera
    hands_at: np.ndarray
    hands_seen: np.ndarray
    hand_radius: float
    images: dict[int, np.ndarray]

    @property
    def world(self) -> World:
        """The world that it was imagined from."""


def fold_strip(result: ReplayedFold, count: int) -> Figure:
    """Draw the strip with Matplotlib, without pyplot; the real outline is orange below.

    Args:
        result: The fold.
        count: At most so many frames, evenly from the first to the last that has an image (of all where none has).
    """
    from matplotlib.figure import Figure

    shown = sorted(result.images) or list(range(len(result.times)))
    chosen = [shown[k] for k in np.unique(np.linspace(0, len(shown) - 1, max(count, 2)).round().astype(int))]
    camera = result.camera
    spheres, triangles = hand_spheres(result.hands_at[chosen], result.hands_seen[chosen], max(result.hand_radius, 1e-4))
    pictures = paint(
        result.vertices[chosen], result.faces, camera, table=result.world.find("table"), hands=(spheres, triangles),
        device=result.world.device,
    )  # fmt: skip
    x0, y0, x1, y1 = _crop(result)
    aspect = (x1 - x0) / (y1 - y0)
    figure = Figure(figsize=(1.9 * len(chosen), 2 * 1.9 / aspect + 0.9), layout="constrained", facecolor="white")
    axes = figure.subplots(2, len(chosen), squeeze=False)
    for column, k in enumerate(chosen):
        above, below = axes[:, column]
        real = result.images.get(k)
        if real is None:
            real = np.full((camera.height, camera.width, 3), 255, np.uint8)
            if k in result.real:
                real[result.real[k]] = 160
        above.imshow(real[y0:y1, x0:x1])
        below.imshow(pictures[column][y0:y1, x0:x1])
        mask = result.real.get(k)
        if mask is not None and mask.any() and not mask.all():
            below.contour(mask[y0:y1, x0:x1].astype(float), levels=[0.5], colors=["#d95f02"], linewidths=0.8)
        above.set_title(f"{result.times[k]:.2f} s", fontsize=8)
        if k in result.agreement:
            below.set_title(f"overlap {result.agreement[k]:.3f}", fontsize=8)
        for panel in (above, below):
            panel.set(xticks=[], yticks=[])
    for row, name in enumerate(("video", "imagined")):
        axes[row, 0].set_ylabel(name, fontsize=9)
    return figure


def _crop(result: ReplayedFold) -> tuple[int, int, int, int]:
    """The part of the image in which the cloth ever is, with a margin."""
    ever = result.masks.any(axis=0)
    for mask in result.real.values():
        ever = ever | mask
    ys, xs = np.nonzero(ever) if ever.any() else (np.array([0, ever.shape[0] - 1]), np.array([0, ever.shape[1] - 1]))
    margin = max(6, ever.shape[1] // 40)
    return (
        max(int(xs.min()) - margin, 0), max(int(ys.min()) - margin, 0),
        min(int(xs.max()) + margin + 1, ever.shape[1]), min(int(ys.max()) + margin + 1, ever.shape[0]),
    )  # fmt: skip
