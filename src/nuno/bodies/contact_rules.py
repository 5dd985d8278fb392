"""Contact rules: group masks, ignored pairs, and the friction of pairs of bodies."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from nuno.bodies.body import Body


class ContactRules:
    """The exceptions for pairs of bodies, by the bodies' keys.

    Attributes:
        friction: The coefficient of each pair that has its own.
        ignored: The pairs that pass through each other.
        held: Those that do while a grip holds one of them; see `set_held`.
        summed: The bodies for which impulses of static bodies are summed up; see ``World.sum_impulses``.
    """

    def __init__(self) -> None:
        self.friction: dict[frozenset[str], Any] = {}
        self.ignored: set[frozenset[str]] = set()
        self.held: set[frozenset[str]] = set()
        self.summed: set[str] = set()

    def set_held(self, pairs: Iterable[tuple[str, str]]) -> None:
        """Take the keys of each held body and of what it passes through: what holds a rigid body is no obstacle."""
        self.held = {frozenset(pair) for pair in pairs}

    def touch(self, a: Body, b: Body) -> bool:
        """Return True if two bodies touch each other at all."""
        pair = frozenset((a.key, b.key))
        if pair in self.ignored or pair in self.held:
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
