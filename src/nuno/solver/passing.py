"""How far the passes over the contacts of coupled bodies have come, party by party."""

import warp as wp

from nuno.solver.lanes import barrier

ENOUGH = wp.constant(1.0e-8)
"""[m] Passes end once nothing is farther than this from where it should be."""


@wp.struct
class Passing:
    """How far the passes have come, by world and body: of a party, the first body's is that of all.

    What goes together in a world ends its passes by itself, so that a party is what it is without the others.
    """

    bodies: int
    many: int  # whether any world has more than one party
    party: wp.array(dtype=int)
    jointed: wp.array(dtype=int)  # (worlds * bodies), whether the body's party has a joint
    body_of: wp.array(dtype=int)  # (rigid slots), which of the bodies it is, -1: none
    wrong: wp.array(dtype=float)  # the farthest from where it should be, of this pass [m]
    done: wp.array(dtype=int)


@wp.func
def party_of(passing: Passing, world: int, body: int):
    """Where the figures of a body's party are; none are kept where each world has one party."""
    k = int(-1)
    if passing.many != 0:
        k = world * passing.bodies + passing.party[world * passing.bodies + body]
    return k


@wp.func
def goes_on(passing: Passing, k: int):
    """Whether a party's passes are not at their end."""
    on = bool(True)
    if k >= 0:
        on = passing.done[k] == 0
    return on


@wp.func
def note_wrong(passing: Passing, k: int, wrong: float, threads: int):
    """Raise a party's largest distance."""
    if k >= 0:
        if wrong > passing.wrong[k]:
            if threads > 1:
                wp.atomic_max(passing.wrong, k, wrong)
            else:
                passing.wrong[k] = wrong


@wp.func
def begin_pass(passing: Passing, world: int, first: int, thread: int, threads: int):
    """Forget distances; before the ``first`` pass of a substep all parties go on."""
    if passing.many != 0:
        for b in range(thread, passing.bodies, threads):
            k = world * passing.bodies + b
            passing.wrong[k] = 0.0
            if first != 0:
                passing.done[k] = 0
        barrier(threads)


@wp.func
def end_pass(passing: Passing, world: int, thread: int, threads: int):
    """End the passes of parties that are where they should be."""
    if passing.many != 0:
        barrier(threads)
        for b in range(thread, passing.bodies, threads):
            k = world * passing.bodies + b
            if passing.wrong[k] < ENOUGH:
                passing.done[k] = 1
        barrier(threads)
