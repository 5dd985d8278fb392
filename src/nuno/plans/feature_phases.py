"""Phases of a substep around sharp shapes: edges and triangles listed once a frame, and pushed out."""

from typing import Any

import warp as wp

from nuno.contact.particle.feature_contact import push_active, push_features, travel_of_substep
from nuno.contact.particle.feature_lists import EARLIEST, TRAVELLED, clear_features, list_features, mark_features
from nuno.contact.particle.shape_contact import measure_box, reset_box, select_shapes, shape_speed_of, sort_shapes
from nuno.numbers.block_group import BlockGroup, grid_barrier, wait_for
from nuno.numbers.crew import Crew
from nuno.numbers.lanes import add, full_like, lane, lane_max  # noqa: F401 (add: Warp takes it for the operator)
from nuno.plans.contact_phases import take_own_moves
from nuno.plans.stage_kernels import BlockShare
from nuno.state.cloth_state import SELF_CONTACT, SPEED, Settings, Shapes, Topology
from nuno.state.soft_state import FarSides


@wp.func
def select_nearby(floats: Any, n: int, surface: Any, run: Settings, shapes: Shapes, crew: Any):
    """Choose the shapes that matter for the next frame, and what sharp ones may touch between vertices."""
    wait_for(crew)
    reset_box(floats, crew.rank)
    clear_features(floats, surface, crew.rank)
    wait_for(crew)
    measure_box(floats, n, crew.rank, crew.size)
    wait_for(crew)
    select_shapes(floats, shapes, float(run.frame) * run.dt, crew.rank, crew.size)
    wait_for(crew)
    sort_shapes(floats, crew.rank)
    wait_for(crew)
    mark_features(floats, surface, run, shapes, crew.rank, crew.size)
    wait_for(crew)
    list_features(floats, surface, crew.rank, crew.size)
    wait_for(crew)


@wp.func
def goes_on(t: Any, surface: FarSides):
    """Return True if the kernel does the substep that comes next: one without sharp shapes, where none is near."""
    return t.feature_shapes[0] == 0


@wp.func
def goes_on(t: Any, surface: Any):
    return True


def _make_clock(name: str, number: type) -> Any:
    """The odometer of edges and triangles, kept by each member: most often there is nothing more to ask about them.

    It has the speed of the fastest shape [m/s], how far anything may have gone since the lists were made, and how far
    it must have gone before anything is active again [m].
    """
    fields = {"shape_speed": number, "travelled": number, "earliest": float}
    return wp.struct(type(name, (), {"__annotations__": fields, "__module__": __name__}))


FeatureClock, FeatureClockLanes = _make_clock("FeatureClock", float), _make_clock("FeatureClockLanes", lane)


@wp.func
def clock_like(like: float):
    """An odometer."""
    return FeatureClock()


@wp.func
def clock_like(like: lane):
    return FeatureClockLanes()


@wp.func
def read_clock(t: Any, shapes: Shapes):
    """The odometer as the run before left it."""
    clock = clock_like(t.notes[SPEED])
    clock.shape_speed = shape_speed_of(t, shapes)
    clock.travelled = t.feature_due[TRAVELLED]
    clock.earliest = lane_max(t.feature_due[EARLIEST])
    return clock


@wp.func
def resolve_features(t: Any, table: Topology, surface: Any, run: Settings, shapes: Shapes, clock: Any, crew: Crew):
    """Edges and triangles against the sharp shapes nearby; returns the odometer."""
    now = clock
    now.travelled = clock.travelled + travel_of_substep(t, run, clock.shape_speed)
    if lane_max(now.travelled) >= clock.earliest:
        now.earliest = push_active(t, surface, run, shapes, now.travelled, crew.rank, crew.size)
        wait_for(crew)
    return now


@wp.func
def resolve_features(
    t: Any, table: BlockShare, surface: Any, run: Settings, shapes: Shapes, clock: Any, crew: BlockGroup
):
    if t.feature_shapes[0] > 0:
        if run.touching != 0 and run.parts & SELF_CONTACT != 0:
            take_own_moves(t, table, crew)
            grid_barrier(crew)
        push_by_first_block(t, surface, run, shapes, crew)
    return clock


@wp.func
def resolve_features(t: Any, table: Any, surface: Any, run: Settings, shapes: Shapes, clock: Any, crew: BlockGroup):
    if t.feature_shapes[0] > 0:
        push_by_first_block(t, surface, run, shapes, crew)
    return clock


@wp.func
def resolve_features(t: Any, table: Any, surface: FarSides, run: Settings, shapes: Shapes, clock: Any, crew: Crew):
    return clock


@wp.func
def resolve_features(t: Any, table: Any, surface: Any, run: Settings, shapes: Shapes, clock: Any, crew: Crew):
    if t.feature_shapes[0] > 0:
        push_features(t, surface, run, shapes, crew.rank, crew.size)
    return clock


@wp.func
def push_by_first_block(t: Any, surface: Any, run: Settings, shapes: Shapes, crew: BlockGroup):
    """Few elements in many colours: by one block, which waits for itself alone."""
    if crew.block == 0:
        push_features(t, surface, run, shapes, crew.rank_in_block, crew.block_size)
    grid_barrier(crew)


@wp.func
def keep_clock(t: Any, table: Topology, clock: Any, crew: Crew):
    """Keep the odometer for the next run, where it is not kept in every substep."""
    if crew.rank == 0:
        t.feature_due[TRAVELLED] = clock.travelled
        t.feature_due[EARLIEST] = full_like(clock.travelled, clock.earliest)


@wp.func
def keep_clock(t: Any, table: Any, clock: Any, crew: Any):
    return
