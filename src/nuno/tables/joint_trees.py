"""Trees of joints, found among the joints of a group of bodies, as the tables that the solver takes."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import warp as wp

from nuno.coupled.articulated_inertia import Inertia
from nuno.coupled.joint_opening import Fit, Opening, Trees

ANCHOR = -1
"""In place of a body: the world, or what is static."""


class Forest(NamedTuple):
    """Joints in trees and others.

    Attributes:
        joints: In trees, each after the one that carries its carrier.
        carriers: For each of them, the place in ``joints`` of the one that carries it, the number of ``joints`` and
            the place in ``roots``, or -1 where it hangs on what is static.
        flipped: For each of them, whether it carries the second of its bodies.
        roots: Bodies that no joint carries.
        lone: Joints that make loops, and those that are alone.
    """

    joints: list[int]
    carriers: list[int]
    flipped: list[bool]
    roots: list[int]
    lone: list[int]


def find_trees(pairs: Sequence[tuple[int, int]]) -> Forest:
    """Find the trees among joints.

    What hangs together is a tree if no way leads round, two ways to what is static included. The body with most
    joints is the root of one that hangs on nothing; the first joint's of these.

    Args:
        pairs: Two bodies each; the second may be ``ANCHOR``.
    """
    at: dict[int, list[int]] = defaultdict(list)  # the joints of a body
    for k, pair in enumerate(pairs):
        for body in pair:
            if body != ANCHOR:
                at[body].append(k)
    joints: list[int] = []
    carriers: list[tuple[bool, int]] = []  # whether a root, and which
    flipped: list[bool] = []
    roots: list[int] = []
    seen: set[int] = set()
    for first, _ in pairs:
        if first in seen:
            continue
        bodies = _joined_bodies(first, pairs, at)
        seen.update(bodies)
        own = sorted({k for body in bodies for k in at[body]})
        anchored = [k for k in own if ANCHOR in pairs[k]]
        if len(own) < 2 or len(own) != len(bodies) - 1 + len(anchored) or len(anchored) > 1:
            continue
        reached: list[tuple[int, tuple[bool, int]]] = []  # bodies, and what their joints are carried by
        used: set[int] = set()
        if anchored:
            used.add(anchored[0])
            reached.append((pairs[anchored[0]][0], (False, len(joints))))
            joints.append(anchored[0])
            carriers.append((False, -1))
            flipped.append(False)
        else:
            root = max(bodies, key=lambda body: len(at[body]))
            reached.append((root, (True, len(roots))))
            roots.append(root)
        for body, carrier in reached:
            for k in at[body]:
                if k not in used:
                    used.add(k)
                    other = pairs[k][1] if pairs[k][0] == body else pairs[k][0]
                    reached.append((other, (False, len(joints))))
                    joints.append(k)
                    carriers.append(carrier)
                    flipped.append(pairs[k][1] == other)
    places = [k + len(joints) if is_root else k for is_root, k in carriers]
    return Forest(joints, places, flipped, roots, sorted(set(range(len(pairs))) - set(joints)))


def tree_table(pairs: Sequence[tuple[int, int]], worlds: int, device: str) -> Trees:
    """Return the solver's table of the trees among joints, by their bodies' slots; see ``find_trees``."""
    forest = find_trees(pairs)
    table = Trees()
    table.count, table.roots, table.lone = len(forest.joints), len(forest.roots), len(forest.lone)
    heirs, next_heirs = [-1] * (len(forest.joints) + len(forest.roots)), [-1] * len(forest.joints)
    for k, carrier in enumerate(forest.carriers):
        if carrier >= 0:
            next_heirs[k], heirs[carrier] = heirs[carrier], k
    for name, numbers in (
        ("joint", forest.joints), ("carrier", forest.carriers), ("flipped", forest.flipped), ("root", forest.roots),
        ("alone", forest.lone), ("heir", heirs), ("next_heir", next_heirs),
    ):  # fmt: skip
        setattr(table, name, wp.array(np.array(numbers, np.int32), dtype=int, device=device))
    nodes, joints = worlds * (table.count + table.roots), worlds * table.count
    for name, kind, count in (
        ("opening", Opening, joints), ("fit", Fit, joints), ("node", Inertia, nodes), ("carried", Inertia, joints),
        ("shift", wp.vec3, nodes), ("turn", wp.vec3, nodes), ("pull", wp.vec3, nodes), ("twist", wp.vec3, nodes),
        ("stale", int, nodes), ("changed", int, joints), ("wrong", float, joints),
    ):  # fmt: skip
        setattr(table, name, wp.zeros(count, dtype=kind, device=device))
    return table


def _joined_bodies(first: int, pairs: Sequence[tuple[int, int]], at: dict[int, list[int]]) -> list[int]:
    """Return a body and all that joints join it to, directly or through others, the nearest first."""
    bodies, seen = [first], {first, ANCHOR}
    for body in bodies:
        for other in (other for k in at[body] for other in pairs[k]):
            if other not in seen:
                seen.add(other)
                bodies.append(other)
    return bodies
