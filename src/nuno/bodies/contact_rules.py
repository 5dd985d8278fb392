"""Contact rules: group masks, ignored pairs, and the friction of pairs of bodies."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from nuno.bodies.body import Body


class ContactRules:
    """The exceptions for pairs of bodies, by the bodies' keys.

    Attributes:
        friction: The coefficient of each pair that has its own.
        ignored: The pairs that pass through each other.
        held: Those that do while a grip holds one of them, and in which worlds (worlds,) bool; see `set_held`.
        summed: The bodies for which impulses of static bodies are summed up; see ``World.sum_impulses``.
    """

    def __init__(self) -> None:
        self.friction: dict[frozenset[str], Any] = {}
        self.ignored: set[frozenset[str]] = set()
        self.held: dict[frozenset[str], np.ndarray] = {}
        self.summed: set[str] = set()

    def set_held(self, pairs: Iterable[tuple[str, str, np.ndarray]]) -> None:
        """Take the keys of each held body and of what it passes through: what holds a rigid body is no obstacle.

        With each the worlds (worlds,) bool in which it is held.
        """
        self.held = {}
        for a, b, worlds in pairs:
            pair = frozenset((a, b))
            self.held[pair] = self.held[pair] | worlds if pair in self.held else worlds

    def touch(self, a: Body, b: Body, world: int | None = None) -> bool:
        """Return True if two bodies touch each other at all, in one world of a batch or in any."""
        pair = frozenset((a.key, b.key))
        held = self.held.get(pair)
        if pair in self.ignored or (held is not None and (held.all() if world is None else held[world])):
            return False
        return bool(a.group & b.collides_with) and bool(b.group & a.collides_with)

    def touches_itself(self, body: Body) -> bool:
        """Return True if the parts of a body touch each other: unless it is ignored as a pair with itself."""
        return frozenset((body.key,)) not in self.ignored

    def colliders_of(self, dynamic: Body, static: list[Body]) -> tuple[list[Body], dict[str, Any]]:
        """Return the bodies that ``dynamic`` touches, and by name the friction of pairs with their own."""
        touching = [body for body in static if self.touch(dynamic, body)]
        friction = {body.name: self.friction.get(frozenset((dynamic.key, body.key))) for body in touching}
        return touching, {name: mu for name, mu in friction.items() if mu is not None}
