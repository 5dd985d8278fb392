"""The layout of a world's rigid solver: the slots of its bodies, as part of a snapshot.

Positions on the device are relative to the solver's origin: a copy of a world runs on to the bit only with the same
one. Its contacts are written back by the slots that bodies had.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from nuno.bodies.body import Body
    from nuno.dynamics.rigid_dynamics import RigidScene
    from nuno.world.simulation import Simulation
    from nuno.world.snapshot_records import BodyRecord

DYNAMIC, STATIC, STALE = "dynamic", "static", "stale"


@dataclass(frozen=True, eq=False)
class RigidPlace:
    """The rows of one body in the rigid solver.

    Attributes:
        key: The body's.
        role: "dynamic"; "static", of a body that stands still or follows a path; or "stale", of a static body that has
            gone or changed since, which the next run finds out.
        slot: The body's slot.
        rows: Of its parts, in the table of all parts.
    """

    key: str
    role: str
    slot: int
    rows: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class RigidLayout:
    """The rigid solver of a world, beside the states of its dynamic bodies.

    Attributes:
        origin: (worlds, 3) float64 [m], what positions on the device are relative to.
        places: Of all bodies that the solver knows.
        listing: What `RigidSolver.save_listing` gave.
        is_current: Whether nothing has changed in the world that the solver has not been told of.
    """

    origin: np.ndarray
    places: tuple[RigidPlace, ...]
    listing: dict[str, np.ndarray]
    is_current: bool


def layout_of(world: Simulation) -> RigidLayout | None:
    """Return where a world's bodies are in its rigid solver; None where it has none."""
    scene = world._rigid
    if scene is None:
        return None
    solver, places = scene.solver, []
    for body in world._bodies.values():
        dynamics: Any = body._dynamics
        if dynamics is not None and dynamics.is_rigid:
            places.append(_place(solver, body.key, DYNAMIC, dynamics.slot))
    for key, known in scene.static.items():
        static = world._bodies.get(key)
        fresh = static is not None and not static.is_dynamic and known.is_of(static, static._deformed)
        places.append(_place(solver, key, STATIC if fresh else STALE, known.slot))
    current = scene.is_current(world)
    return RigidLayout(solver.origin.copy(), tuple(places), solver.save_listing(), current)


def scene_for(
    layout: RigidLayout | None, records: Iterable[BodyRecord], bodies: Mapping[str, Body], world: Simulation
) -> RigidScene | None:
    """Return the scene that a snapshot's rigid bodies go into: the world's own where it is laid out as the saved one.

    Else it is a new one, in which each body's place is kept for it; `settle` brings the static ones there.

    Args:
        layout: The snapshot's, whose settings the world has already.
        records: Its bodies.
        bodies: The world's body for each key in the snapshot.
        world: The world.
    """
    if layout is None:
        return None
    if _is_laid_out({record.key: record for record in records}, layout, bodies, world):
        return world._rigid
    from nuno.dynamics.rigid_dynamics import RigidScene

    # a batch takes no more room than it needs; more is made where bodies come
    scene = RigidScene(world, layout.origin, 1 + max((row for place in layout.places for row in place.rows), default=0))
    for place in layout.places:
        # a file may name a body of this process by another key
        key = bodies[place.key].key if place.key in bodies else place.key
        if place.role == STALE:
            scene.keep_stale(key, place.slot, place.rows)
        else:
            scene.kept[key] = (place.slot, place.rows)
    return scene


def bring_static(layout: RigidLayout | None, bodies: Mapping[str, Body], world: Simulation) -> None:
    """Bring the static bodies that the saved solver knew to their places."""
    if layout is None or world._rigid is None:
        return
    for place in layout.places:
        if place.role == STATIC:
            world._rigid.bring_static(bodies[place.key])


def settle(layout: RigidLayout | None, world: Simulation) -> None:
    """Take back when pairs are listed, once all bodies and rules are there."""
    if layout is None or world._rigid is None:
        return
    if layout.is_current:
        world._bring_rigid()
    world._rigid.solver.load_listing(layout.listing)


def _place(solver: Any, key: str, role: str, slot: int) -> RigidPlace:
    return RigidPlace(key, role, slot, tuple(int(row) for row in solver.part_rows[slot]))


def _is_laid_out(
    records: Mapping[str, BodyRecord], layout: RigidLayout, bodies: Mapping[str, Body], world: Simulation
) -> bool:
    """Return True if the world's scene has every body, in the shape that was saved, where the saved one had it."""
    scene = world._rigid
    if scene is None or scene.settings != scene.settings_of(world):
        return False
    if not np.array_equal(scene.solver.origin, np.broadcast_to(layout.origin, scene.solver.origin.shape)):
        return False
    if len(layout.places) != len(scene.solver.part_rows):
        return False
    for place in layout.places:
        if place.role == STALE:
            return False
        body, record = bodies[place.key], records[place.key]
        if place.role == DYNAMIC:
            own: Any = body._dynamics
            if own is None or not own.is_rigid or own.scene is not scene:
                return False
            assert record.dynamics is not None
            slot, same = own.slot, own.fits(record.dynamics.material, world.world_count, record.dynamics.friction)
            same = same and own.has_shape(record.deformation, record.thickness)
        else:
            known = scene.static.get(body.key)
            if known is None:
                return False
            slot, same = known.slot, known.is_of(record, record.deformation)
        if not same or slot != place.slot or tuple(scene.solver.part_rows[slot]) != tuple(place.rows):
            return False
    return True
