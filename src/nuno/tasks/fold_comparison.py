"""FoldComparison: how a folded cloth lies against how it was taught to lie."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from nuno.estimate.layers import Layers, find_layers
from nuno.shapes.surface import closest_points
from nuno.tasks.fold_motion import FoldMotion
from nuno.validation import finite_array


@dataclass(frozen=True, eq=False)
class FoldComparison:
    """A folded cloth, and what was taught, brought to its size and place.

    Attributes:
        distance: Mean distance of the vertices of either surface from the other surface [m], the larger of both ways.
        share: That, of the cloth's longer side.
        doubled: Share of the cloth's area that lies under two or more layers, seen from above.
        taught_doubled: Likewise, of what was taught.
        layers: The cloth's layers.
        taught_layers: The layers of what was taught.
        taught_vertices: (k, 3) float [m], the taught end on this cloth.
    """

    distance: float
    share: float
    doubled: float
    taught_doubled: float
    layers: Layers = field(repr=False)
    taught_layers: Layers = field(repr=False)
    taught_vertices: np.ndarray = field(repr=False)


def compare_fold(motion: FoldMotion, vertices: np.ndarray) -> FoldComparison:
    """Compare how a cloth lies with what its motion was taught to lead to.

    Along the cloth the taught end is scaled by the sides; heights are kept.

    Args:
        motion: The motion.
        vertices: (n, 3) [m], the cloth after it.
    """
    taught, own = motion.taught, finite_array("vertices", vertices, motion.start.shape)
    there = motion.frame.to_world(taught.vertices)
    ways = (
        closest_points(own, there, taught.faces).positions(there, taught.faces) - own,
        closest_points(there, own, motion.faces).positions(own, motion.faces) - there,
    )
    distance = max(float(np.linalg.norm(way, axis=1).mean()) for way in ways)
    fractions = motion.frame.to_cloth(motion.start)[:, :2]
    layers = find_layers(own, motion.faces, fractions)
    taught_layers = find_layers(there, taught.faces, taught.fractions)
    area = float(np.prod(motion.frame.size))
    doubled, taught_doubled = (sum(found.area[1:]) / area for found in (layers, taught_layers))
    return FoldComparison(
        distance, distance / float(motion.frame.size.max()), doubled, taught_doubled, layers, taught_layers, there
    )
