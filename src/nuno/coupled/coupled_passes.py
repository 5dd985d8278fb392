"""Kernels around the contacts of coupled bodies: particles in and out of their solvers' layout, and the passes."""

import warp as wp

from nuno.coupled.bounded_particles import Particles, bound_all
from nuno.coupled.caught_links import catch_links
from nuno.coupled.contact_rows import Rows, forget_sharers, take_sums
from nuno.coupled.joint_constraints import begin_joint, joint_at, project_joint, projections_of, settle_spins, sum_joint
from nuno.coupled.joint_contacts import resolve_entries, resolve_others
from nuno.coupled.joint_opening import Trees
from nuno.coupled.joint_response import Joints
from nuno.coupled.joint_tree import project_trees
from nuno.coupled.kept_multipliers import Kept, keep, recall
from nuno.coupled.pass_progress import ENOUGH, Passing, begin_pass, end_pass, goes_on, is_linked, island_of, note_wrong
from nuno.coupled.rigid_supports import link_supports, rubs_both, with_mate
from nuno.coupled.row_projections import drag_row, join_row, push_row
from nuno.coupled.tie_constraints import Holds, Ties, project_hold, project_tie, sum_hold, sum_tie
from nuno.numbers.crew import barrier
from nuno.numbers.warps import anyone
from nuno.rigid.convex import Parts
from nuno.rigid.persistent_manifolds import Contacts
from nuno.rigid.rigid_body import RigidState

LAST_PASSES = wp.constant(4)
"""Passes over friction alone at the end: what the last pushes moved sideways, by normals that differ a little, would
otherwise creep."""
JOINT_PASSES = wp.constant(400)
"""Passes more over joints and the contacts of what is joined, where those moved anything in the last: 5 kg on a flap
of 20 g. Rows are left as they are, for they may not end."""


@wp.struct
class Layout:
    """A solver's particles: x, y, z and the rest as plain numbers, ``lanes`` worlds beside each other.

    Where coordinates are ``doubles``, they are in the arrays with capitals (see `nuno.state.double_positions`).
    """

    particles: int
    lanes: int
    first: int  # of the body's particles among those of the coupled bodies
    doubles: int
    x: wp.array(dtype=float)
    y: wp.array(dtype=float)
    z: wp.array(dtype=float)
    px: wp.array(dtype=float)
    py: wp.array(dtype=float)
    pz: wp.array(dtype=float)
    w: wp.array(dtype=float)
    X: wp.array(dtype=wp.float64)
    Y: wp.array(dtype=wp.float64)
    Z: wp.array(dtype=wp.float64)
    PX: wp.array(dtype=wp.float64)
    PY: wp.array(dtype=wp.float64)
    PZ: wp.array(dtype=wp.float64)
    origin: wp.array(dtype=wp.vec3)  # (worlds), the solver's
    offset: wp.array(dtype=wp.vec3)  # (worlds), from the origin of the body's island to the solver's


@wp.func
def place_of(layout: Layout, world: int, i: int):
    """Return where particle i of a world is in the solver's arrays."""
    return ((world / layout.lanes) * layout.particles + i) * layout.lanes + world % layout.lanes


@wp.kernel(enable_backward=False)
def collect(layout: Layout, particles: Particles, start: wp.array(dtype=wp.vec3)):
    """Copy a body's particles; ``start`` keeps how far they had come, to tell what the contacts moved."""
    world, i = wp.tid()
    k = place_of(layout, world, i)
    j = world * particles.count + layout.first + i
    p = wp.vec3(0.0, 0.0, 0.0)
    u = wp.vec3(0.0, 0.0, 0.0)
    if layout.doubles != 0:
        p = wp.vec3(float(layout.PX[k]), float(layout.PY[k]), float(layout.PZ[k]))
        u = wp.vec3(
            float(layout.X[k] - layout.PX[k]), float(layout.Y[k] - layout.PY[k]), float(layout.Z[k] - layout.PZ[k])
        )
    else:
        p = wp.vec3(layout.px[k], layout.py[k], layout.pz[k])
        u = wp.vec3(layout.x[k], layout.y[k], layout.z[k]) - p
    particles.p[j] = p + layout.offset[world]
    particles.u[j] = u
    start[j] = u
    particles.w[j] = layout.w[k]


@wp.kernel(enable_backward=False)
def scatter(layout: Layout, particles: Particles, start: wp.array(dtype=wp.vec3)):
    """Move a body's particles by what the contacts moved them; what they left alone keeps its bits."""
    world, i = wp.tid()
    k = place_of(layout, world, i)
    j = world * particles.count + layout.first + i
    d = particles.u[j] - start[j]
    if layout.doubles != 0:
        layout.X[k] = layout.X[k] + wp.float64(d[0])
        layout.Y[k] = layout.Y[k] + wp.float64(d[1])
        layout.Z[k] = layout.Z[k] + wp.float64(d[2])
    else:
        layout.x[k] = layout.x[k] + d[0]
        layout.y[k] = layout.y[k] + d[1]
        layout.z[k] = layout.z[k] + d[2]


IMPULSE_UNIT = wp.constant(1.0e-16)
"""[kg m] Step of the sums of multipliers: integers add up to the same whatever the order of threads."""


@wp.kernel(enable_backward=False, module="nuno.coupled.add_impulses")
def add_impulses(rows: Rows, bodies: int, total: wp.array(dtype=wp.int64)):
    """Add what each row gave its first body in the substep to the sum of its pair, by world."""
    world, k = wp.tid()
    if k < rows.active_count[world]:
        r = rows.active[world * rows.room + k]
        if rows.push[r] > 0.0:
            pair = (world * bodies + rows.bodies[r][0]) * bodies + rows.bodies[r][1]
            impulse = rows.push[r] * rows.normal[r] + rows.drag[r]
            for c in range(3):
                wp.atomic_add(total, 3 * pair + c, wp.int64(wp.rint(impulse[c] / IMPULSE_UNIT)))


@wp.kernel(enable_backward=False)
def solve(
    particles: Particles, rigid: RigidState, parts: Parts, manifolds: Contacts, rows: Rows, ties: Ties, holds: Holds,
    joints: Joints, trees: Trees, passing: Passing, kept: Kept, dt: float, fraction: float, passes: int,
    at_once: int, size: int, first_world: int,
):  # fmt: skip
    """All contacts and ties of a world, up to ``passes`` times: contacts one after the other, or all ``at_once``."""
    tid = wp.tid()
    world = first_world + tid / size
    rank = tid % size
    first = world * particles.count
    start = world * rigid.capacity
    base = world * rows.room
    count = rows.active_count[world]
    if rank == 0:
        for k in range(ties.count):
            ties.pull[world * ties.count + k] = wp.vec3(0.0, 0.0, 0.0)
        for k in range(holds.count):
            holds.pull[world * holds.count + k] = wp.vec3(0.0, 0.0, 0.0)
            holds.twist[world * holds.count + k] = wp.vec3(0.0, 0.0, 0.0)
        for k in range(joints.count):
            begin_joint(joints, world, k)
    linked_count = int(0)
    if at_once == 0:
        linked_count = link_supports(particles, rows, passing, world, first, base, count)
        if linked_count > 0:
            recall(kept, particles, rigid, rows, passing, world, first, start, base, count, fraction, ties.step)
    done = int(0)
    rowed = passes + LAST_PASSES
    k_pass = int(0)
    while done == 0 and k_pass < rowed + JOINT_PASSES:
        # from the last pass over rows on only contacts of what is joined say whether passes go on
        counts = k_pass + 1 < rowed
        wrong = float(0.0)
        begin_pass(passing, world, wp.where(k_pass == 0, 1, 0), rank, size)
        # what moved them since: the elastic constraints, the pass before, ties
        if k_pass < rowed:
            bound_all(particles, world, rank, size)
        barrier(size)
        visits = wp.where(k_pass < rowed, count, 0)
        if linked_count > 0 and k_pass % 2 == 1:
            visits = 2 * visits
        for k in range(rank, visits, size):
            # rows of linked islands forth and back: pass after pass the one way would drive what rests
            back = k >= count
            r = rows.active[base + wp.where(back, 2 * count - 1 - k, k)]
            island = island_of(passing, world, rows.bodies[r][0])
            linked = int(0)
            solved = bool(False)
            turn = bool(True)
            if linked_count > 0:
                linked = is_linked(passing, world, rows.bodies[r][0])
                solved = linked != 0 and with_mate(rows, r, k_pass)
                turn = k_pass % 2 == 0 or back == (linked != 0)
            if turn and goes_on(passing, island):
                off = float(0.0)
                joins = at_once != 0 and rows.sharing[r] == 0
                if k_pass < passes:
                    if joins:
                        off = join_row(particles, rigid, first, start, rows, r)
                    elif not solved:
                        off = push_row(particles, rigid, first, start, rows, r, linked, at_once)
                if not joins and not (solved and rubs_both(particles, start, rows, r)):
                    off = wp.max(off, drag_row(particles, rigid, first, start, rows, r, linked, at_once))
                if counts:
                    note_wrong(passing, island, off, size)
                    wrong = wp.max(wrong, off)
        barrier(size)
        if at_once != 0:
            take_sums(particles, rigid, first, start, rank, size)
            barrier(size)
        if joints.count > 0 or linked_count > 0:
            off = resolve_entries(rigid, parts, manifolds, joints, passing, world, dt, k_pass, counts, rank, size)
            wrong = wp.max(wrong, off)
        if rank == 0:
            for k in range(ties.count):
                island = island_of(passing, world, ties.body[k])
                if goes_on(passing, island):
                    off = project_tie(particles, rigid, ties, world, k, dt, fraction)
                    if counts:
                        note_wrong(passing, island, off, size)
                        wrong = wp.max(wrong, off)
            for k in range(holds.count):
                island = island_of(passing, world, holds.body[k])
                if goes_on(passing, island) and holds.limit[world * holds.count + k] >= 0.0:
                    off = project_hold(rigid, holds, world, k, dt, fraction)
                    if counts:
                        note_wrong(passing, island, off, size)
                        wrong = wp.max(wrong, off)
            project_trees(rigid, joints, trees, passing, world, dt, k_pass)
            for t in range(trees.count):
                off = trees.wrong[world * trees.count + t]
                island = island_of(passing, world, joints.body[trees.joint[t]])
                if counts and goes_on(passing, island):
                    note_wrong(passing, island, off, size)
                    wrong = wp.max(wrong, off)
            for at in range(projections_of(trees.lone)):
                k = trees.alone[joint_at(trees.lone, at)]
                island = island_of(passing, world, joints.body[k])
                if goes_on(passing, island):
                    off = project_joint(rigid, joints, world, k, dt)
                    if counts:
                        note_wrong(passing, island, off, size)
                        wrong = wp.max(wrong, off)
        barrier(size)
        end_pass(passing, world, rank, size)
        if size == 1 and wrong < ENOUGH:
            done = 1
        if size > 1:
            # all threads come here, and all get the same answer
            if not anyone(wrong >= ENOUGH):
                done = 1
        k_pass += 1
    if linked_count > 0:
        keep(kept, rows, passing, world, first, base, count, fraction)
    if rank == 0:
        for k in range(joints.count):
            settle_spins(rigid, joints, world, k, dt)
        for k in range(ties.count):
            sum_tie(particles, rigid, ties, world, k, dt, fraction)
        for k in range(holds.count):
            if holds.limit[world * holds.count + k] >= 0.0:
                sum_hold(rigid, holds, world, k, dt, fraction)
        for k in range(joints.count):
            sum_joint(rigid, joints, world, k, dt)
        if joints.count > 0:
            catch_links(rigid, passing, world)
    if at_once != 0:
        bound_all(particles, world, rank, size)
        barrier(size)
        forget_sharers(particles, rigid, first, start, rank, size)


@wp.kernel(enable_backward=False)
def end_contacts(
    rigid: RigidState, parts: Parts, manifolds: Contacts, joints: Joints, passing: Passing, dt: float, size: int,
    first_world: int,
):  # fmt: skip
    """One pass over the positions of rigid bodies that touch, where joints are: those without any had none yet."""
    tid = wp.tid()
    resolve_others(rigid, parts, manifolds, joints, passing, first_world + tid / size, dt, tid % size, size)
