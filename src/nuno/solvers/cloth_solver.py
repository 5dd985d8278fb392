"""One dynamic cloth in one or many worlds: its arrays on the device, and the plan that runs it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from nuno.bodies.resolution import Resolution
from nuno.constraints.compliances import compliances, vertex_masses
from nuno.constraints.relaxation import PLAIN, RELAXATIONS, softening, stiffness_share, sweeps_for
from nuno.contact.self.cpu_scratch import listing_room
from nuno.contact.self.list_skin import boxes
from nuno.contact.self.narrow_phase import GROUP
from nuno.numbers.lanes import LANES
from nuno.plans.group_plan import GridPlan, cores_of
from nuno.plans.recorded_launches import RecordedLaunches
from nuno.solvers.cloth_launches import ClothLaunches
from nuno.solvers.cloth_substeps import bearable_tension, bending_share, default_substeps, wanted_substeps
from nuno.solvers.coloured_sides import put_sides
from nuno.solvers.pair_capacity import find_missed, lengthen_lists, size_lists
from nuno.state.cloth_state import (
    COUNTS,
    LISTINGS,
    NOTES,
    ORIGIN,
    SCALARS,
    TRAVEL,
    WORK_COUNTS,
    Settings,
    Sizes,
    StateDouble,
    StateDoubleLanes,
    StateFloat,
    StateLanes,
    Topology,
)
from nuno.state.double_positions import DOUBLE_RATE, DoublePositions
from nuno.state.upload import upload, upload_leaves
from nuno.topology.cloth_topology import ClothTopology

if TYPE_CHECKING:
    from nuno.materials import Cloth

MAX_SPARE_BLOCKS = 7
"""Blocks that help one world list its pairs, at most."""
LIST_MARGIN = 0.45
"""Margin over the size of a cell of the lists of the plans "grid" and "vector": lists are few, and a world by itself
waits for no other's candidates. With the largest thickness, half a cell, it is less than a cell, so that flat cloth
still has no candidates."""
STRETCHED = 1.2
"""Factor by which an edge is taken to be longer than at rest at most, where it is asked what may touch it."""
PASSES = 2
"""Times that contacts are solved in a substep. Once leaves some of an approach undone where a particle has several: a
pair that is pressed on comes through bit by bit, and what is left over turns into spin."""


class ClothSolver(ClothLaunches):
    """A cloth's state and how it advances.

    Args:
        topology: The cloth's elements.
        material: A `nuno.materials.Cloth`.
        positions: (worlds, n, 3) float [m].
        velocities: (worlds, n, 3) float [m/s]; None leaves all at zero until ``load_state``.
        device: "cpu" or "cuda:0" ...
        gravity: (3,) [m/s2].
        frame_rate: Frames a second.
        substeps: Substeps a frame, of one pass each; None takes `default_substeps`, of as many sweeps through shear and
            stretch as `nuno.constraints.relaxation.sweeps_for` says.
        friction: Friction coefficient of the body; None takes the material's. A number or one per world.
        self_contact: Whether the cloth collides with itself.
        plan: "auto", "fused" (a thread per world or sixteen worlds, or a block per world), "vector" (one world on
            the CPU by sixteen elements at a time) or "grid" (all blocks of a CUDA device together).

    Limitations: one pass a substep, or a few, so that what is much stiffer than m / dt^2 comes out softer than stated,
    by as much as ``resolution`` says, except along a sheet's grid lines, which are solved exactly; damping acts on
    bending alone.
    """

    def __init__(
        self,
        topology: ClothTopology,
        material: Cloth,
        positions: np.ndarray,
        velocities: np.ndarray | None,
        *,
        device: str = "cpu",
        gravity: Sequence[float] = (0.0, 0.0, -9.81),
        frame_rate: float = 60.0,
        substeps: int | None = None,
        friction: float | np.ndarray | None = None,
        self_contact: bool = True,
        plan: str = "auto",
    ) -> None:
        # block groups have one world after the other, also where that is tried out on the CPU
        self._prepare(positions, device, gravity, frame_rate, lanes=plan != "grid")
        self.topology, self.cell_size = topology, topology.cell_size
        self._launches = RecordedLaunches(self.device, 1)
        down = float(np.linalg.norm(self.gravity))
        values = material.resolved(self.world_count, topology.element_count)
        rigidity = max(float(values[f"bending_rigidity_{side}"].max()) for side in ("warp", "weft"))
        soft = softening(topology, values)
        self._softening = max(soft.values())
        frame, density = 1.0 / frame_rate, float(values["area_density"].min())
        stiffness = max(float(values[f"stretch_stiffness_{side}"].max()) for side in ("warp", "weft"))
        rule = (down, frame, density, rigidity, self._softening, stiffness, float(values["max_tension"].max()))
        self.substeps = int(substeps) if substeps else default_substeps(topology, *rule)
        # substeps that are given are taken as they are, one pass each
        self.sweeps = (
            0 if substeps else sweeps_for(self._softening * (frame / self.substeps) ** 2, len(topology.triangles) > 0)
        )
        self.resolution = self._resolution(bool(substeps), wanted_substeps(topology, *rule), soft, density, rigidity)
        self.self_contact = self_contact
        self.passes = PASSES  # over contacts of the cloth with itself, in a substep
        self._all_edges = False  # whether a sheet's diagonals collide with all edges
        # see `nuno.world.impacts`: frames for which the cloth is guarded, and vain attempts to take it apart
        self.guarded, self.tangled = np.zeros((2, self.world_count), dtype=np.int32)
        self.shared_memory = True
        self.plan = self._choose_plan(plan)
        self._grid: GridPlan | None = None
        self._left_out = self._crowded = False
        self._simd: Any = None
        # what a block group shares out, and its room for listing pairs
        self._shares: tuple[int, Any] | None = None
        self._lists: Any = None
        self._build(values, friction)
        self._start(positions, velocities)

    def _resolution(
        self, given: bool, wanted: int, soft: dict[str, float], density: float, rigidity: float
    ) -> Resolution:
        step = 1.0 / (self.frame_rate * self.substeps)
        share = {name: min(1.0, stiffness_share(q * step**2, self.sweeps)) for name, q in soft.items()}
        bending = bending_share(self.topology, step, density, rigidity)
        capped = not given and wanted > self.substeps
        if capped:  # so many may be given, but then each is one plain pass
            wanted = max(wanted, math.ceil(math.sqrt(self._softening / PLAIN) / self.frame_rate))
        tension = None
        if len(self.topology.edges):
            doubles = not given or self.frame_rate * self.substeps >= DOUBLE_RATE
            tension = bearable_tension(self.topology, step, density, doubles)
        parts = share["stretch"], share["shear"], bending
        return Resolution(self.substeps, given, wanted, capped, max(1, self.sweeps), *parts, tension)

    def bearable_tension(self) -> np.ndarray:
        """(worlds,) [N/m], the tension that a sheet bears in substeps as long as the last were."""
        density = (self.mass / self.topology.area).min(axis=1)
        step = np.reshape(self.last_dt, -1)
        plain, turned = (bearable_tension(self.topology, 1.0, 1.0, doubles) for doubles in (False, True))
        return density * np.where(self.doubles.count_in(step), turned, plain) / step**2

    def _build(self, values: dict[str, np.ndarray], friction: float | np.ndarray | None) -> None:
        topology, worlds, n = self.topology, self.world_count, self.particle_count
        state = StateLanes() if self.lanes > 1 else StateFloat()
        size = Sizes()
        topo = Topology()
        shared = upload(topology, self.device)
        for name, value in shared.items():
            setattr(topo, name, value)
        topo.particles, topo.leaves, topo.columns = n, topology.leaves.count, topology.leaves.columns
        put_sides(topo, topology, self.device, STRETCHED)
        self._size, self.state, self.device_topology, self._surface = size, state, topo, topo
        self.doubles = DoublePositions(self, StateDoubleLanes if self.lanes > 1 else StateDouble, self._double_rate)

        found = compliances(topology, values)
        for kind in ("stretch", "shear", "bend"):
            table = getattr(found, kind)
            setattr(state, f"{kind}_compliance", self._put(table))
            setattr(size, f"{kind}_compliance", table.shape[1])
        self._compliances = found
        # as `nuno.solvers.line_tension` reads it: world by world in every plan
        self.stretch_table: wp.array = wp.array(
            np.asarray(found.stretch, dtype=np.float32), dtype=float, device=self.device
        )
        for kind, place in found.place.items():
            dtype = int if place.ndim == 1 else wp.vec3i
            setattr(topo, f"{kind}_compliance", wp.array(place, dtype=dtype, device=self.device))
        density = values["area_density"]
        self._set_masses(vertex_masses(topology, density[:1] if (density == density[:1]).all() else density))
        own = (
            values["friction"]
            if friction is None
            else np.broadcast_to(np.asarray(friction, float).reshape(-1, 1), (worlds, 1))
        )
        # thicker than half a cell, layers of one fold would push their own neighbours apart
        thickness = np.minimum(values["thickness"], 0.5 * topology.cell_size)
        self.scalars = np.zeros((worlds, SCALARS), dtype=np.float32)
        self.scalars[:, :ORIGIN] = np.concatenate([values["air_drag"], own, values["damping"], thickness], axis=1)
        self._damped = bool(np.any(values["damping"] > 0))
        self._allocate()

    def _allocate(self) -> None:
        """Room for what the kernels keep for themselves."""
        state, size, n, empty = self.state, self._size, self.particle_count, self._empty
        leaves = self.topology.leaves
        # boxes of blocks, and of groups of blocks, six numbers each
        size.bounds = 6 * (leaves.count + -(-leaves.count // GROUP))
        size.reference = 3 * n + 8 if self.self_contact else 1
        size.leaf_pairs = 1
        if self._cuda and self.self_contact and self.plan != "grid":
            # and boxes of what each block moved; pairs of blocks: all, or of many 128 each
            size.bounds += 6 * leaves.count
            size.leaf_pairs = 1 + min(leaves.count * (leaves.count + 1) // 2, 128 * leaves.count)
        if self.plan == "grid":
            # see `nuno.contact.self.list_skin`
            size.bounds = max(size.bounds, 2 * 6 * boxes(leaves.count))
        size.middle = self._listing_numbers() if self.self_contact else 1
        size_lists(size, n, self.world_count)
        if not self.self_contact:
            size.vertex_triangle = size.edge_edge = 1
        size.moved = 4 * n if self._cuda or self.plan == "grid" else 1

        self._allocate_particles()
        size.edges = max(1, len(self.topology.edges))
        for name in ("grid_line_gain", "grid_line_pull", "grid_line_inverse"):
            setattr(state, name, empty(size.edges, self._number))
        swept = self.sweeps > 0 and self.plan != "vector"  # which has rooms of its own
        size.goals = size.edges if swept else 1
        size.cells = max(1, len(self.topology.cells)) if swept else 1
        size.triangles = max(1, 3 * len(self.topology.triangles)) if swept else 1
        state.grid_line_goal = empty(size.goals, self._number)
        state.cell_sum, state.triangle_sum = empty(size.cells, self._number), empty(size.triangles, self._number)
        state.bounds = empty(size.bounds, self._number)
        state.reference = empty(size.reference, self._number)
        state.middle = empty(size.middle, self._number)
        state.moved = empty(size.moved, int)
        self._allocate_lists()

    def save_state(self) -> dict[str, np.ndarray]:
        """As of all particles, and for how many frames more the cloth is guarded: see `nuno.world.impacts`."""
        return super().save_state() | {"guarded": self.guarded.copy()}

    def load_state(self, state: dict[str, np.ndarray]) -> None:
        """As of all particles; a state without it is of a cloth that is not guarded."""
        super().load_state(state)
        self.guarded = np.array(np.broadcast_to(state.get("guarded", np.int32(0)), (self.world_count,)))

    def keep(self) -> Any:
        """As of all particles, and for how many frames more the cloth is guarded."""
        return super().keep(), self.guarded.copy()

    def put_back(self, kept: Any) -> None:
        """Set the state that `keep` kept."""
        super().put_back(kept[0])
        self.guarded = kept[1].copy()

    def velocities_apart(self, kept: Any = None) -> tuple[np.ndarray, ...]:
        """As of all particles."""
        return super().velocities_apart(None if kept is None else kept[0])

    def guard(self, passes: int, diagonals: bool) -> None:
        """Set how contacts of the cloth with itself are found and solved in what runs next, which lists pairs anew.

        Args:
            passes: Over contacts in a substep.
            diagonals: Whether a sheet's diagonals collide with all edges, or at creases alone.
        """
        self.passes = passes
        if not self.self_contact or not len(self.topology.cells) or diagonals == self._all_edges:
            return
        self._all_edges = diagonals
        for name, array in upload_leaves(self.topology, diagonals, self.device).items():
            setattr(self.device_topology, name, array)
        room = self._listing_numbers()
        if room > self._size.middle:
            self._size.middle = room
            self.state.middle = self._empty(room, self._number)
        notes = self.download(self.state.notes, NOTES).copy()
        notes[:, TRAVEL] = 1.0e9
        wp.copy(self.state.notes, self._put(notes))
        self._forget_launches()

    def _listing_numbers(self) -> int:
        """Room a world or group of lanes for spheres of all elements, or on the CPU for the listing of one world."""
        leaves = self.topology.leaves
        elements = len(leaves.face), len(leaves.edge) + (len(self.topology.cells) if self._all_edges else 0)
        if self._cuda or self.plan == "grid":
            return 4 * sum(elements)
        return -(-listing_room(self.particle_count, *elements, leaves.count) // self.lanes)

    def _allocate_lists(self) -> None:
        """Room for candidate pairs, none of them listed.

        Those that kernels solve stand as all numbers of a world or of lanes do. What the CPU lists and picks, for one
        world after the other, stands world by world.
        """
        state, size, empty = self.state, self._size, self._empty
        state.vertex_triangle = self._list(4 * size.vertex_triangle)
        state.edge_edge = self._list(4 * size.edge_edge)
        state.pair_count = empty(COUNTS, self._integer)
        state.active_count = empty(2, self._integer)
        state.active_triangle = self._list(4 * size.vertex_triangle)
        state.active_edge = self._list(4 * size.edge_edge)
        if self._cuda or self.plan == "grid":  # solve all that is picked
            state.inner_triangle, state.inner_edge = state.active_triangle, state.active_edge
            state.inner_count = state.active_count
        else:
            state.inner_triangle = self._list(4 * size.vertex_triangle)
            state.inner_edge = self._list(4 * size.edge_edge)
            state.inner_count = empty(2, self._integer)
        state.leaf_pairs = empty(size.leaf_pairs, self._integer)
        self._counts = state.pair_count
        self._allocate_work_queue()

    def _list(self, count: int) -> wp.array:
        """Zeros, whole numbers, ``count`` a world or group of lanes; on the CPU they take memory once written to."""
        if self._cuda:
            return self._empty(count, self._integer)
        rows = self.group_count * count
        # of the last pairs a whole vector is read, too
        values = np.zeros((rows + LANES, self.lanes) if self.lanes > 1 else rows + LANES, dtype=np.int32)[:rows]
        return wp.array(values, dtype=self._integer, device=self.device, copy=False)

    def _allocate_work_queue(self) -> None:
        """Room for blocks that help others list pairs: as many as there are multiprocessors without a world."""
        state, worlds, cores = self.state, self.world_count, 0
        if self._cuda and self.plan != "grid" and self.self_contact:
            cores = cores_of(self.device)
        state.spare_blocks = max(0, min(cores - worlds, MAX_SPARE_BLOCKS * worlds))
        room = state.spare_blocks * 4 * self._size.edge_edge
        state.work_counts = wp.zeros(self.group_count * WORK_COUNTS, dtype=int, device=self.device)
        state.work_queue = wp.zeros(max(1, room), dtype=int, device=self.device)

    @property
    def pair_counts(self) -> np.ndarray:
        """(worlds, 2) int: listed vertex-triangle and edge-edge candidates, those that did not fit included."""
        return self.download(self.state.pair_count, COUNTS)[:, :2]

    @property
    def listings(self) -> np.ndarray:
        """(worlds,) float, how often pairs were listed since the state was set."""
        return self.download(self.state.notes, NOTES)[:, LISTINGS]

    def make_room(self) -> bool:
        """Make lists longer that were too short by the last counts; return whether the run's state is not to be used.

        So it is where contacts were passed over in it, or parts of substeps as blocks found no room on the device.
        """
        left_out = self._left_out or (self._grid is not None and self._grid.left_out())
        self._left_out = False
        if left_out:  # the run that is gone through again must not find the device too busy once more
            self._crowded, self._grid = True, None
        counts = self.download(self.state.pair_count, COUNTS) if self._counted is None else self._counted
        self._counted = None
        missed = find_missed(self._size, counts)
        if not missed.any():
            return left_out
        rows = max(self.group_count, self.state.spare_blocks)
        longer = lengthen_lists(self._size, counts, self.group_count * self.lanes, rows, self.device)
        if longer:
            self._allocate_lists()
            self._forget_launches()
        else:
            self.missed |= missed
            self.state.pair_count.zero_()  # tells of what comes after this
        # what is listed now is gone
        notes = self.download(self.state.notes, NOTES).copy()
        notes[:, TRAVEL] = 1.0e9
        wp.copy(self.state.notes, self._put(notes))
        return longer or left_out

    def settings(self, time: float, dt: float, frame: int) -> Settings:
        """As of all particles, with lists as wide as the plan wants them."""
        run = super().settings(time, dt, frame)
        run.passes = self.passes
        if self.plan in ("grid", "vector"):
            run.margin = LIST_MARGIN * self.cell_size
        run.sweeps = self.sweeps
        run.rise, run.onset = RELAXATIONS[self.sweeps]
        return run
