"""LinkDynamics: a robot's links as rigid bodies with the model's inertias, joined by hinges and sliders with motors."""

from __future__ import annotations

import copy
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.errors import BodyStateError, InvalidInputError
from nuno.joints.held_points import held_points
from nuno.joints.joint import Joint
from nuno.joints.joint_group import JointGroup
from nuno.materials import Rigid
from nuno.robot.pinocchio import pin
from nuno.shapes import quaternion as quat
from nuno.world.contact_points import contact_impulses
from nuno.world.make_joints import hinge, slider

if TYPE_CHECKING:
    from nuno.bodies.body import Body
    from nuno.joints.grip import Grip
    from nuno.robot.links import Links
    from nuno.world.world import World

FULL_EFFORT = 0.01
"""[rad or m] How far a joint is from where it is wanted when its motor gives all that it can."""
BEARS = 1e5
"""[N] Force that a joint bears across its axis."""
SETTLES = 0.03
"""[s] In which a motor that follows a velocity comes to it,"""
MOST_WEIGHT = 1.5
"""Times its weight that a body which moves is taken to load a link with."""
HOLDS = 0.1
"""[s] and to its position."""


@dataclass(frozen=True, eq=False)
class Contacts:
    """Forces of contacts on links, (3,) [N] by link.

    Attributes:
        all: Of all that touches them.
        loads: Of bodies that move, up to some times their weight.
    """

    all: dict[str, np.ndarray]
    loads: dict[str, np.ndarray]

    def add(self, link: str, force: np.ndarray, most: Any) -> None:
        """Add a force (3,) [N]; ``most`` is that of a load, None of what is no load."""
        if not force.any():
            return
        self.all[link] = self.all.get(link, 0.0) + force
        if most is not None:
            share = min(1.0, float(np.min(most)) / float(np.linalg.norm(force)))
            self.loads[link] = self.loads.get(link, 0.0) + share * force


class LinkDynamics:
    """Forward dynamics of a robot's links.

    Each joint of the model carries one rigid body, with the mass, centre of mass and inertia of all links that are
    fixed to it. The joints are hinges and sliders with the model's limits; a motor in each exerts
    ``stiffness (wanted - position) + damping (wanted velocity - velocity) + effort`` up to the effort limit, anew in
    every substep. Links of one robot pass through each other. A robot without feet keeps its base where it is.

    Args:
        links: One body for each joint (``robot.enter(world, "joints")``).
        friction: Coulomb's coefficient of the links' surfaces.

    Attributes:
        stiffness: (n,) of motors that hold a position [N m/rad; N/m].
        damping: (n,) likewise [N m s/rad; N s/m].
        soft: Stiffness and damping of motors that exert given efforts and follow velocities softly, (n,) each.
        efforts: (n,) the most that they exert [N m; N], infinite where the model has no limit.
        joints: The joints while attached, in the order of ``joint_names``.

    Raises:
        InvalidInputError: links that are not one for each joint.
    """

    def __init__(self, links: Links, *, friction: float = 0.8) -> None:
        if not links.are_joints:
            raise InvalidInputError('dynamics need one body for each joint: robot.enter(world, "joints") makes them')
        self.links, self.robot, self.world, self.friction = links, links.robot, links.world, friction
        self.bodies = links.bodies
        self.joints: tuple[Joint, ...] = ()
        self._group: JointGroup | None = None
        model, limits = self.robot.model, self.robot.effort_limits
        self.efforts = np.where(np.isfinite(limits) & (limits > 0.0), limits, np.inf)
        inertia = np.array(pin.crba(model, model.createData(), self.robot.posture_configuration())).diagonal()[6:]
        self.stiffness = np.where(np.isfinite(self.efforts), self.efforts / FULL_EFFORT, inertia * 1e4)
        self.damping = 2.0 * np.sqrt(self.stiffness * inertia)
        self.soft = inertia / SETTLES / HOLDS, inertia / SETTLES
        self._gravity = float(np.linalg.norm(links.world.gravity))
        self._is_free = bool(self.robot.description.feet)

    @property
    def is_attached(self) -> bool:
        """Return True if the links move dynamically."""
        return bool(self.joints)

    def attach(self) -> None:
        """Give the links dynamics from where they are, at rest; motors hold the joints.

        Raises:
            BodyStateError: they have them, or have left their world.
        """
        if self.is_attached:
            raise BodyStateError(f"the links of {self.robot.name!r} are attached already")
        self.links.stop()
        world, model, bodies = self.world, self.robot.model, self.links.bodies
        angles = self.robot.angle_vector()
        placements = self.robot.update().oMi
        for k, body in enumerate(bodies):
            if k == 0 and not self._is_free:
                continue
            own = model.inertias[k + 1]
            inertia = _possible(np.array(own.inertia), float(own.mass))
            world.attach(
                body, Rigid(
                    mass=max(float(own.mass), 1e-3), inertia=inertia, centre_of_mass=own.lever, friction=self.friction
                ),
            )  # fmt: skip
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
            ))  # fmt: skip
        self.joints = tuple(joints)
        nothing = np.zeros(len(angles))
        self.drive(angles, nothing, self.stiffness, self.damping, nothing)

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
        self.joints = ()

    def drive(
        self, positions: np.ndarray, velocities: np.ndarray, stiffness: np.ndarray, damping: np.ndarray,
        effort: np.ndarray,
    ) -> None:  # fmt: skip
        """Set all motors: (n,) each, or (worlds, n)."""
        self._together().drive(positions, velocities, stiffness, damping, self.efforts, effort)

    def read(self) -> tuple[np.ndarray, np.ndarray]:
        """Return where the robot is, q (worlds, nq), and how it moves, v (worlds, nv), as Pinocchio has them."""
        robot, base, worlds = self.robot, self.bodies[0], self.world.world_count
        place, turn = (np.atleast_2d(part) for part in base.pose())
        v = np.zeros((worlds, robot.model.nv))
        angles, v[:, 6:] = self._together().read()
        if base.is_dynamic:
            back = quat.inverse(turn)
            spin = np.atleast_2d(base.angular_velocity)
            arm = place - np.atleast_2d(base.centre_of_mass)
            v[:, :3] = quat.rotate(back, np.atleast_2d(base.velocity) + np.cross(spin, arm))
            v[:, 3:6] = quat.rotate(back, spin)
        pose = np.broadcast_to(np.concatenate([place, np.roll(turn, -1, axis=1)], axis=1), (worlds, 7))
        return np.stack([robot.configuration_of(a, own) for a, own in zip(angles, pose, strict=True)]), v

    def efforts_now(self) -> np.ndarray:
        """Return what motors, friction and stops exert (worlds, n) [N m; N], the mean over the last frame."""
        return self._together().efforts()

    def contacts(self, seconds: float) -> list[Contacts]:
        """Return the mean forces of contacts over a last frame of some seconds, of each world."""
        found = [Contacts({}, {}) for _ in range(self.world.world_count)]
        names = dict(zip(self.bodies, self.links.names, strict=True))
        for (body, other), impulse in contact_impulses(self.world, self.bodies).items():
            # what moves weighs on a link with its weight; more is a squeeze between the link and something else
            most = MOST_WEIGHT * other.mass * self._gravity if other.is_dynamic and other not in names else None
            for own, force in zip(found, impulse / seconds, strict=True):
                own.add(names[body], force, most)
        return found

    def loads(self, pressing: Sequence[Mapping[str, np.ndarray]]) -> list[np.ndarray | None]:
        """Return what links carry does to each of Pinocchio's joints (njoints, 6) [N, N m], in its own frame.

        Of each world; None for nothing.

        Args:
            pressing: Of each world, forces (3,) [N] at links' centres of mass, by link; what grips bear is added.
        """
        index = {body: k for k, body in enumerate(self.bodies)}
        others = [body for body in self.world.bodies if body not in index]
        held = [(index[grip.target], grip) for grip in _grips_of(others) if grip.target in index]
        worlds = self.world.world_count
        if not held and not any(pressing):
            return [None] * worlds
        found: list[np.ndarray | None] = []
        tables = np.zeros((worlds, self.robot.model.njoints, 6))
        found += list(tables)
        for k, grip in held:
            force, torque = (np.atleast_2d(part) for part in grip.wrench)
            place, turn = (np.atleast_2d(part) for part in self.bodies[k].pose())
            for w, own in enumerate(tables):
                arm = held_points(grip, w).mean(axis=0) - place[w]
                back = quat.inverse(turn[w])
                moment = torque[w] + np.cross(arm, force[w])
                own[k + 1] += np.concatenate([quat.rotate(back, force[w]), quat.rotate(back, moment)])
        for w, forces in enumerate(pressing):
            for name, pushes in forces.items():
                k = self.links.names.index(name)
                turn = np.atleast_2d(self.bodies[k].pose()[1])
                local = quat.rotate(quat.inverse(turn[min(w, len(turn) - 1)]), pushes)
                lever = self.robot.model.inertias[k + 1].lever
                tables[w, k + 1] += np.concatenate([local, np.cross(lever, local)])
        return found

    def imagined(self, world: World) -> LinkDynamics:
        """Return the same for the copies of the links in a batch that was imagined from their world."""
        made = copy.copy(self)
        made.world, made.bodies = world, tuple(world.find(body.name) for body in self.bodies)
        keys = {grip.key: grip for grip in _grips_of(made.bodies)}
        made._group = None
        made.joints = tuple(keys[joint.key] for joint in self.joints)  # type: ignore[misc]
        return made

    def _together(self) -> JointGroup:
        """Return all joints as one group, made anew where they are others than before."""
        group = self._group
        if group is None or group.joints is not self.joints or not group.is_current():
            group = self._group = JointGroup(self.joints)
        return group


def _grips_of(bodies: Iterable[Body]) -> list[Grip]:
    """Return what holds bodies, joints included."""
    return [grip for body in bodies if body._dynamics is not None for grip in body._dynamics.grips]


def _possible(inertia: np.ndarray, mass: float) -> np.ndarray:
    """The nearest inertia that a mass can have: positive moments, none above the sum of the others."""
    moments, axes = np.linalg.eigh(0.5 * (inertia + inertia.T))
    spread = np.maximum(0.5 * moments.sum() - moments, 1e-9 + 1e-7 * mass)
    return np.asarray(axes @ np.diag(spread.sum() - spread) @ axes.T)


def _axis_of(joint: Any) -> tuple[bool, np.ndarray]:
    """Return True if a joint of the model slides, and its axis in its own frame (3,)."""
    kind = joint.shortname()
    if kind[-1] in "XYZ":
        return "JointModelP" in kind, np.eye(3)["XYZ".index(kind[-1])]
    return "Prismatic" in kind, np.asarray(joint.extract().axis)
