"""States of a batch put together from several runs of the same frame, world by world.

Lists of what is near are none of the state: they are forgotten and made anew in the next substep, which changes no bit.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import warp as wp

from nuno.rigid.rigid_arrays import ENTRY, POINT, REPORTED, SAVED
from nuno.rigid.saved_contacts import load_listing, save_listing
from nuno.solvers.particle_solver import ParticleSolver
from nuno.solvers.rigid_solver import DYNAMIC, RigidSolver
from nuno.state.cloth_state import LOADS, NOTES, PARTICLE_ARRAYS, TRAVEL

PAIRS = (*ENTRY, *POINT, *REPORTED, "normal_now", "tangent_now")
"""Arrays of pairs; the last ones are what `RigidSolver` tells of the last frame and substep besides."""

Copied = dict[str, np.ndarray]  # (worlds, ...) each


class KeptParticles:
    """All that a run changes of a cloth or soft body and that outlasts it, on the device until it is asked for.

    Args:
        solver: Whose state, as it is now.
    """

    def __init__(self, solver: ParticleSolver) -> None:
        self._solver = solver
        self._arrays = {name: wp.clone(getattr(solver.state, name)) for name in _columns(solver)}
        self._doubles = [wp.clone(array) for array in solver.doubles.arrays] if solver.doubles.count else []
        self._given = {} if solver.sums is None else dict(solver.sums.given())
        self._last_dt = np.full(solver.world_count, solver.last_dt)
        self._values: Copied | None = None

    @property
    def values(self) -> Copied:
        """The same on the host."""
        if self._values is None:
            solver = self._solver
            counts = _columns(solver)
            self._values = {name: solver.download(array, counts[name]) for name, array in self._arrays.items()}
            if self._doubles:
                self._values |= {f"double_{name}": array for name, array in _downloaded(solver, self._doubles).items()}
            self._values |= {f"given_{key}": impulse for key, impulse in self._given.items()}
            self._values["last_dt"] = self._last_dt
        return self._values


def copy_particles(solver: ParticleSolver) -> Copied:
    """Return all that a run changes of a cloth or soft body and that outlasts it."""
    return {name: array.copy() for name, array in KeptParticles(solver).values.items()}


def mix_particles(solver: ParticleSolver, made: list[tuple[Copied, np.ndarray]]) -> None:
    """Set the state to that of each copy in the worlds (worlds,) bool beside it."""
    for name, count in _columns(solver).items():
        array = getattr(solver.state, name)
        values = solver.download(array, count).copy()
        for copied, worlds in made:
            values[worlds] = copied[name][worlds]
        if name == "notes":
            values[:, TRAVEL] = 1.0e9
        wp.copy(array, solver._put(values))
    _mix_doubles(solver, made)
    last = np.full(solver.world_count, solver.last_dt)
    for copied, worlds in made:
        last[worlds] = copied["last_dt"][worlds]
    solver.last_dt = last
    if solver.sums is not None:
        given: Copied = {}
        for copied, worlds in made:
            for name in (name for name in copied if name.startswith("given_")):
                whole = given.setdefault(name.removeprefix("given_"), np.zeros((solver.world_count, 3)))
                whole[worlds] = copied[name][worlds]
        solver.sums.set_given(given)


def move_particles(solver: ParticleSolver, moved: dict[int, np.ndarray]) -> None:
    """Put the particles of some worlds elsewhere: positions (n, 3) [m] by world. They go on as fast as they were.

    Positions are rounded to floats, also where other worlds of the batch go on in doubles: alone, a world may not.
    """
    if not moved:
        return
    made, worlds = copy_particles(solver), np.zeros(solver.world_count, dtype=bool)
    for world, positions in moved.items():
        worlds[world] = True
        for axis, name in enumerate("xyz"):
            local = (positions[:, axis] - solver.origin[world, axis]).astype(np.float32)
            for kept in (name, f"double_{name}"):
                if kept in made:
                    made[kept][world] = local
    mix_particles(solver, [(made, worlds)])


def _mix_doubles(solver: ParticleSolver, made: list[tuple[Copied, np.ndarray]]) -> None:
    """The same for coordinates that are doubles in some copies; in the others they are the floats'."""
    if not solver.doubles.count and not any("double_x" in copied for copied, _ in made):
        return
    mixed = []
    for name, values in _doubles(solver).items():
        for copied, worlds in made:
            values[worlds] = copied.get(f"double_{name}", copied[name])[worlds]
        mixed.append(values)
    solver.doubles.put(np.stack(mixed, axis=-1))


def _doubles(solver: ParticleSolver) -> Copied:
    """The coordinates that count, as doubles."""
    return _downloaded(solver, solver.doubles.arrays)


def _downloaded(solver: ParticleSolver, arrays: Sequence[wp.array]) -> Copied:
    count, named = solver.particle_count, zip("xyz", arrays, strict=True)
    return {name: solver.download(array, count).astype(np.float64) for name, array in named}


def _columns(solver: ParticleSolver) -> dict[str, int]:
    """Numbers a world of each array."""
    columns = {name: solver.particle_count for name in PARTICLE_ARRAYS if name != "w"}
    return columns | {"notes": NOTES, "grip_load": LOADS * max(1, solver.grip_count)}


def copy_rigid(solver: RigidSolver) -> Copied:
    """Return all that a run changes of rigid bodies and that outlasts it, with a row for each slot or part."""
    solver._load_contacts()
    bodies = {name: _of_bodies(solver, name).numpy().copy() for name in SAVED}
    listing = {f"listing_{name}": array.copy() for name, array in save_listing(solver).items()}
    return bodies | listing | {f"contact_{name}": _of_pairs(solver, name).numpy().copy() for name in PAIRS}


def mix_rigid(solver: RigidSolver, made: list[tuple[Copied, np.ndarray]]) -> None:
    """Set the state to that of each copy in the worlds and slots (worlds, slots) bool beside it.

    When pairs are listed decides bits. A world whose bodies are all given back so goes on with the listing of the last
    copy that it has any of; where others stay as they are, pairs are listed anew.
    """
    for name in SAVED:
        values = _of_bodies(solver, name).numpy().copy()
        for copied, rows in made:
            values[rows] = copied[name][rows]
        _of_bodies(solver, name).assign(values)
    slots = solver.table.parts.slot.numpy()
    for name in PAIRS:
        values = _of_pairs(solver, name).numpy().copy()
        for copied, rows in made:
            # a pair is in the row of the one that moves, or of the smaller of two
            parts = rows[:, np.maximum(slots, 0)] & (slots >= 0)
            kept = copied[f"contact_{name}"]
            width = kept.shape[2]  # rows may have been made longer since
            values[:, :, :width][parts] = kept[parts]
            if name in ("partner", "count", "impulse"):
                values[:, :, width:][parts] = -1 if name == "partner" else 0
        _of_pairs(solver, name).assign(values)
    _mix_listing(solver, made)


def _mix_listing(solver: RigidSolver, made: list[tuple[Copied, np.ndarray]]) -> None:
    covered = np.any([rows for _, rows in made], axis=0)[:, solver._roles == DYNAMIC].all(axis=1)
    listing = {name: array.copy() for name, array in save_listing(solver).items()}
    for copied, rows in made:
        worlds = rows.any(axis=1)
        for name, values in listing.items():
            values[worlds] = copied[f"listing_{name}"][worlds]
    listing["notes"][~covered] = -1.0
    load_listing(solver, listing)


def _of_bodies(solver: RigidSolver, name: str) -> wp.array:
    return getattr(solver.state, name).reshape((solver.world_count, int(solver.state.capacity)))


def _of_pairs(solver: RigidSolver, name: str) -> wp.array:
    return getattr(solver.manifolds, name).reshape(solver._entry_shape(name))
