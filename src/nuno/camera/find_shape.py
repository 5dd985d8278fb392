"""Finding a known flat shape, turned and deformed, among clutter: by its outline, and not by its colours."""

from __future__ import annotations

from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import ArrayLike

from nuno.camera.camera import Camera
from nuno.camera.edge_field import EdgeField, edge_field
from nuno.camera.image import check_any_size, check_image
from nuno.camera.table import Table, plane_coordinates, table_margin
from nuno.camera.template_refinement import energy_of, refine_candidate
from nuno.camera.template_search import Candidate, TemplateSearch, Weights
from nuno.camera.triangulated_polygon import (
    TriangulatedPolygon,
    check_outline,
    signed_area,
    triangulate_polygon,
    with_vertices,
)
from nuno.errors import InvalidInputError
from nuno.validation import checked, count, finite_array, flag, number

FOUND = 0.57
"""Score from which a shape is taken to be there; docs/reports/accuracy.md has how often that is wrong."""
FORM = 1.0
"""What a mean deformation of one (singular values e : 1) counts, beside the share of the outline that lies on edges."""
STRETCH = (0.6, 1.1)
"""Lengths between vertices, of the outline's: cloth is pushed together, but hardly stretched."""
_CELLS = 11.0  # cells of the coarse grid along the square root of the shape's area
_LONGEST = 14.0  # cells along a side of the coarse polygon at most
_CELL_PIXELS = 8  # of the plane's picture, along a cell
_LOCATIONS = 4000  # of the grid at most
_COARSE, _DETAILED = 10, 20  # vertices
_CANDIDATES = 12
_BORDER = 0.008  # [m] of a table's top along its border that counts as not seen
_SMALLEST = 16  # [px] across, of the picture that is searched
_SAME = 0.3  # of two instances that share more of their area the better one is kept


@dataclass(frozen=True, eq=False)
class FoundShape:
    """A shape that was found in an image.

    Attributes:
        polygon: (n, 2) float, where the outline is in the image [px].
        outline: (n, 2) float, the points of the known outline that lie there, in its own units.
        on_plane: (n, 3) float, the polygon on the plane [m]; None where no camera was given.
        score: The share of the outline that lies on edges, less what its deformation costs: 1 is certain, below `FOUND`
            the shape is likely not there.
        support: The share of the outline that lies on edges, 0 to 1.
        deformation: Mean over triangles of log^2 of the ratio of their stretches, and of their scale [nats^2].
        scale: Of the image's lengths to the outline's; 1 with a camera.
        mirrored: Whether it lies with its other side up.
        mask: (h, w) bool, what the polygon covers, whether or not something lies on it.
    """

    polygon: np.ndarray
    outline: np.ndarray
    on_plane: np.ndarray | None
    score: float
    support: float
    deformation: float
    scale: float
    mirrored: bool
    mask: np.ndarray = field(repr=False)


@checked
def find_shape(
    image: ArrayLike, outline: ArrayLike, *, camera: Camera | None = None, table: Table | None = None,
    plane_height: float | None = None, scales: ArrayLike = (1.0,), stretch: tuple[float, float] = STRETCH,
    mirrored: bool = False, max_count: int = 1, min_score: float = FOUND,
) -> tuple[FoundShape, ...]:  # fmt: skip
    """Find a known shape, such as a towel's or a shirt's, that lies turned and deformed among other things.

    The shape's polygon is triangulated, and the triangles' deformation is traded for edges of the image along the
    polygon's sides: P. Felzenszwalb, "Representation and Detection of Deformable Shapes" (PAMI 2005). Dynamic
    programming finds the best places on a coarse grid among all, at every angle; the best of them are refined. What
    lies inside and what colours it has do not count, so neither clutter of the same colour nor a pattern hides it. A
    shape of whose outline less than half shows is not found.

    Args:
        image: (h, w, 3) uint8 RGB; without a camera also (h, w) uint8.
        outline: (n, 2) float, the corners of the flat shape in order [m], or [px] without a camera; seen from above, x
            to y anticlockwise as in the world.
        camera: The camera that took it: then the shape lies on a plane, and its size is known.
        table: The table it lies on; where its extents are known only its top is searched.
        plane_height: z of the plane [m], where no table is given.
        scales: (k,) sizes to look for, of the outline's.
        stretch: The least and greatest length between vertices, of the outline's.
        mirrored: Look for the shape's other side too; one that is its own mirror image needs no such look.
        max_count: How many instances to look for.
        min_score: The score from which a shape counts as found; 0 returns the likeliest places in any case.

    Returns:
        What was found, best first, none on another; empty where the shape is not there.

    Raises:
        ImageError: the image is none or does not fit the camera.
        InvalidInputError: an outline whose sides cross or that is smaller than 20 px in the image or larger than what
            is seen; a camera without a table or a plane, or these without a camera; a value out of range.
    """
    points = check_outline(outline)
    sizes = finite_array("scales", scales, ("k",))
    ends = finite_array("stretch", stretch, (2,))
    number("min_score", min_score, low=0.0, high=1.0)
    wanted = count("max_count", max_count, high=64)
    both = flag("mirrored", mirrored)
    if not 0.2 <= ends[0] <= 1.0 <= ends[1] <= 2.0:
        raise InvalidInputError(f"stretch must have 0.2 <= least <= 1 <= greatest <= 2, got {ends.tolist()}")
    if (sizes <= 0).any():
        raise InvalidInputError(f"scales must be positive, got {sizes.tolist()}")
    view = _look(image, camera, table, plane_height, points)
    found: list[FoundShape] = []
    for scale in sizes:
        for turned in (False, True) if both else (False,):
            own = points * (-1.0, 1.0) if turned else points
            own = own[::-1] if turned else own
            found += _at_scale(view, own, float(scale), (float(ends[0]), float(ends[1])), turned, wanted)
    found.sort(key=lambda each: -each.score)
    kept: list[FoundShape] = []
    for each in found:
        if len(kept) < wanted and each.score >= min_score and all(_apart(each, other) for other in kept):
            kept.append(each)
    return tuple(kept)


@dataclass(frozen=True, eq=False)
class _View:
    """A picture in which the shape has its own form: of the plane from above, or the image itself.

    Attributes:
        colours: (h, w, channels) float32.
        seen: (h, w) bool.
        resolution: Of a pixel, in the outline's units.
        origin: (2,) of the first pixel's middle.
        height: Of the plane [m].
        camera: None where the image itself is searched.
        size: Of the image: rows, columns.
    """

    colours: np.ndarray
    seen: np.ndarray
    resolution: float
    origin: np.ndarray
    height: float
    camera: Camera | None
    size: tuple[int, int]

    def in_image(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray | None]:
        """Return the image's pixels of points (n, 2) [px of the view], and their places on the plane (n, 3) or None."""
        plane = points * self.resolution + self.origin
        if self.camera is None:
            return plane, None
        places = np.column_stack([plane, np.full(len(plane), self.height)])
        return self.camera.project(places), places


def _look(
    image: ArrayLike, camera: Camera | None, table: Table | None, plane_height: float | None, outline: np.ndarray
) -> _View:
    """Make the picture that is searched, so fine that the shape's size is some 90 pixels."""
    size = float(np.sqrt(signed_area(outline)))
    wanted = size / (_CELLS * _CELL_PIXELS)
    if camera is None:
        if table is not None or plane_height is not None:
            raise InvalidInputError("a table or plane_height needs the camera that saw it")
        array = check_any_size(image)
        if size < 20.0:
            raise InvalidInputError(f"the outline measures {size:.1f} px across, below the 20 px that can be told")
        rows, columns = array.shape[:2]
        resolution = max(wanted, 1.0)
        small = (max(1, round(columns / resolution)), max(1, round(rows / resolution)))
        colours: np.ndarray = array.astype(np.float32)
        if resolution > 1.0:
            colours = cv2.resize(colours, small, interpolation=cv2.INTER_AREA)
        seen = np.ones(colours.shape[:2], dtype=bool)
        # pixel centres stay where they are: (u + 0.5) / resolution - 0.5
        return _View(colours, seen, resolution, np.full(2, 0.5 * resolution - 0.5), 0.0, None, (rows, columns))
    rgb = check_image(image, camera)
    if (table is None) == (plane_height is None):
        raise InvalidInputError("with a camera, either table or plane_height says where the shape lies")
    height = table.height if table is not None else float(plane_height)  # type: ignore[arg-type]
    xy = plane_coordinates(camera, height, 4)
    top = np.isfinite(xy[..., 0])
    if table is not None and table.half_extents is not None:
        top &= table_margin(table, xy) > 0.0
    elif top.any():  # as far as twice what the image's middle row sees
        away = np.linalg.norm(xy - camera.camera_to_world[:2, 3], axis=-1)
        top &= away <= 2.0 * float(np.median(away[top]))
    if not top.any():
        raise InvalidInputError("the camera does not see the plane on which the shape is to lie")
    low, high = xy[top].min(axis=0), xy[top].max(axis=0)
    metres = camera.depth_of(np.append(0.5 * (low + high), height)) / max(camera.fx, camera.fy)
    if not metres * 20.0 <= size:
        raise InvalidInputError(f"the outline measures {size:.3g} m across, some {size / metres:.0f} px; 20 are needed")
    resolution = max(wanted, 0.5 * float(metres))
    columns, rows = (int(n) for n in np.ceil((high - low) / resolution) + 1)
    if size > 2.0 * float(np.sqrt(np.prod(high - low))):
        raise InvalidInputError(
            f"the outline measures {size:.3g} m across, more than the part of the plane that is seen"
        )
    grid = np.stack(np.meshgrid(np.arange(columns), np.arange(rows)), axis=-1) * resolution + low
    pixels = camera.project(np.concatenate([grid, np.full((rows, columns, 1), height)], axis=-1))
    limit = np.array([camera.width, camera.height])
    seen = np.isfinite(pixels).all(axis=-1) & (pixels > 0).all(axis=-1) & (pixels < limit - 1).all(axis=-1)
    if table is not None and table.half_extents is not None:  # a table's border is no edge of what lies on it
        inside = np.asarray(table.half_extents) - np.abs(grid - np.asarray(table.centre or (0.0, 0.0)))
        seen &= inside.min(axis=-1) > _BORDER
    at = np.where(seen[..., None], pixels, -10.0).astype(np.float32)
    blurred = cv2.GaussianBlur(rgb.astype(np.float32), (0, 0), max(0.5, 0.4 * resolution / float(metres)))
    colours = cv2.remap(blurred, at[..., 0], at[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return _View(colours, seen, resolution, low, height, camera, (camera.height, camera.width))


def _at_scale(
    view: _View, outline: np.ndarray, scale: float, stretch: tuple[float, float], turned: bool, wanted: int
) -> list[FoundShape]:
    """Find the shape at one scale: coarse places by dynamic programming, then finer polygons with shorter steps."""
    in_pixels = outline / view.resolution
    coarse = triangulate_polygon(with_vertices(in_pixels, _COARSE))
    area = scale * float(np.sqrt(signed_area(in_pixels)))
    if area < _SMALLEST:
        raise InvalidInputError(f"at the scale {scale:g} the outline measures {area:.1f} px, {_SMALLEST} are needed")
    rows, columns = view.seen.shape
    longest = scale * float(np.linalg.norm(coarse.points - np.roll(coarse.points, 1, axis=0), axis=1).max())
    cell = max(area / _CELLS, longest / _LONGEST)
    spacing = max(cell, float(np.sqrt(rows * columns / _LOCATIONS)), 2.0)
    spacing = int(np.ceil(spacing)) if spacing > cell else max(2, round(spacing))
    edges = edge_field(np.log(view.colours + 8.0) * 40.0, view.seen)
    weights = Weights(FORM, scale, stretch)
    search = TemplateSearch(coarse, edges.widened(round(0.5 * spacing)), spacing, weights)
    starts = search.best(max(_CANDIDATES, 4 * wanted))
    detailed = triangulate_polygon(with_vertices(in_pixels, _DETAILED))
    edges_near = edges.widened(1)
    step = spacing / 4.0
    edges_around = edges.widened(round(0.25 * spacing))
    refined = [refine_candidate(coarse, start.points, edges_around, step, weights, 2) for start in starts]
    refined.sort(key=lambda each: each.energy)
    found: list[FoundShape] = []
    for each in refined[: 2 * wanted + 2]:
        points = _carried(coarse, each.points, detailed.points)
        best = refine_candidate(detailed, points, edges_near, 0.5 * step, weights, 4)
        best = refine_candidate(detailed, best.points, edges_near, max(0.25 * step, 0.5), weights, 4)
        found.append(_shape(view, detailed, best, edges_near, weights, turned, outline))
    return found


def _carried(polygon: TriangulatedPolygon, points: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Return where points (m, 2) of a plane go if a polygon's vertices go to points (n, 2): by the nearest triangle."""
    corners = polygon.points[polygon.triangles]
    edges = np.stack([corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]], axis=-1)
    shares = np.einsum("tij,mtj->mti", np.linalg.inv(edges), others[:, None] - corners[None, :, 0])
    shares = np.concatenate([1.0 - shares.sum(axis=-1, keepdims=True), shares], axis=-1)
    nearest = shares.min(axis=-1).argmax(axis=-1)
    taken = shares[np.arange(len(others)), nearest]
    return np.einsum("mk,mki->mi", taken, points[polygon.triangles[nearest]])


def _shape(
    view: _View, polygon: TriangulatedPolygon, found: Candidate, edges: EdgeField, weights: Weights, turned: bool,
    outline: np.ndarray,
) -> FoundShape:  # fmt: skip
    support, bent = energy_of(polygon, found.points, edges, weights)
    pixels, places = view.in_image(found.points)
    mask = np.zeros(view.size, dtype=np.uint8)
    if np.isfinite(pixels).all():
        cv2.fillPoly(mask, [np.round(pixels * 16).astype(np.int32)], 1, lineType=cv2.LINE_8, shift=4)
    own = polygon.points * view.resolution
    if turned:
        own = own * (-1.0, 1.0)
    score = float(np.clip(support - weights.form * bent, 0.0, 1.0))
    return FoundShape(pixels, own, places, score, support, bent, weights.scale, turned, mask.astype(bool))


def _apart(one: FoundShape, other: FoundShape) -> bool:
    shared = float((one.mask & other.mask).sum())
    return shared <= _SAME * max(1.0, min(float(one.mask.sum()), float(other.mask.sum())))
