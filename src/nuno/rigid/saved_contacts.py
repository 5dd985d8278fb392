"""The contacts of a rigid body as part of what is saved of it, and written back where its rows are then.

A contact is with a part of another body, which is named by that body's slot and its own number among the body's parts:
the rows of parts may be others when it is written back.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from nuno.rigid.persistent_manifolds import NOTES
from nuno.rigid.rigid_arrays import ENTRY, POINT, RigidArrays

LASTING = (*ENTRY, *POINT)
"""Arrays of `Contacts` that outlast a substep."""
LISTING = {"notes": NOTES, "listed_position": 3, "listed_rotation": 4}
"""Arrays of `Contacts` that say when pairs are listed anew, and how many numbers make a row of each."""


def save_contacts(arrays: RigidArrays, slot: int) -> dict[str, np.ndarray]:
    """Return the contacts in the rows of a body's parts, (worlds, parts, row, ...) each."""
    rows = arrays.part_rows[slot]
    owner = np.full(arrays.manifolds.parts + 1, -1)  # one more, for the partner -1
    which = np.full(arrays.manifolds.parts + 1, -1)
    for other, theirs in arrays.part_rows.items():
        owner[theirs], which[theirs] = other, np.arange(len(theirs))
    saved = {f"contact_{name}": arrays._entries(name)[:, rows].copy() for name in LASTING}
    partner = saved.pop("contact_partner")
    return saved | {"partner_slot": owner[partner], "partner_part": which[partner]}


def load_contacts(arrays: RigidArrays, slot: int, state: Mapping[str, np.ndarray]) -> None:
    """Write back what `save_contacts` gave, also of one world for all; contacts with bodies that are gone are none."""
    width = state["contact_count"].shape[2]
    while width > arrays.manifolds.row:
        arrays.make_room()
    partner = np.full(state["partner_slot"].shape, -1, dtype=np.int32)
    for other, theirs in arrays.part_rows.items():
        for k, row in enumerate(theirs):
            partner[(state["partner_slot"] == other) & (state["partner_part"] == k)] = row
    values = {name: state[f"contact_{name}"] for name in LASTING if name != "partner"}
    values |= {"partner": partner, "count": np.where(partner < 0, 0, values["count"]).astype(np.int32)}
    for name, saved in values.items():
        table = getattr(arrays.manifolds, name).reshape(arrays._entry_shape(name))
        for k, row in enumerate(arrays.part_rows[slot]):
            block = np.broadcast_to(saved[:, k], (arrays.world_count, *saved.shape[2:]))
            table[:, row, :width].assign(np.ascontiguousarray(block))
            if width < arrays.manifolds.row and name in ("partner", "count"):
                table[:, row, width:].fill_(-1 if name == "partner" else 0)


def save_listing(arrays: RigidArrays) -> dict[str, np.ndarray]:
    """Return what decides when pairs are listed anew, (worlds, rows, numbers) each.

    A pair that is listed earlier may be given its points earlier, at other places of its surfaces.
    """
    return {name: _rows(arrays, name).copy() for name in LISTING}


def load_listing(arrays: RigidArrays, listing: Mapping[str, np.ndarray]) -> None:
    """Write back what `save_listing` gave, also of one world for all."""
    for name in LISTING:
        values = _rows(arrays, name).copy()
        known = min(values.shape[1], listing[name].shape[1])  # no body has a slot beyond
        values[:, :known] = listing[name][:, :known]
        array = getattr(arrays.manifolds, name)
        array.assign(values.reshape(array.numpy().shape))


def _rows(arrays: RigidArrays, name: str) -> np.ndarray:
    return getattr(arrays.manifolds, name).numpy().reshape(arrays.world_count, -1, LISTING[name])
