"""A body's surface on a device, by colour: the edges and triangles that sharp shapes touch between vertices."""

from typing import Any

import numpy as np
import warp as wp

from nuno.topology.colouring import by_colour, colour


def coloured_sides(faces: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, int]:
    """Return the edges of triangles (m, 3), each once, and the triangles, both by colour.

    Besides, where each colour starts among the edges and the triangles behind them, and how many colours edges have.
    """
    sides = np.unique(np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1), axis=0)
    order, starts = by_colour(colour(sides, count))
    face_order, face_starts = by_colour(colour(faces, count))
    return (
        sides[order], faces[face_order], np.concatenate([starts, len(sides) + face_starts[1:]]), len(starts) - 1
    )  # fmt: skip


def put_sides(sides: Any, topology: Any, device: str, stretch: float) -> None:
    """Set what `nuno.contact.particle.feature_lists` asks of a surface; the arrays are made once for a topology.

    Args:
        sides: `nuno.state.cloth_state.Topology` of a cloth, or `nuno.state.soft_state.Sides`.
        topology: `ClothTopology` or `SoftTopology`.
        device: "cpu" or "cuda:0" ...
        stretch: How many times as long as at rest an edge is taken to be at most.
    """
    key = device, "sides"
    if key not in topology.device_arrays:
        side, face, starts, colours = coloured_sides(topology.faces, topology.vertex_count)
        longest = float(np.linalg.norm(topology.rest[side[:, 0]] - topology.rest[side[:, 1]], axis=1).max())
        topology.device_arrays[key] = (
            wp.array(side.astype(np.int32), dtype=wp.vec2i, device=device),
            wp.array(face.astype(np.int32), dtype=wp.vec3i, device=device),
            wp.array(starts.astype(np.int32), dtype=int, device=device), colours, longest,
        )  # fmt: skip
    sides.side, sides.face, sides.feature_colour, sides.side_colours, longest = topology.device_arrays[key]
    sides.particles, sides.longest = topology.vertex_count, stretch * longest
