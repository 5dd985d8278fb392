"""Impulses that static and moving shapes give a body over a frame, summed up substep by substep, shape by shape.

What a shape gives a particle in a substep is its mass times what the shape moves it by, over the length of the substep.
The solver therefore goes by parts, and where particles are is noted before and after its phase of shapes. Where several
shapes are near, the phase is gone through one shape after the other, in the order in which it takes them anyhow, so
that the motion keeps its bits. Edges and triangles of the body meet sharp shapes before that. Where several of these
are near, each is tried alone, and what they did together is shared out by how far each moved a particle then.

Particles that rows press on meet shapes within the rows' passes (`nuno.coupled.shape_bounds`): what these shapes
gave them is added there.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from nuno.coupled.shape_moves import ADD_MOVES, NOTE_LENGTHS, add_bounds
from nuno.plans.recorded_launches import RecordedLaunches
from nuno.solvers.shape_forces import one_of, shape_lists, shapes_of_list
from nuno.state.cloth_state import SHAPES, VELOCITIES

if TYPE_CHECKING:
    from nuno.coupled.bounded_particles import Particles
    from nuno.coupled.coupled_passes import Layout
    from nuno.solvers.particle_solver import ParticleSolver


BLOCK_THREADS = 256
"""Threads of a CUDA block."""


class ShapeImpulses:
    """The sums of one body.

    Args:
        solver: Its solver.
    """

    def __init__(self, solver: ParticleSolver) -> None:
        self._solver = solver
        self._count = solver.group_count * solver.lanes * solver.particle_count
        self._shapes: list[int] = []  # those nearby in the frame, in the order of their sums
        self._keys: tuple[str, ...] = ()
        self._feature_shapes: list[int] = []
        # the lists of shapes nearby, and with one of them alone
        self._shape_list: Any = None
        self._lists_alone: list[wp.array] = []
        self._features_alone: list[wp.array] = []
        self._total = self._array(0, wp.vec3)
        self._lengths = self._array(0, float)
        self._ranks = self._array(0, int)
        self._given: dict[str, np.ndarray] | None = {}
        self._launches = RecordedLaunches(solver.device, BLOCK_THREADS)
        # x, y and z, and what they were, for floats and for doubles
        self._places: dict[Any, tuple[list[wp.array], list[wp.array]]] = {}
        self._w = plain(solver.state.w, float)

    def _array(self, count: int, dtype: Any) -> wp.array:
        return wp.zeros(max(1, count), dtype=dtype, device=self._solver.device)

    # -- a frame

    def begin(self) -> None:
        """Begin the sums of a frame, in whose first substep the shapes nearby have just been listed."""
        solver, s, colliders = self._solver, self._solver.state, self._solver._colliders
        starts = shape_lists(solver)
        shape_list, features = (getattr(s, name).numpy().reshape(solver.group_count, -1) for name in starts)
        self._shapes, self._feature_shapes = (
            shapes_of_list(rows, starts[name])
            for rows, name in ((shape_list, "shape_list"), (features, "feature_shapes"))
        )
        if len(self._shapes) > 1:
            self._shape_list = wp.clone(s.shape_list)
            self._lists_alone = [self._alone(shape, shape_list, starts["shape_list"]) for shape in self._shapes]
            self._features_alone = [
                self._alone(shape, features, starts["feature_shapes"]) for shape in self._feature_shapes
            ]
        self._keys = () if colliders is None else colliders.keys
        self._given = None
        ranks = np.full(max(1, len(self._keys)), -1, dtype=np.int32)
        ranks[self._shapes] = np.arange(len(self._shapes))
        self._ranks = wp.array(ranks, dtype=int, device=solver.device)
        if len(self._total) < len(self._shapes) * self._count:
            self._total = self._array(len(self._shapes) * self._count, wp.vec3)
        self._total.zero_()
        if len(self._feature_shapes) > 1 and len(self._lengths) < len(self._feature_shapes) * self._count:
            self._lengths = self._array(len(self._feature_shapes) * self._count, float)

    def _alone(self, shape: int, rows: np.ndarray, start: int) -> wp.array:
        return wp.array(one_of(shape, rows, start).ravel(), dtype=int, device=self._solver.device)

    def finish(self, index: int) -> None:
        """Do the last parts of a substep, and add up what the shapes gave in it."""
        solver = self._solver
        if len(self._shapes) < 2:
            self._note()
            solver.step_parts(index, SHAPES | VELOCITIES)
            if self._shapes:
                self._add(0)
            return
        s, run = solver.state, solver.opened
        if self._feature_shapes:
            self._try_features(index)
            self._note()
            s.shape_list.zero_()
            solver.step_parts(index, SHAPES)
            for own, shape in enumerate(self._feature_shapes):
                self._add(self._shapes.index(shape), len(self._feature_shapes), own)
        wake, feature_list, features, grips = (
            wp.clone(s.feature_due),
            wp.clone(s.feature_list),
            wp.clone(s.feature_shapes),
            run.grips,
        )
        for rank, alone in enumerate(self._lists_alone):
            if self._feature_shapes or rank:
                # edges and triangles have met all shapes, and vertices that are held are back
                s.feature_shapes.zero_()
                run.grips = 0
            wp.copy(s.shape_list, alone)
            self._note()
            solver.step_parts(index, SHAPES)
            self._add(rank)
            if not self._feature_shapes and rank == 0:
                wake, feature_list = wp.clone(s.feature_due), wp.clone(s.feature_list)
        run.grips = grips
        for array, kept in (
            (s.shape_list, self._shape_list),
            (s.feature_shapes, features),
            (s.feature_due, wake),
            (s.feature_list, feature_list),
        ):
            wp.copy(array, kept)
        solver.step_parts(index, VELOCITIES)

    def _try_features(self, index: int) -> None:
        """Note how far each of several sharp shapes would move the particles by itself; nothing is changed."""
        if len(self._feature_shapes) < 2:
            return
        solver = self._solver
        s, run = solver.state, solver.opened
        grips, places = run.grips, self._note()
        kept = [(array, wp.clone(array)) for array in (s.feature_shapes, s.feature_due, s.feature_list)]
        s.shape_list.zero_()
        run.grips = 0  # what is held stays as light as it is for the constraints
        for own, alone in enumerate(self._features_alone):
            wp.copy(s.feature_shapes, alone)
            s.feature_due.zero_()
            solver.step_parts(index, SHAPES)
            inputs = [*places[0], *places[1], own * self._count, self._lengths]
            self._launches.launch(NOTE_LENGTHS[bool(solver.doubles.count)], self._count, inputs)
            for array, place in zip(*places, strict=True):
                wp.copy(array, place)
        run.grips = grips
        for array, own_kept in kept:
            wp.copy(array, own_kept)

    def add_bounds(self, layout: Layout, particles: Particles) -> None:
        """Add what shapes gave particles while rows were solved that press on them."""
        if self._shapes and particles.count:
            inputs = [layout, particles, self._solver.opened.dt, self._ranks, self._count, self._total]
            self._launches.launch(add_bounds, (self._solver.world_count, particles.count), inputs)

    def _places_now(self) -> tuple[list[wp.array], list[wp.array]]:
        """The particles' places, those that count, and room for what they were."""
        number = wp.float64 if self._solver.doubles.count else wp.float32
        if number not in self._places:
            arrays = [plain(array, number) for array in self._solver.doubles.arrays]
            self._places[number] = arrays, [wp.empty_like(array) for array in arrays]
        return self._places[number]

    def _note(self) -> tuple[list[wp.array], list[wp.array]]:
        """Note where the particles are; return their places and the notes."""
        places = self._places_now()
        for array, before in zip(*places, strict=True):
            wp.copy(before, array)
        return places

    def _add(self, rank: int, sharing: int = 1, own: int = 0) -> None:
        """Add what one shape, or its share of some, has moved since places were noted."""
        now, before = self._places_now()
        inputs = [*now, *before, self._w, self._solver.opened.dt, sharing, own, self._lengths, rank, self._total]
        self._launches.launch(ADD_MOVES[bool(self._solver.doubles.count)], self._count, inputs)

    # -- what it gave

    def given(self) -> dict[str, np.ndarray]:
        """Return what each shape gave the body in the last frame, (worlds, 3) [N s], by the key of its body."""
        if self._given is None:
            solver, shapes = self._solver, len(self._shapes)
            sums = self._total.numpy()[: shapes * self._count].astype(float)
            sums = sums.reshape(shapes, solver.group_count, solver.particle_count, solver.lanes, 3).sum(axis=2)
            sums = sums.reshape(shapes, solver.group_count * solver.lanes, 3)[:, : solver.world_count]
            self._given = {self._keys[shape]: given for shape, given in zip(self._shapes, sums, strict=True)}
        return self._given

    def set_given(self, given: dict[str, np.ndarray]) -> None:
        """Take what `told` returns from now on, until the next frame."""
        self._given = given


def plain(array: wp.array, number: Any) -> wp.array:
    """An array of numbers or of vectors of them as plain numbers, without a copy."""
    count = array.capacity // wp.types.type_size_in_bytes(number)
    return wp.array(ptr=array.ptr, dtype=number, shape=(count,), device=array.device, copy=False)
