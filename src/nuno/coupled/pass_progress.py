"""Progress of the passes over the contacts of coupled bodies, island by island."""

import warp as wp

from nuno.numbers.crew import barrier

ENOUGH = wp.constant(1.0e-8)
"""[m] Passes end once nothing is farther than this from where it should be."""


@wp.struct
class Passing:
    """Progress of the passes, by world and body: of an island, the first body's is that of all.

    What goes together in a world ends its passes by itself, so that an island is what it is without the others.
    """

    bodies: int
    many: int  # whether any world has more than one island
    island: wp.array(dtype=int)
    jointed: wp.array(dtype=int)  # (worlds * bodies), whether the body's island has a joint
    linked: wp.array(dtype=int)  # (worlds * bodies), of an island's first, whether particles lie between rigid bodies
    body_of: wp.array(dtype=int)  # (rigid slots), which of the bodies it is, -1: none
    wrong: wp.array(dtype=float)  # the farthest from where it should be, of this pass [m]
    done: wp.array(dtype=int)


@wp.func
def island_of(passing: Passing, world: int, body: int):
    """Return where the figures of a body's island are; none are kept where each world has one island."""
    k = int(-1)
    if passing.many != 0:
        k = world * passing.bodies + passing.island[world * passing.bodies + body]
    return k


@wp.func
def is_linked(passing: Passing, world: int, body: int):
    """Return True if particles of a body's island lie between rigid bodies."""
    of = world * passing.bodies
    return passing.linked[of + passing.island[of + body]]


@wp.func
def goes_on(passing: Passing, k: int):
    """Return True if an island's passes are not at their end."""
    on = bool(True)
    if k >= 0:
        on = passing.done[k] == 0
    return on


@wp.func
def note_wrong(passing: Passing, k: int, wrong: float, size: int):
    """Raise an island's largest distance."""
    if k >= 0:
        if wrong > passing.wrong[k]:
            if size > 1:
                wp.atomic_max(passing.wrong, k, wrong)
            else:
                passing.wrong[k] = wrong


@wp.func
def begin_pass(passing: Passing, world: int, first: int, rank: int, size: int):
    """Forget distances; before the ``first`` pass of a substep all islands go on."""
    if passing.many != 0:
        for b in range(rank, passing.bodies, size):
            k = world * passing.bodies + b
            passing.wrong[k] = 0.0
            if first != 0:
                passing.done[k] = 0
        barrier(size)


@wp.func
def end_pass(passing: Passing, world: int, rank: int, size: int):
    """End the passes of islands that are where they should be."""
    if passing.many != 0:
        barrier(size)
        for b in range(rank, passing.bodies, size):
            k = world * passing.bodies + b
            if passing.wrong[k] < ENOUGH:
                passing.done[k] = 1
        barrier(size)
