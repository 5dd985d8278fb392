"""Forces with which the next substep begins, bounded where joints say how a body turns.

The forces of the last substep are a good guess of what lasts. Of a body that joints hold, contact forces are one side
alone: the joints that bear them begin with nothing. So it is first moved as if it were free, and joints bring it
back. Of a light link that bears a blow, or that a motor without a limit jams, this was a turn of a radian and more.
Joints go by the arms and axes of where the substep began and did not find back from there: it was thrown.
"""

import warp as wp

from nuno.rigid.manifold import POINTS
from nuno.rigid.pair_motion import Meeting
from nuno.rigid.persistent_manifolds import Contacts
from nuno.rigid.rigid_body import RigidState

GUESSED_ROTATION = wp.constant(0.1)
"""[rad] Rotation of a joined body in a substep, by a first guess of an entry's forces: passes find what is beyond.

Feet that stand and walk and fingers that hold a cube turn by less. With 0.3, links were thrown."""


@wp.func
def guessed_rotation(s: RigidState, c: Contacts, m: Meeting, e: int, dt: float):
    """Return by how much an entry's forces alone turn one of its joined bodies in a substep [rad], the greater one."""
    turn_a = wp.vec3(0.0)
    turn_b = wp.vec3(0.0)
    for k in range(c.count[e]):
        o = e * POINTS + k
        f = c.force[o]
        push = f[0] * m.n + f[1] * m.t + f[2] * m.u
        turn_a = turn_a + wp.cross(c.arm_a[o], push)
        turn_b = turn_b + wp.cross(c.arm_b[o], push)
    most = float(0.0)
    if s.joined[m.i] != 0:
        most = wp.length(s.give[m.i] * turn_a)
    if s.joined[m.j] != 0:
        most = wp.max(most, wp.length(s.give[m.j] * turn_b))
    return dt * dt * most


@wp.func
def bound_guess(s: RigidState, c: Contacts, m: Meeting, e: int, dt: float):
    """Lessen an entry's forces, as the next substep begins with them, where they turn a joined body by too much."""
    if s.joined[m.i] != 0 or s.joined[m.j] != 0:
        rotation = guessed_rotation(s, c, m, e, dt)
        if rotation > GUESSED_ROTATION:
            for k in range(c.count[e]):
                o = e * POINTS + k
                c.force[o] = (GUESSED_ROTATION / rotation) * c.force[o]
