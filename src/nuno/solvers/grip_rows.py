"""Grips as flat arrays: a row for each held point, in every world."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from nuno.joints.grip import GripSpec

HELD_SHARE = 2.0e-3
"""Share of its inverse mass that a stiffly held vertex has while constraints pull at it: enough that rounding is 0.1 %
of a load in the mean of a frame, and too little to give way."""


@dataclass(frozen=True, eq=False)
class GripRows:
    """Held points, one row of zeros at least.

    Attributes:
        count: Held points, g.
        corner: (worlds, g, 3) int, the vertices about each; -1 where a world does not hold it.
        weight: (worlds, g, 3) float, their barycentric weights.
        times: (g, keys) float, when each is where [s].
        place: (worlds, g, keys, 3) float, where, relative to the world's origin [m].
        mass: (worlds, n) float, inverse masses [1/kg] of all vertices, 0 of those held stiffly.
        held_inverse_mass: (worlds, g) float, the inverse mass with which such a one is pulled at [1/kg].
        ease: (g,) int, 1 where the way between keys is of minimum jerk.
        fixed: (g,) int, 1 where the point is a vertex that is held stiffly.
        compliance: (g,) float [m/N].
    """

    count: int
    corner: np.ndarray
    weight: np.ndarray
    times: np.ndarray
    place: np.ndarray
    mass: np.ndarray
    held_inverse_mass: np.ndarray
    ease: np.ndarray
    fixed: np.ndarray
    compliance: np.ndarray


def grip_rows(grips: Sequence[GripSpec], origin: np.ndarray, inverse_mass: np.ndarray) -> GripRows:
    """Lay out grips for the device.

    Args:
        grips: What is held, and where it goes.
        origin: (worlds, 3) of each world [m].
        inverse_mass: (worlds, n) of the vertices while nothing holds them [1/kg].
    """
    worlds = len(origin)
    entries = [entry for grip in grips for entry in _entries(grip, origin)]
    keys = max([len(e["times"]) for e in entries], default=1)
    count = max(1, len(entries))
    corner = np.full((worlds, count, 3), -1, dtype=np.int32)
    weight = np.zeros((worlds, count, 3), dtype=np.float32)
    place = np.zeros((worlds, count, keys, 3), dtype=np.float32)
    times = np.zeros((count, keys))
    mass = np.array(inverse_mass) if any(e["fixed"] for e in entries) else inverse_mass
    held_inverse_mass = np.ones((worlds, count), dtype=np.float32)
    for g, e in enumerate(entries):
        corner[:, g], weight[:, g] = e["corners"], e["weights"]
        # the first key as often as there are more of another grip: what is led has the same bits beside any other
        more = keys - len(e["times"])
        times[g] = np.concatenate([np.full(more, e["times"][0]), e["times"]])
        place[:, g, more:] = e["positions"]
        place[:, g, :more] = e["positions"][:, :1]
        if e["fixed"]:
            held = np.nonzero(e["corners"][:, 0] >= 0)[0]
            mass[held, e["corners"][held, 0]] = 0.0
            held_inverse_mass[held, g] = HELD_SHARE * inverse_mass[held, e["corners"][held, 0]]
    return GripRows(
        len(entries), corner, weight, times, place, mass, held_inverse_mass,
        np.array([int(e["ease"]) for e in entries] or [0], np.int32),
        np.array([int(e["fixed"]) for e in entries] or [1], np.int32),
        np.array([e["compliance"] for e in entries] or [0.0]),
    )  # fmt: skip


def _entries(grip: GripSpec, origin: np.ndarray) -> list[dict[str, Any]]:
    """The points of one grip."""
    if grip.vertices is not None:
        corners = np.repeat(np.asarray(grip.vertices)[..., None], 3, axis=-1)
        barycentric = np.broadcast_to([1.0, 0.0, 0.0], corners.shape)
    else:
        corners, barycentric = np.asarray(grip.corners), np.asarray(grip.barycentric)
    entries = []
    for k in range(corners.shape[1]):
        single = barycentric[:, k]
        vertex = bool((np.abs(single[:, 0] - 1.0) < 1e-6).all())
        entries.append(
            dict(
                corners=corners[:, k], weights=single, times=np.asarray(grip.times, float),
                positions=np.asarray(grip.positions)[:, k] - origin[:, None],
                ease=grip.interpolation == "minimum_jerk",
                compliance=float(grip.compliance), fixed=vertex and grip.compliance == 0.0,
            )
        )  # fmt: skip
    return entries
