"""Touching: which pairs collide, as bit masks, and the friction and restitution of each pair.

Two geoms of which one bounces are an explicit pair, see `nuno.engines.mujoco.mujoco_bounces`.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.engines.mujoco.mujoco_package import mujoco_package
from nuno.engines.world_view import dynamics_of, rules_of
from nuno.errors import InvalidInputError

if TYPE_CHECKING:
    from nuno.bodies.body import Body
    from nuno.engines.world_view import EngineWorld

log = logging.getLogger(__name__)

BITS = 31
"""Bits of a mask that tell bodies apart."""
CONTACT = (0.004, 1.0)
"""``solref`` of contacts: time constant [s] and damping ratio. MuJoCo's default is 0.02 s, in which a towel sinks 5 mm
into a table."""
IMPEDANCE = (0.95, 0.995, 0.001, 0.5, 2.0)
"""``solimp`` of contacts."""
_warned: set[frozenset[str]] = set()


def touch_classes(world: EngineWorld, bodies: Sequence[Body]) -> list[list[int]]:
    """Return the bodies by their places in classes that touch the same others, and one another or not.

    Raises:
        InvalidInputError: there are more than 31 such classes.
    """
    n, rules = len(bodies), rules_of(world)
    moves = [dynamics_of(body) is not None for body in bodies]
    touches = np.zeros((n, n), dtype=bool)
    for i, a in enumerate(bodies):
        for j, b in enumerate(bodies[:i]):
            touches[i, j] = touches[j, i] = (moves[i] or moves[j]) and rules.touch(a, b)
    classes: list[list[int]] = []
    for i in range(n):
        for members in classes:
            others = np.ones(n, dtype=bool)
            others[[*members, i]] = False
            # those that are members are alike to one another
            inner = {*touches[i, members].tolist(), *touches[members[0], members[1:2]].tolist()}
            if np.array_equal(touches[i, others], touches[members[0], others]) and len(inner) == 1:
                members.append(i)
                break
        else:
            classes.append([i])
    if len(classes) > BITS:
        raise InvalidInputError(
            f"mujoco tells {BITS} classes of bodies apart that touch different others, and here are {len(classes)}; "
            "let more bodies touch alike (groups, ignore_contact)"
        )
    return classes


def set_masks(world: EngineWorld, bodies: list[tuple[Body, Any]]) -> None:
    """Give all geoms and flexes the masks by which exactly those pairs collide that touch in the world.

    MuJoCo's rule is an or, Nuno's an and: each class of bodies that touch the same others has a bit of its own.

    Raises:
        InvalidInputError: there are more than 31 such classes.
    """
    own = [body for body, _ in bodies]
    classes = touch_classes(world, own)

    def touch(i: int, j: int) -> bool:
        moves = dynamics_of(own[i]) is not None or dynamics_of(own[j]) is not None
        return moves and rules_of(world).touch(own[i], own[j])

    for k, members in enumerate(classes):
        mask = 0
        for other, theirs in enumerate(classes):
            one = members[0]
            two = next((m for m in theirs if m != one), None)
            if two is not None and touch(one, two):
                mask |= 1 << other
        for member in members:
            placed = bodies[member][1]
            for shape in (*placed.geoms, *placed.flexes):
                shape.contype, shape.conaffinity = 1 << k, mask


@dataclass(frozen=True, eq=False)
class TouchingPair:
    """Two geoms that touch with numbers of their own.

    Attributes:
        name: Of the pair in the spec.
        friction: (worlds,), the coefficient.
        restitution: (worlds,).
    """

    name: str
    friction: np.ndarray
    restitution: np.ndarray


def set_pairs(spec: Any, world: EngineWorld, bodies: list[tuple[Body, Any]]) -> list[TouchingPair]:
    """Give all geoms and flexes the coefficients of their pairs; return the pairs that have numbers of their own.

    MuJoCo takes of two the larger coefficient, or that of the shape with the higher priority; Nuno's pair takes the
    geometric mean. A geom against a flex tells the pair's own; two geoms that differ from theirs, or that bounce, are
    an explicit pair.
    """
    for pair in list(spec.pairs):
        spec.delete(pair)
    flexes = [(body, own) for body, own in bodies if own.role == "flex"]
    others = [(body, own) for body, own in bodies if own.role != "flex"]
    for body, own in flexes:
        own.friction, own.flexes[0].priority = _by_world(world, body.friction), 0
        own.flexes[0].friction = _triple(own.friction)
    for body, own in others:
        wanted = [(pair_friction(world, body, flex), flex) for flex, _ in flexes if rules_of(world).touch(body, flex)]
        own.friction = wanted[0][0] if wanted else _by_world(world, body.friction)
        for mu, flex in wanted[1:]:
            _tell(body, flex, mu, own.friction)
        for shape in (*own.geoms, *own.flexes):
            shape.friction, shape.priority = _triple(own.friction), 1
    for i, (body, own) in enumerate(flexes):
        for other, theirs in flexes[:i]:
            if rules_of(world).touch(body, other):
                _tell(body, other, pair_friction(world, body, other), np.maximum(own.friction, theirs.friction))
    found: list[TouchingPair] = []
    for i, (body, own) in enumerate(others):
        for other, theirs in others[:i]:
            if (dynamics_of(body) is None and dynamics_of(other) is None) or not rules_of(world).touch(body, other):
                continue
            mu, taken = pair_friction(world, body, other), np.maximum(own.friction, theirs.friction)
            bounce = np.maximum(restitution_of(world, body), restitution_of(world, other))
            if np.abs(mu - taken).max() < 1e-9 and not bounce.any():
                continue
            if own.flexes or theirs.flexes:
                _tell(body, other, mu, taken)
                _tell(body, other, bounce, np.zeros_like(bounce), "restitution")
                continue
            for a in own.geoms:
                for b in theirs.geoms:
                    name = f"{a.name}-{b.name}"
                    spec.add_pair(name=name, geomname1=a.name, geomname2=b.name, condim=3)
                    found.append(TouchingPair(name, mu, bounce))
    return found


def write_pairs(model: Any, batch: Any, pairs: Sequence[TouchingPair]) -> None:
    """Write the numbers of pairs that have their own."""
    if not pairs:
        return
    number = [model.pair(pair.name).id for pair in pairs]
    mu = np.stack([pair.friction for pair in pairs], axis=1)
    batch.expand("pair_friction")[:, number] = np.stack(
        [mu, mu, *(np.full_like(mu, k) for k in (5e-3, 1e-4, 1e-4))], -1
    )
    batch.expand("pair_solref")[:, number], batch.expand("pair_solimp")[:, number] = CONTACT, IMPEDANCE


def restitution_of(world: EngineWorld, body: Body) -> np.ndarray:
    """Return a body's restitution (worlds,), 0 of one without a rigid material."""
    dynamics = dynamics_of(body)
    return _by_world(world, getattr(dynamics.material, "restitution", 0.0) if dynamics is not None else 0.0)


def write_friction(model: Any, batch: Any, bodies: list[tuple[Body, Any]]) -> None:
    """Write coefficients that differ between worlds."""
    mujoco = mujoco_package()
    kinds = {"geom_friction": mujoco.mjtObj.mjOBJ_GEOM, "flex_friction": mujoco.mjtObj.mjOBJ_FLEX}
    for _, own in bodies:
        if np.ptp(own.friction) == 0.0:
            continue
        for name, shapes in (("geom_friction", own.geoms), ("flex_friction", own.flexes)):
            for shape in shapes:
                batch.expand(name)[:, mujoco.mj_name2id(model, kinds[name], shape.name), 0] = own.friction


def pair_friction(world: EngineWorld, a: Body, b: Body) -> np.ndarray:
    """Return the coefficient of a pair, (worlds,)."""
    own = rules_of(world).friction.get(frozenset((a.key, b.key)))
    if own is not None:
        return _by_world(world, own)
    return np.sqrt(_by_world(world, a.friction) * _by_world(world, b.friction))


def _by_world(world: EngineWorld, value: Any) -> np.ndarray:
    return np.array(np.broadcast_to(np.asarray(value, dtype=float), (world.world_count,)))


def _triple(mu: np.ndarray) -> list[float]:
    return [float(mu[0]), 0.005, 1e-4]


def _tell(a: Body, b: Body, wanted: np.ndarray, real: np.ndarray, what: str = "friction") -> None:
    """Warn once of a pair whose friction or restitution MuJoCo cannot have."""
    pair = frozenset((a.key, b.key, what))
    worst = int(np.argmax(np.abs(wanted - real)))
    if abs(wanted[worst] - real[worst]) > 1e-6 and pair not in _warned:
        _warned.add(pair)
        why = {
            "friction": "it has one coefficient a shape where flexes touch. Equal coefficients of all bodies mend that",
            "restitution": "a static mesh that is not convex is a rigid flex there, which cannot bounce anything. "
            "Convex shapes in its place mend that",
        }[what]
        log.warning(
            "on mujoco %r and %r have the %s %.4g in place of %.4g: %s", a.name, b.name, what, real[worst],
            wanted[worst], why,
        )  # fmt: skip
