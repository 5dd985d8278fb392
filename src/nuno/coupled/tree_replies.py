"""Replies of bodies in trees of joints: how a body goes for a force on it, with all that hangs together with it.

A contact that goes by its body's own mass pushes a foot as if it weighed 2 kg. The tree brings it back, and the two
take turns, each time with a few percent less of what is left. By what the tree gives in reply, the contact has its
force at once.

A recursion from the root to the leaves gives a body's inverse inertia with all that hangs on it (Featherstone: "Rigid
Body Dynamics Algorithms", Springer 2008, chapter 7; Khatib's inverse inertia in operational space):

    K = (I - S D^-1 U^T) K_p (I - U D^-1 S^T) + S D^-1 S^T,

with K_p of what carries the joint, at the joint's point, and S, U, D as in `nuno.coupled.joint_tree`.
"""

import warp as wp

from nuno.coupled.articulated_inertia import Inertia, crossed_rows
from nuno.coupled.joint_opening import Reply, Trees
from nuno.coupled.joint_response import BALL, HINGE, SLIDER, Joints, inverted
from nuno.rigid.rigid_body import RigidState


@wp.func
def reply_at(own: Reply, arm: wp.vec3):
    """The reply of a body at another of its points, to which ``arm`` leads."""
    made = Reply()
    across = crossed_rows(own.b, arm)
    spun = crossed_rows(own.c, arm)
    back = wp.transpose(spun)
    made.a = own.a + across + wp.transpose(across) + wp.transpose(crossed_rows(back, arm))  # type: ignore[arg-type]
    made.b = own.b + back
    made.c = own.c
    return made


@wp.func
def free_reply(own: Inertia):
    """The reply of a frame that nothing carries."""
    made = Reply()
    inverse = inverted(own.a)
    across = inverse * own.b
    made.c = inverted(own.c - wp.transpose(own.b) * across)
    made.b = -(across * made.c)
    made.a = inverse - made.b * wp.transpose(across)
    return made


@wp.func
def reply_beyond(rigid: RigidState, joints: Joints, trees: Trees, world: int, t: int):
    """The reply of what a joint carries, at its centre of mass; that of what carries it is there already."""
    k = trees.joint[t]
    at = world * trees.count + t
    nodes = world * (trees.count + trees.roots)
    carrier = trees.carrier[t]
    kind = joints.kind[k]
    made = Reply()
    if trees.opening[at].alone == 1:
        made = free_reply(trees.node[nodes + t])
    else:
        if carrier >= 0:
            made = reply_at(trees.reply[nodes + carrier], trees.opening[at].other_arm)
        gives = trees.opening[at].gives
        if (kind == HINGE or kind == SLIDER) and gives > 0.0:
            axis = trees.opening[at].axis
            if trees.flipped[t] == 1:
                axis = -axis
            push = trees.opening[at].push
            twist = trees.opening[at].twist
            shift = made.a * push + made.b * twist
            turn = push * made.b + made.c * twist
            most = gives + gives * gives * (wp.dot(push, shift) + wp.dot(twist, turn))
            if kind == HINGE:
                far = gives * turn
                made.b = made.b - wp.outer(gives * shift, axis)
                made.c = made.c - wp.outer(far, axis) - wp.outer(axis, far) + wp.outer(most * axis, axis)
            else:
                far = gives * shift
                made.b = made.b - wp.outer(axis, gives * turn)
                made.a = made.a - wp.outer(far, axis) - wp.outer(axis, far) + wp.outer(most * axis, axis)
        elif kind == BALL:
            lever = trees.node[nodes + t].b * trees.opening[at].swivel
            made.b = -(made.a * lever)
            made.c = trees.opening[at].swivel - wp.transpose(lever) * made.b
    trees.reply[nodes + t] = reply_at(made, -trees.opening[at].arm)


@wp.func
def renew_replies(rigid: RigidState, joints: Joints, trees: Trees, world: int):
    """The replies of all bodies that contacts ask for, and of what carries them, where inertias are other ones."""
    nodes = world * (trees.count + trees.roots)
    for n in range(trees.roots):
        at = nodes + trees.count + n
        if trees.asked[at] == 1 and trees.stale[at] == 1:
            made = Reply()
            if rigid.weight[world * rigid.capacity + trees.root[n]] > 0.0:
                made = free_reply(trees.node[at])
            trees.reply[at] = made
    for t in range(trees.count):
        if trees.asked[nodes + t] == 1:
            reply_beyond(rigid, joints, trees, world, t)


@wp.func
def ask_reply(trees: Trees, world: int, slot: int):
    """Ask for the reply of a body, and so of all that carry it."""
    if slot < trees.slots:
        n = trees.node_of[slot]
        while n >= 0:
            trees.asked[world * (trees.count + trees.roots) + n] = 1
            if n < trees.count:
                n = trees.carrier[n]
            else:
                n = -1


@wp.func
def forget_pushes(trees: Trees, world: int):
    """Before the passes of a substep: nothing is pushed yet, and no contact has asked for a reply."""
    for n in range(trees.count + trees.roots):
        at = world * (trees.count + trees.roots) + n
        trees.asked[at] = 0
        trees.pushed[at] = wp.vec3(0.0, 0.0, 0.0)
        trees.spun[at] = wp.vec3(0.0, 0.0, 0.0)
        trees.ahead[at] = wp.vec3(0.0, 0.0, 0.0)
        trees.ahead_turn[at] = wp.vec3(0.0, 0.0, 0.0)


@wp.func
def node_of(trees: Trees, slot: int, weight: float):
    """Return which node of a tree a body is, or -1, as where nothing moves it."""
    n = int(-1)
    if slot < trees.slots and weight > 0.0:
        n = trees.node_of[slot]
    return n


@wp.func
def push_node(joints: Joints, trees: Trees, world: int, node: int, force: wp.vec3, torque: wp.vec3):
    """Push a node's body: note where it and all others go for it that contacts ask for, up the tree and down again.

    What one foot is pushed by moves the other: contacts that did not know would each take back the whole of a wrong.
    """
    nodes = world * (trees.count + trees.roots)
    trees.pushed[nodes + node] = trees.pushed[nodes + node] + force
    trees.spun[nodes + node] = trees.spun[nodes + node] + torque
    for n in range(trees.count + trees.roots):
        if trees.asked[nodes + n] == 1:
            trees.shift[nodes + n] = wp.vec3(0.0, 0.0, 0.0)
            trees.turn[nodes + n] = wp.vec3(0.0, 0.0, 0.0)
            if n < trees.count:
                trees.bore[world * trees.count + n] = wp.vec3(0.0, 0.0, 0.0)
    f = wp.vec3(force)
    m = wp.vec3(torque)
    n = int(node)
    while n >= 0:
        if n >= trees.count:
            own = trees.reply[nodes + n]
            trees.shift[nodes + n] = own.a * f + own.b * m
            trees.turn[nodes + n] = f * own.b + own.c * m
            n = -1
        else:
            at = world * trees.count + n
            kind = joints.kind[trees.joint[n]]
            if trees.opening[at].alone == 1:
                own = trees.reply[nodes + n]
                trees.shift[nodes + n] = own.a * f + own.b * m
                trees.turn[nodes + n] = f * own.b + own.c * m
                n = -1
            else:
                m = m - wp.cross(trees.opening[at].arm, f)
                if kind == BALL:
                    opens = trees.opening[at].swivel * m
                    trees.bore[at] = opens
                    f = f - trees.node[nodes + n].b * opens
                    m = wp.vec3(0.0, 0.0, 0.0)
                elif kind == HINGE or kind == SLIDER:
                    axis = trees.opening[at].axis
                    if trees.flipped[n] == 1:
                        axis = -axis
                    way = trees.opening[at].gives * wp.dot(axis, wp.where(kind == HINGE, m, f))
                    trees.bore[at] = way * axis
                    f = f - way * trees.opening[at].push
                    m = m - way * trees.opening[at].twist
                m = m + wp.cross(trees.opening[at].other_arm, f)
                n = trees.carrier[n]
    for t in range(trees.count):
        at = world * trees.count + t
        if trees.asked[nodes + t] == 1 and trees.opening[at].alone == 0:
            k = trees.joint[t]
            shift = wp.vec3(0.0, 0.0, 0.0)
            turn = wp.vec3(0.0, 0.0, 0.0)
            if trees.carrier[t] >= 0:
                turn = trees.turn[nodes + trees.carrier[t]]
                shift = trees.shift[nodes + trees.carrier[t]] + wp.cross(turn, trees.opening[at].other_arm)
            opens = trees.bore[at]
            if joints.kind[k] == BALL:
                held = shift * trees.node[nodes + t].b + trees.node[nodes + t].c * turn
                opens = opens - trees.opening[at].swivel * held
                turn = turn + opens
            elif joints.kind[k] == HINGE or joints.kind[k] == SLIDER:
                way = wp.dot(trees.opening[at].push, shift) + wp.dot(trees.opening[at].twist, turn)
                sign = wp.where(trees.flipped[t] == 1, -1.0, 1.0)
                opens = opens - (sign * trees.opening[at].gives * way) * trees.opening[at].axis
                if joints.kind[k] == HINGE:
                    turn = turn + opens
                else:
                    shift = shift + opens
            trees.turn[nodes + t] = turn
            trees.shift[nodes + t] = shift - wp.cross(turn, trees.opening[at].arm)
    for n in range(trees.count + trees.roots):
        if trees.asked[nodes + n] == 1:
            trees.ahead[nodes + n] = trees.ahead[nodes + n] + trees.shift[nodes + n]
            trees.ahead_turn[nodes + n] = trees.ahead_turn[nodes + n] + trees.turn[nodes + n]
