"""Hands: what closes between a robot's fingers is gripped, until they open."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.bodies.body import Body
from nuno.dynamics.dynamics import dynamics_of
from nuno.errors import InvalidInputError, UnknownNameError
from nuno.joints.grip import Grip
from nuno.joints.held_points import places_on_body
from nuno.joints.joint import Joint
from nuno.materials import Rigid
from nuno.robot.closing_gap import closing_gap
from nuno.robot.description import HandOnFrame
from nuno.robot.fingers import CLOSING
from nuno.robot.placement import pose_of
from nuno.shapes.coordinates import Coordinates, Pose, compose, invert
from nuno.shapes.surface import SurfacePoints, closest_points
from nuno.validation import checked, number

if TYPE_CHECKING:
    from nuno.robot.links import Links
    from nuno.robot.robot_state import Contacts
    from nuno.world.world import World

PROBES = 5
"""Points along each side of the closing volume from which the nearest surface is looked for."""
TOUCHES = 2e-3
"""[m] By how much a body may be narrower than the fingers are apart that touches both: shapes are so much smaller."""
FINGERS = CLOSING
"""The axis of a hand's frame along which its fingers close."""


class Hand:
    """A hand of a robot that is in a world.

    When it closes, what is between its fingers is gripped by the link that carries them, and bears on it until the hand
    opens. A cloth or soft body is gripped by its vertices in the closing volume, or, where it is so coarse that none is
    in it, by the nearest points of its surface; a rigid body as a whole. The joint that shows the fingers closed moves
    on its own (``joint_angles``), as do fingers that hold by friction alone.

    Where the robot has dynamics and the description tells the hand's fingers, nothing is gripped: the fingers press on
    what is between them and hold it by friction, or do not (``presses``).

    Args:
        links: The robot's links in the world.
        name: "left_hand" or "right_hand": the frame that the description says the closing volume of.

    Raises:
        UnknownNameError: the description has no such hand.
        InvalidInputError: no link of the hand has a shape in the world.
    """

    @checked
    def __init__(self, links: Links, name: str) -> None:
        robot = links.robot
        if name not in robot.description.hands:
            raise UnknownNameError("hand", name, list(robot.description.hands))
        self.links, self.name = links, name
        self.description: HandOnFrame = robot.description.hands[name]
        if self.description.joint is not None:
            robot.joint_index(self.description.joint)
        self.body, self._offset = carrier(links, name)
        self._shapes = carried_by(links, self.body)
        self._grips: list[Grip] = []
        self._fingers = [[links.names[k] for k in own] for own in links.finger_bodies.of_hand(name)]  # links of each
        self.pressed: frozenset[str] = frozenset()  # names of bodies, in the last frame, by all fingers

    def __repr__(self) -> str:
        held = ", ".join(body.name for body in self.held) or "nothing"
        return f"<{self.name} of {self.links.robot.name!r}, holds {held}>"

    @property
    def grips(self) -> tuple[Grip, ...]:
        """Return what it holds with; a body that was detached or removed is no longer among them."""
        return tuple(grip for grip in self._grips if grip.active)

    @property
    def held(self) -> tuple[Body, ...]:
        """The bodies that it holds: what it grips, or what all its fingers pressed on in the last frame."""
        if self.presses:
            return tuple(body for body in self._world.bodies if body.name in self.pressed)
        return tuple(grip.body for grip in self.grips)

    @property
    def presses(self) -> bool:
        """Return True if it holds by its fingers' friction alone, and grips nothing."""
        return self.has_fingers and self.body.is_dynamic

    @property
    def has_fingers(self) -> bool:
        """Return True if it has fingers that press, with dynamics."""
        return bool(self._fingers)

    @property
    def width(self) -> float:
        """Return how far apart the fingers are [m], by the joint as it is now; of a hand without a joint, when open."""
        own = self.description
        if own.joint is None:
            return own.width
        return float(width_at(own, self._joint_angles()[self.links.robot.joint_index(own.joint)]))

    @checked
    def joint_angles(self, width: float) -> dict[str, float]:
        """Return the joint's position by name when the fingers are ``width`` [m] apart; empty without a joint.

        Raises:
            InvalidInputError: the fingers do not go so far apart.
        """
        own = self.description
        wanted = number("width", width, low=0.0)
        if wanted > own.width + 1e-9:
            raise InvalidInputError(f"the fingers of {self.name!r} are at most {own.width} m apart, got {wanted} m")
        if own.joint is None:
            return {}
        return {own.joint: own.closed + (own.open - own.closed) * wanted / own.width}

    @checked
    def volume(self, width: float | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Return the corners (3,) and (3,) [m] of the closing volume, in the frame of the hand.

        Args:
            width: How far apart the fingers are [m] when they begin to close; None is as far as they go.
        """
        low, high = self.description.low.copy(), self.description.high.copy()
        if width is not None and self.description.joint is not None:
            low[FINGERS], high[FINGERS] = max(low[FINGERS], -0.5 * width), min(high[FINGERS], 0.5 * width)
        return low, high

    @checked
    def close(self, bodies: Sequence[Body | str] | None = None, *, width: float | None = None) -> tuple[Body, ...]:
        """Grip what is in the closing volume, and return the bodies that are held: none where it is empty.

        What the hand gripped before it lets go first. A hand that ``presses`` grips nothing.

        Args:
            bodies: Dynamic bodies that it may take; None are all.
            width: How far apart the fingers are [m] when they begin to close; None is as far as they go.

        Raises:
            BodyStateError: a body that is static or in another world, or links that have left theirs.
        """
        world = self._world
        with world.lock:
            self.open()
            if self.presses:
                return self.held
            chosen = self._others() if bodies is None else [world._own(b) for b in bodies]
            frame, found = self._frame(), []
            for body in chosen:
                where = self._inside(body, frame, width)
                if where is not False:
                    self._take(body, where)
                    found.append(body)
        return tuple(found)

    @checked
    def gap(self, force: float = np.inf) -> float:
        """Return how far apart the fingers stay [m] where they close on what is in the closing volume now.

        By the shapes and materials of dynamic bodies; 0 where there is none.

        Args:
            force: With which they press [N]; no more than the joint's effort gives.
        """
        robot, joint = self.links.robot, self.description.joint
        if joint is None:
            return 0.0
        own = self.description
        limit = robot.effort_limits[robot.joint_index(joint)] * abs(own.closed - own.open) / max(own.width, 1e-9)
        force = min(force, float(limit) if limit > 0.0 else np.inf)
        with self._world.lock:
            frame = self._frame()
            return min(max((self._gap_of(body, frame, force) for body in self._others()), default=0.0), self.width)

    def _gap_of(self, body: Body, frame: Coordinates, force: float) -> float:
        """Return how far apart [m] a body that is in the closing volume keeps fingers that press with a force [N]."""
        low, high = self.volume(self.width)
        local = frame.to_local(self._vertices(body))
        if (local.max(axis=0) < low).any() or (local.min(axis=0) > high).any():
            return 0.0
        return float(closing_gap(np.asarray(body.faces), self._material(body), local, low, high, FINGERS, force))

    def filled_by(self) -> list[Body]:
        """Return the dynamic bodies that reach from one of its fingers to the other, as it is open now."""
        with self._world.lock:
            frame, width = self._frame(), self.width - TOUCHES
            return [body for body in self._others() if self._gap_of(body, frame, np.inf) > width]

    def open(self) -> None:
        """Let go of everything: what was held moves on as if it had never been."""
        for grip in self._grips:
            grip.release()
        self._grips = []

    def take_grips(self, grips: Sequence[Grip]) -> None:
        """Hold with these grips from now on, and let go of nothing."""
        self._grips = list(grips)

    def hold_on(self, grips: Sequence[Grip]) -> None:
        """Hold at the same points what grips of this hand held that ended as its link lost its dynamics."""
        for grip in grips:
            self._take(grip.body, places_on_body(grip))

    def take_over(self) -> None:
        """Hold what is gripped to the hand's link, as a file has it that the world was restored from."""
        grips = [grip for body in self.links.world.bodies if (own := dynamics_of(body)) for grip in own.grips]
        tied = [grip for grip in grips if grip.target is self.body and not isinstance(grip, Joint)]
        self._grips = [*self.grips, *(grip for grip in tied if grip not in self._grips)]

    @checked
    def move(self, width: float) -> dict[str, float]:
        """Open to a width [m], letting go where that is wider than now, and return the joint's position as it then is.

        The robot takes it; ``links.follow`` moves the fingers there. To take hold, ``close``.
        """
        angles = self.joint_angles(width)
        if self.description.joint is None or width > self.width + 1e-9:
            self.open()
        if angles:
            self.links.robot.angle_vector(angles)
        return angles

    # Inside, of the world that it is in

    @property
    def _world(self) -> World:
        return self.links.world

    def _joint_angles(self) -> np.ndarray:
        """Return where the robot's joints are (n,)."""
        return self.links.robot.angle_vector()

    def _others(self) -> list[Body]:
        """Return the bodies that it may take, or close on."""
        return [body for body in self._world.bodies if body.is_dynamic and body not in self.links.bodies]

    def _frame(self) -> Coordinates:
        """Return its frame where the body is, not where it is sent."""
        return Coordinates(*compose(self.body.pose(), self._offset))

    def _vertices(self, body: Body) -> np.ndarray:
        return body.vertices

    def _material(self, body: Body) -> Any:
        return body.material

    def _take(self, body: Body, where: Any) -> None:
        """Grip points of a body, or a rigid body as a whole."""
        ignored = self._shapes if isinstance(body.material, Rigid) else None
        self._grips.append(self._world.grip(body, where, to=self.body, ignore=ignored))

    def _inside(self, body: Body, frame: Coordinates, width: float | None) -> np.ndarray | SurfacePoints | bool | None:
        """Return the points of a body that are in the closing volume, None for a rigid body in it, else False."""
        low, high = self.volume(width)
        vertices = self._vertices(body)
        local = frame.to_local(vertices)
        if (local.max(axis=0) < low).any() or (local.min(axis=0) > high).any():
            return False
        rigid = isinstance(body.material, Rigid)
        inside = np.flatnonzero(((local >= low) & (local <= high)).all(axis=1))
        if len(inside):
            return None if rigid else inside
        steps = [np.linspace(a, b, PROBES) for a, b in zip(low, high, strict=True)]
        probes = np.stack(np.meshgrid(*steps, indexing="ij"), axis=-1).reshape(-1, 3)
        found = closest_points(frame.to_world(probes), vertices, body.faces)
        points = np.einsum("kc,kcx->kx", found.barycentric, local[body.faces[found.faces]])
        near = ((points >= low) & (points <= high)).all(axis=1)
        if not near.any():
            return False
        if rigid:
            return None
        # as many points as there are to tell how the surface is turned, and no two the same
        nearest = np.flatnonzero(near)[np.argsort(np.linalg.norm(points[near] - 0.5 * (low + high), axis=1))]
        kept: list[int] = []
        for k in nearest:
            if all(np.linalg.norm(points[k] - points[j]) > 0.25 * (high - low).min() for j in kept):
                kept.append(int(k))
        return SurfacePoints(found.faces[kept[:3]], found.barycentric[kept[:3]])


def carrier(links: Links, frame: str) -> tuple[Body, Pose]:
    """Return the body that carries a frame of the robot, and where the frame is in the body's own.

    It is the body of the frame's link, or, where that has no shape, one of a link that is fixed to it.

    Raises:
        InvalidInputError: there is none.
    """
    robot = links.robot
    own = robot.model.frames[robot.frame_index(frame)]
    role = robot.description.frames.get(frame)
    name = frame if role is None else role.link
    fixed = [k for k, joint in enumerate(links.joints) if joint == own.parentJoint]
    if not fixed:
        raise InvalidInputError(f"no link that is fixed to {frame!r} of {robot.name!r} has a shape in the world")
    k = next((k for k in fixed if links.names[k] == name), fixed[0])
    return links.bodies[k], compose(invert(links.offset_of(k)), pose_of(own.placement))


def carried_by(links: Links, body: Body) -> list[Body]:
    """Return a link's body and those of all links that it carries, such as a hand's fingers."""
    model = links.robot.model
    own = links.joints[links.bodies.index(body)]

    def is_carried(joint: int) -> bool:
        while joint > own:  # a joint's parent has a lower number
            joint = model.parents[joint]
        return joint == own

    return [other for other, joint in zip(links.bodies, links.joints, strict=True) if is_carried(joint)]


def hands_of(links: Links) -> dict[str, Hand]:
    """Return the hands of a robot that is in a world, by name."""
    return {name: Hand(links, name) for name in links.robot.description.hands}


def width_at(own: HandOnFrame, angle: np.ndarray) -> np.ndarray:
    """Return how far apart a hand's fingers are [m] where its joint is at an angle, or at several."""
    return np.asarray(own.width * np.clip((angle - own.closed) / (own.open - own.closed), 0.0, 1.0))


def pressed_by(hand: Hand, contacts: Contacts) -> frozenset[str]:
    """Return the names of bodies that all fingers of a hand pressed on in a frame; none where it does not press.

    Args:
        hand: The hand.
        contacts: What touched the robot's links in the frame.
    """
    if not hand.presses:
        return frozenset()
    names = set.intersection(*({name for link in own for name in contacts.get(link, ())} for own in hand._fingers))
    return frozenset(names - {body.name for body in hand.links.bodies})
