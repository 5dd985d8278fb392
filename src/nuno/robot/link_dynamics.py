"""LinkDynamics: a robot's links as rigid bodies with the model's inertias, joined by hinges and sliders with motors."""

from __future__ import annotations

import copy
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.dynamics.dynamics import dynamics_of
from nuno.errors import BodyStateError, InvalidInputError
from nuno.joints.held_points import held_points, holding
from nuno.joints.joint import Joint, set_motors
from nuno.joints.joint_drives import Spring
from nuno.joints.joint_motion import positions_of, velocities_of
from nuno.materials import Rigid
from nuno.robot.finger_dynamics import FingerDynamics, possible_inertia
from nuno.robot.pinocchio import pin
from nuno.shapes import quaternion as quat
from nuno.world.make_joints import hinge, slider

if TYPE_CHECKING:
    from nuno.bodies.body import Body
    from nuno.joints.grip import Grip
    from nuno.robot.links import Links
    from nuno.robot.robot_state import Contacts
    from nuno.world.world import World

FULL_EFFORT = 0.01
"""[rad or m] How far a joint is from where it is wanted when its motor gives all that it can."""
BEARS = 1e5
"""[N] Force that a joint bears across its axis."""
SETTLES = 0.03
"""[s] In which a motor that follows a velocity comes to it,"""
HOLDS = 0.1
"""[s] and to its position."""
MAX_WEIGHT = 1.5
"""Times its weight that a body which moves is taken to load a link with."""
RUBS = 5e-3
"""[rad/s or m/s] From which on a motor overcomes all of its joint's friction."""


class LinkDynamics:
    """Forward dynamics of a robot's links.

    Each joint of the model carries one rigid body, with the mass, centre of mass and inertia of all links that are
    fixed to it. The joints are hinges and sliders with the model's limits; a motor in each exerts
    ``stiffness (wanted - position) + damping (wanted velocity - velocity) + effort`` up to the effort limit, anew in
    every substep. Joints rub and are damped as the model says. The effort limit is one of what arrives: a motor gives
    what friction takes besides. Links of one robot pass through each other. A robot without feet keeps its base where
    it is.

    Args:
        links: One body for each joint (``robot.enter(world, "joints")``).
        friction: Coulomb's coefficient of the links' surfaces.

    Attributes:
        stiffness: (n,) of motors that hold a position [N m/rad; N/m].
        damping: (n,) likewise [N m s/rad; N s/m].
        soft: Stiffness and damping of motors that exert given efforts and follow velocities softly, (n,) each.
        efforts: (n,) the most that they exert [N m; N], infinite where the model has no limit.
        joint_friction: (n,) up to which joints stick, and that brakes them as they move [N m; N]; as they are attached.
        joint_damping: (n,) of what brakes them by their velocity [N m s/rad; N s/m]; likewise.
        joints: The joints while attached, in the order of ``joint_names``.
        fingers: Fingers that slide.

    Raises:
        InvalidInputError: links that are not one for each joint.
    """

    def __init__(self, links: Links, *, friction: float = 0.8) -> None:
        if not links.are_joints:
            raise InvalidInputError('dynamics need one body for each joint: robot.enter(world, "joints") makes them')
        self.links, self.robot, self.world, self.friction = links, links.robot, links.world, friction
        self.bodies = links.bodies
        self.joints: tuple[Joint, ...] = ()
        model, limits = self.robot.model, self.robot.effort_limits
        self.efforts = np.where(np.isfinite(limits) & (limits > 0.0), limits, np.inf)
        inertia = np.array(pin.crba(model, model.createData(), self.robot.posture_configuration())).diagonal()[6:]
        self.stiffness = np.where(np.isfinite(self.efforts), self.efforts / FULL_EFFORT, inertia * 1e4)
        self.damping = 2.0 * np.sqrt(self.stiffness * inertia)
        self.soft = inertia / SETTLES / HOLDS, inertia / SETTLES
        self.joint_friction = np.array(model.upperDryFrictionLimit[6:])
        self.joint_damping = np.array(model.damping[6:])
        self._is_free = bool(self.robot.description.feet)
        self._frames: tuple[Any, Any] | None = None  # joints, and what `_joint_frames` found of them
        self._placed: tuple[np.ndarray, np.ndarray] | None = None  # where the links were when they were read last
        self.fingers = FingerDynamics(links, self.efforts)

    @property
    def is_attached(self) -> bool:
        """Return True if the links move dynamically."""
        return bool(self.joints)

    def attach(self) -> None:
        """Give the links dynamics from where they are, at rest; motors hold the joints.

        Raises:
            EngineCapabilityError: the world's engine has no joints with motors for robots.
            BodyStateError: they have them, or have left their world.
        """
        if self.is_attached:
            raise BodyStateError(f"the links of {self.robot.name!r} are attached already")
        self.world.engine.require("robots with dynamics")
        self.links.stop()
        world, model, bodies = self.world, self.robot.model, self.links.bodies
        angles = self.robot.angle_vector()
        placements = self.robot.update().oMi
        for k, body in enumerate(bodies[: model.njoints - 1]):
            if k == 0 and not self._is_free:
                continue
            own = self.fingers.left(k + 1, model.inertias[k + 1])
            inertia = possible_inertia(np.array(own.inertia), float(own.mass))
            world.attach(
                body, Rigid(
                    mass=max(float(own.mass), 1e-3), inertia=inertia, centre_of_mass=own.lever, friction=self.friction
                ),
            )  # fmt: skip
        self.fingers.attach(self.friction)
        for k, body in enumerate(bodies):
            for other in bodies[:k]:
                world.ignore_contact(body, other)
        lower, upper = self.robot.joint_limits
        joints = []
        for n in range(len(angles)):
            j = n + 2
            is_slide, axis = _axis_of(model.joints[j])
            turns = not is_slide and (lower[n] < -np.pi or upper[n] > np.pi)
            make = slider if is_slide else hinge
            joints.append(make(
                bodies[j - 1], bodies[int(model.parents[j]) - 1], point=placements[j].translation,
                axis=placements[j].rotation @ axis, limits=None if turns else (lower[n], upper[n]),
                position=angles[n] if is_slide else (angles[n] + np.pi) % (2.0 * np.pi) - np.pi, max_force=BEARS,
                friction=self.joint_friction[n], spring=Spring(0.0, damping=self.joint_damping[n]),
            ))  # fmt: skip
        self.joints = tuple(joints)
        nothing = np.zeros(len(angles))
        self.drive(angles, nothing, self.stiffness, self.damping, nothing)
        self.lead_fingers(angles)

    def detach(self) -> None:
        """Take the dynamics away: the links stand still where they are, and their joints go.

        Raises:
            BodyStateError: they have none.
        """
        if not self.is_attached:
            raise BodyStateError(f"the links of {self.robot.name!r} are not attached")
        for body in self.links.bodies:
            if body.is_dynamic:
                self.world.detach(body)
        self.forget()

    def forget(self) -> None:
        """Take it that the links have no dynamics any more."""
        self.joints = self.fingers.joints = ()

    def drive(
        self, positions: np.ndarray, velocities: np.ndarray, stiffness: np.ndarray, damping: np.ndarray,
        effort: np.ndarray,
    ) -> None:  # fmt: skip
        """Set all motors: (n,) each, or (worlds, n)."""
        most = self.efforts + self.joint_friction
        set_motors(self.joints, positions, velocities, stiffness, damping, most, effort)

    def overcome(self, velocities: np.ndarray) -> np.ndarray:
        """Return what friction and damping take of joints that go at velocities [rad/s; m/s], of (n,) each."""
        return self.joint_friction * np.clip(velocities / RUBS, -1.0, 1.0) + self.joint_damping * velocities

    def lead_fingers(self, wanted: np.ndarray) -> None:
        """Lead fingers that slide for a frame, as all joints (n,) or (worlds, n) are wanted, after ``drive``.

        The joints of their hands go where the fingers are.
        """
        there = self.fingers.lead(wanted)
        if there:
            rows, angles = [*there], np.stack([*there.values()], axis=-1)
            joints, still = [self.joints[row] for row in rows], np.zeros(len(rows))
            most = (self.efforts + self.joint_friction)[rows]
            set_motors(joints, angles, still, self.stiffness[rows], self.damping[rows], most, still)

    def read(self) -> tuple[np.ndarray, np.ndarray]:
        """Return where the robot is, q (worlds, nq), and how it moves, v (worlds, nv), as Pinocchio has them."""
        robot, base, worlds = self.robot, self.bodies[0], self.world.world_count
        moving = self.bodies if base.is_dynamic else self.bodies[1:]
        places, turns, velocities, spins = self.world.rigid_motion(moving)
        if not base.is_dynamic:
            still = tuple(np.broadcast_to(part, (worlds, 1, len(np.ravel(part)))) for part in base.pose())
            nothing = np.zeros((worlds, 1, 3))
            places, turns, velocities, spins = (
                np.concatenate(pair, axis=1)
                for pair in zip((*still, nothing, nothing), (places, turns, velocities, spins), strict=True)
            )
        self._placed = places, turns
        angles, rates = self._along(places, turns, velocities, spins)
        v = np.zeros((worlds, robot.model.nv))
        back = quat.inverse(turns[:, 0])
        v[:, :3], v[:, 3:6] = quat.rotate(back, velocities[:, 0]), quat.rotate(back, spins[:, 0])
        v[:, 6:] = rates
        pose = np.concatenate([places[:, 0], np.roll(turns[:, 0], -1, axis=1)], axis=1)
        return robot.configuration_of(angles, pose), v

    def _along(
        self, places: np.ndarray, turns: np.ndarray, velocities: np.ndarray, spins: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return positions and velocities of the joints, (worlds, n) each, as they tell them themselves."""
        own, other, slides, (place, turn, other_place, other_turn) = self._joint_frames()
        frame = (places[:, own] + quat.rotate(turns[:, own], place), quat.multiply(turns[:, own], turn))
        its = (
            places[:, other] + quat.rotate(turns[:, other], other_place), quat.multiply(turns[:, other], other_turn)
        )  # fmt: skip
        spin = spins[:, own] - spins[:, other]
        speed = (
            velocities[:, own] + np.cross(spins[:, own], frame[0] - places[:, own])
            - velocities[:, other] - np.cross(spins[:, other], frame[0] - places[:, other])
        )  # fmt: skip
        return positions_of(slides, frame, its), velocities_of(slides, speed, spin, its)

    def gaps(self) -> np.ndarray:
        """Return how far apart joints are across their ways, when they were read last (worlds, n + fingers) [m]."""
        assert self._placed is not None
        places, turns = self._placed
        own, other, slides, (place, _, other_place, other_turn) = self._joint_frames(fingers=True)
        shift = places[:, own] + quat.rotate(turns[:, own], place)
        shift -= places[:, other] + quat.rotate(turns[:, other], other_place)
        along = quat.rotate(quat.multiply(turns[:, other], other_turn), np.array([0.0, 0.0, 1.0]))
        slid = np.where(slides, np.einsum("wjx,wjx->wj", shift, along), 0.0)
        return np.asarray(np.linalg.norm(shift - slid[..., None] * along, axis=-1))

    def _joint_frames(self, fingers: bool = False) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[np.ndarray]]:
        """Return each joint's bodies, whether it slides, and its frames in both, which stay as long as it is there.

        Args:
            fingers: Whether the slides of fingers follow.
        """
        if self._frames is None or self._frames[0] is not self.joints:
            parents = [int(self.robot.model.parents[j]) - 1 for j in range(2, self.robot.model.njoints)]
            own, sliding = list(range(1, len(self.joints) + 1)), self.fingers
            carriers = [finger.joint - 1 for finger in sliding.fingers]
            self._frames = self.joints, (
                _frames_of(self.joints, own, parents),
                _frames_of(
                    (*self.joints, *sliding.joints), [*own, *(self.bodies.index(b) for b in sliding.bodies)],
                    [*parents, *carriers],
                ),
            )  # fmt: skip
        found: tuple[np.ndarray, np.ndarray, np.ndarray, list[np.ndarray]] = self._frames[1][fingers]
        return found

    def felt(self, span: float) -> tuple[list[Contacts], np.ndarray, np.ndarray]:
        """Return what touched links, what joints bore, and what their motors did over the last frame.

        Args:
            span: [s] of the frame.

        Returns:
            Of each world, by link and by the other body's name, the force (3,) [N] on the link; (worlds, n, 6) the
            wrenches of `RobotState.joint_wrenches`; and the mean of what motors, friction and stops exert, (worlds, n)
            [N m; N].
        """
        engine = self.world.engine
        wrenches, efforts = engine.joint_loads(self.joints)
        found: list[dict[str, dict[str, np.ndarray]]] = [{} for _ in range(self.world.world_count)]
        for name, own in zip(self.links.names, engine.impulses(self.bodies), strict=True):
            for other, impulse in own.items():
                force = impulse / span
                for w in np.flatnonzero(impulse.any(axis=1)).tolist():
                    found[w].setdefault(name, {})[other] = force[w]
        return list(found), wrenches, efforts

    def pressing(self, contacts: Contacts, feet: Sequence[str]) -> dict[str, np.ndarray]:
        """Return what bodies that move load links other than the feet with, (3,) [N] by link.

        A body loads with its weight. What is more is a squeeze between the link and something else.

        Args:
            contacts: What touched the links in one world.
            feet: Names of links that are left out.
        """
        gravity, own = float(np.linalg.norm(self.world.gravity)), set(self.bodies)
        found: dict[str, np.ndarray] = {}
        for link, forces in contacts.items():
            for name, force in () if link in feet else forces.items():
                other = self.world.find(name)
                if other in own or not other.is_dynamic:
                    continue
                most = MAX_WEIGHT * float(np.min(other.mass)) * gravity
                share = min(1.0, most / float(np.linalg.norm(force)))
                found[link] = found.get(link, 0.0) + share * force
        return found

    def loads(self, pressing: Sequence[Mapping[str, np.ndarray]]) -> list[np.ndarray | None]:
        """Return what links carry does to each of Pinocchio's joints (joints, 6) [N, N m], in its own frame.

        Of each world; None for nothing.

        Args:
            pressing: Of each world, forces (3,) [N] at links' centres of mass, by link; what grips bear is added.
        """
        index = {body: k for k, body in enumerate(self.bodies)}
        others = [body for body in self.world.bodies if body not in index]
        held = [(index[grip.target], grip) for grip in grips_of(others) if grip.target in index]
        if not held and not any(pressing):
            return [None] * self.world.world_count
        found = np.zeros((self.world.world_count, self.robot.model.njoints, 6))
        for k, grip in held:
            force, torque = (np.atleast_2d(part) for part in grip.wrench)
            for w in np.flatnonzero(holding(grip.spec, len(found))).tolist():
                self._add(found[w], k, w, held_points(grip, w).mean(axis=0), force[w], torque[w])
        for w, forces in enumerate(pressing):
            for name, push in forces.items():
                k = self.links.names.index(name)
                middle = np.atleast_2d(self.bodies[k].centre_of_mass)
                self._add(found[w], k, w, middle[min(w, len(middle) - 1)], push, np.zeros(3))
        return list(found)

    def hangs(self, worlds: int) -> np.ndarray:
        """Return in which of so many worlds something else than its own joints holds a link, (worlds,) bool."""
        own = {*self.joints, *self.fingers.joints}
        found = np.zeros(worlds, dtype=bool)
        for grip in grips_of(self.bodies):
            if grip not in own:
                found |= holding(grip.spec, worlds)
        return found

    def _add(self, loads: np.ndarray, k: int, world: int, point: Any, force: np.ndarray, torque: np.ndarray) -> None:
        """Add a force [N] at a point [m] and a torque [N m] on link ``k`` to the loads (joints, 6) of a world."""
        joint = self.links.joints[k]
        place, turn = (np.atleast_2d(part) for part in self.bodies[joint - 1].pose())
        row = min(world, len(place) - 1)
        back = quat.inverse(turn[row])
        moment = torque + np.cross(point - place[row], force)
        loads[joint] += np.concatenate([quat.rotate(back, force), quat.rotate(back, moment)])

    def imagined(self, world: World) -> LinkDynamics:
        """Return the same for the copies of the links in a batch that was imagined from their world."""
        made = copy.copy(self)
        made.world, made.bodies = world, tuple(world.find(body.name) for body in self.bodies)
        keys: dict[str, Any] = {grip.key: grip for grip in grips_of(made.bodies)}
        made.joints = tuple(keys[joint.key] for joint in self.joints)
        made.fingers = self.fingers.imagined(world, made.bodies, keys)
        return made

    def take(self, copies: LinkDynamics | None) -> None:
        """Have the joints of copies, one of whose worlds its own has become; None for copies without dynamics.

        They are others where the links were detached and attached since.
        """
        self.forget()
        if copies is not None:
            keys: dict[str, Any] = {grip.key: grip for grip in grips_of(self.bodies)}
            self.joints = tuple(keys[joint.key] for joint in copies.joints)
            self.fingers.joints = tuple(keys[joint.key] for joint in copies.fingers.joints)

    def save(self) -> tuple[Any, ...]:
        """Return its joints, for ``load``."""
        return self.joints, self.fingers.joints

    def load(self, saved: tuple[Any, ...]) -> None:
        """Become what it was when a snapshot was taken."""
        self.joints, self.fingers.joints = saved


def _frames_of(
    joints: Sequence[Joint], own: list[int], other: list[int]
) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[np.ndarray]]:
    """Return which bodies joints are of, whether they slide, and their frames (worlds, k, 3 or 4) in both bodies."""
    specs = [joint.spec for joint in joints]
    names = ("place", "turn", "other_place", "other_turn")
    frames = [np.stack([getattr(spec, name) for spec in specs], axis=1) for name in names]
    slides = np.array([spec.kind == "slider" for spec in specs])
    return np.array(own, dtype=int), np.array(other, dtype=int), slides, frames


def grips_of(bodies: Iterable[Body]) -> list[Grip]:
    """Return what holds bodies, joints included."""
    return [grip for body in bodies if (own := dynamics_of(body)) is not None for grip in own.grips]


def _axis_of(joint: Any) -> tuple[bool, np.ndarray]:
    """Return True if a joint of the model slides, and its axis in its own frame (3,)."""
    kind = joint.shortname()
    if kind[-1] in "XYZ":
        return "JointModelP" in kind, np.eye(3)["XYZ".index(kind[-1])]
    return "Prismatic" in kind, np.asarray(joint.extract().axis)
