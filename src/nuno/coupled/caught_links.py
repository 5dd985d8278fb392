"""Bodies that joints join, caught between what cannot go: an arm that goes through a cloth which stands still.

The cloth presses the forearm to one side and the wrist to the other, and the joints between hold both: as a body
between two walls, only that no single link is pressed from both sides (`nuno.rigid.caught_bodies`).
"""

import warp as wp

from nuno.coupled.pass_progress import Passing
from nuno.rigid.caught_bodies import are_opposed
from nuno.rigid.rigid_body import RigidState


@wp.func
def island_of_slot(passing: Passing, world: int, slot: int):
    """Return the first of the bodies of a rigid body's island, or -1."""
    body = passing.body_of[slot]
    if body >= 0:
        body = passing.island[world * passing.bodies + body]
    return body


@wp.func
def catch_links(rigid: RigidState, passing: Passing, world: int):
    """Note which joined bodies are pressed against each other, two and two of an island."""
    start = world * rigid.capacity
    for a in range(rigid.capacity):
        i = start + a
        if rigid.joined[i] != 0 and wp.length_sq(rigid.pressed[i]) > 0.0:
            island = island_of_slot(passing, world, a)
            for b in range(a):
                j = start + b
                if rigid.joined[j] != 0 and are_opposed(rigid.pressed[i], rigid.pressed[j]):
                    if island_of_slot(passing, world, b) == island:
                        rigid.caught[i] = 1
                        rigid.caught[j] = 1
