"""The protocol of engines: what every engine of a world does, and the table of what each of them can."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from nuno.engines.array_dynamics import motions_of
from nuno.engines.driven_motion import kinematic_velocity
from nuno.engines.engine_needs import needs_of_dynamics, needs_of_grip
from nuno.engines.world_view import attached, dynamics_of
from nuno.errors import EngineCapabilityError

if TYPE_CHECKING:
    from nuno.bodies.body import Body
    from nuno.bodies.contact_rules import ContactRules
    from nuno.dynamics.dynamics import Dynamics, State
    from nuno.engines.world_view import EngineWorld
    from nuno.joints.grip import Grip
    from nuno.materials import Material
    from nuno.numbers.device_array import DeviceArray
    from nuno.tables.kinematic_motion import Schedule

CAPABILITIES: dict[str, str] = {
    "rigid bodies": "attach with Rigid",
    "cloth": "attach a sheet or cloth mesh with Cloth",
    "soft bodies": "attach a soft shape with Soft",
    "self-contact of cloth": "layers of one cloth touch each other",
    "self-contact of soft bodies": "Soft(self_contact=True)",
    "restitution": "Rigid(restitution=...) above 0",
    "directed stretch": "a stretch stiffness for warp and weft",
    "directed bending": "a bending rigidity for warp and weft",
    "elements' materials": "values of a material by element",
    "worlds' materials": "values of a material by world",
    "moving shapes": "static bodies that follow paths",
    "pair friction": "set_friction",
    "grips of vertices": "grip of vertices of a cloth or soft body",
    "grips inside faces": "grip of points between vertices",
    "grips of rigid bodies": "grip of a rigid body as a whole",
    "sliding grips": "grip(free=...)",
    "sliding welds": "grip(free=...) to a body that moves",
    "compliant grips": "grip(compliance=...) of points, above 0",
    "compliant grips of rigid bodies": "grip(compliance=...) or weld of a rigid body, above 0",
    "limited grips": "grip(max_force=...) of points",
    "limited welds and joints": "max_force below 10 kN of ties, joints, and grips of rigid bodies",
    "ties": "grip or weld of points to a body that moves",
    "welds of rigid bodies": "grip or weld of a rigid body to another that moves",
    "hinges": "hinge",
    "sliders": "slider",
    "ball joints": "ball_joint",
    "fixed joints": "fixed_joint",
    "joint drives": "motors, springs, friction and limits of hinges and sliders",
    "drives of ball joints": "springs, friction and cones of ball joints",
    "wrench": "what a grip or joint bears",
    "effort": "what a joint's drives do",
    "contacts": "World.contacts: points, normals, forces",
    "impulses": "ContactPoints.impulses and sum_impulses",
    "elastic energy": "Body.elastic_energy",
    "air drag": "air_drag of a material",
    "batch": "imagine(n) with n above 1",
    "cuda": 'World(device="cuda")',
    "robots with dynamics": "SimulatedRobot(dynamics=True); others follow paths",
}
"""What an engine may be able to do, and by what it is asked for."""


class Engine(ABC):
    """The engine of one world: it makes the dynamics of bodies and steps them.

    A world asks `allow_dynamics` and `allow_grip` before it changes anything; what the engine lacks is refused there,
    by name. Bodies, grips and rules are the world's own, to be read whenever the engine steps; `changed` says that
    any of them is another now.

    Attributes:
        name: What ``World(engine=...)`` calls it.
        capabilities: The names in `CAPABILITIES` that it has.
        is_builtin: Whether it is Nuno's own, whose states and steps are the world's.
        world: The world.
        rules: The rules of which pairs touch, and their friction; the world's own.
        schedule: Where kinematic bodies are in the present step, None where there are none.

    Args:
        world: The world, still empty.

    Raises:
        MissingPackageError: the engine's package is not installed.
    """

    name: ClassVar[str]
    capabilities: ClassVar[frozenset[str]]
    is_builtin: ClassVar[bool] = False

    rules: ContactRules
    schedule: Schedule | None = None

    def __init__(self, world: EngineWorld) -> None:
        self.world = world

    def __repr__(self) -> str:
        return f"<engine {self.name!r}>"

    # What it can do

    def require(self, *names: str, hint: str = "") -> None:
        """Refuse what the engine lacks.

        Raises:
            EngineCapabilityError: it lacks one of them.
        """
        for name in names:
            if name not in self.capabilities:
                from nuno.engines.engine_table import engines_with

                raise EngineCapabilityError(self.name, name, engines_with(name), hint)

    def allow_dynamics(self, body: Body, material: Material) -> None:
        """Refuse dynamics that the engine lacks, before anything changes.

        Raises:
            EngineCapabilityError: it cannot move such a body, or not of such a material.
        """
        self.require(*needs_of_dynamics(body, material, self.world))

    def allow_contacts(self) -> None:  # noqa: B027, most tell any pairs apart
        """Refuse rules of which pairs touch that the engine lacks, before a run.

        Raises:
            InvalidInputError: it cannot tell so many kinds of bodies apart.
        """

    def allow_grip(self, spec: Any, on_moving: bool) -> None:
        """Refuse a grip, weld or joint that the engine lacks, before anything changes.

        Args:
            spec: Its numbers, ``Grip.spec``.
            on_moving: Whether the other body is dynamic.

        Raises:
            EngineCapabilityError: it cannot hold that.
        """
        self.require(*needs_of_grip(spec, on_moving))

    # Dynamics

    @abstractmethod
    def attach(self, body: Body, material: Any) -> Dynamics:
        """Return dynamics for a static body in the shape that it has now, at rest."""

    @abstractmethod
    def make(self, body: Body, material: Material, state: State, friction: Any, neutral: bool = False) -> Dynamics:
        """Return dynamics for a body in a state that ``Dynamics.state`` gave, or `neutral_state` where ``neutral``."""

    def neutral_state(self, body: Body) -> State:
        """Return a dynamic body's state as every engine takes it, in numbers of double precision.

        Of cloth and soft bodies "positions" [m] and "velocities" [m/s] (worlds, n, 3). Of rigid ones "place" [m] and
        "turn" (w, x, y, z), of the body's frame, "velocity" [m/s] of its centre of mass and "spin" [rad/s] (worlds, 3
        or 4).
        """
        dynamics = dynamics_of(body)
        if not dynamics.is_rigid:
            return {"positions": dynamics.vertices(body).copy(), "velocities": dynamics.velocities(body).copy()}
        worlds = self.world.world_count
        place, turn = (np.array(np.broadcast_to(part, (worlds, part.shape[-1]))) for part in dynamics.pose(body))
        motion = dynamics.motion(body)
        return {"place": place, "turn": turn, "velocity": motion.velocity, "spin": motion.angular_velocity}

    @abstractmethod
    def load(self, body: Body, state: State, neutral: bool = False) -> None:
        """Set a dynamic body's state, see `make`; all bodies are in the world by now."""

    @abstractmethod
    def changed(self) -> None:
        """Be told that bodies came, went or were moved, or that grips, rules or friction have changed."""

    def drives_changed(self, joint: Grip) -> None:
        """Be told that a joint's motor, spring, friction or stops are others now, and nothing else."""
        self.changed()

    # Time

    @abstractmethod
    def step(self, start: float, end: float) -> None:
        """Advance all dynamic bodies from ``start`` to ``end`` [s], a frame or a part of one.

        Kinematic bodies are where `schedule` says, grips lead where `nuno.engines.driven_motion` says, and a body is
        pushed by ``Dynamics.pushing(start)`` throughout.
        """

    def prepare_run(self) -> None:  # noqa: B027, most have nothing to bring
        """Bring what a run that fails goes back to, before it is kept."""

    def finite(self, body: Body) -> np.ndarray:
        """Return (worlds,) bool, whether all numbers of a dynamic body's state are finite."""
        return np.atleast_1d(dynamics_of(body).finite())

    def keep(self) -> Any:
        """Return what `put_back` takes, all that a run changes."""
        return [(dynamics, dynamics.state()) for dynamics in attached(self.world)]

    def put_back(self, kept: Any) -> None:
        """Set all that a run changes to what it was at `keep`."""
        for dynamics, state in kept:
            dynamics.load_state(state)

    def keeps(self, dynamics: Dynamics) -> bool:
        """Return True if a body's dynamics, of the right material, can be set to a state that is restored."""
        return True

    # What it tells

    def positions(self, body: Body) -> DeviceArray:
        """Return the vertices of a cloth or soft body [m], a Warp array (worlds, n) of vec3 on the world's device."""
        world: Any = self.world
        positions: DeviceArray = world.state(body)["positions"]
        return positions

    def rigid_motions(self, bodies: Sequence[Body]) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Return where dynamic rigid bodies are and how they move; see ``World.rigid_motion``."""
        return motions_of(bodies)

    def velocity_at(self, body: Body | None, point: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the velocity [m/s] of a point of a body that does not deform, and its spin [rad/s], (worlds, 3) each.

        Args:
            body: The body; None is the world.
            point: (worlds, 3) [m].
        """
        if body is None:
            return np.zeros_like(point), np.zeros_like(point)
        if (dynamics := dynamics_of(body)) is not None:
            motion = dynamics.motion(body)
            spin = motion.angular_velocity
            return motion.velocity + np.cross(spin, point - motion.centre), spin
        return kinematic_velocity(self.world, body, point)

    def wrench(self, grip: Grip) -> tuple[np.ndarray, np.ndarray]:
        """Return the force [N] and torque [N m], (worlds, 3) each, that a grip or joint bears; see ``Grip.wrench``."""
        self.require("wrench")
        raise NotImplementedError

    def effort(self, joint: Grip) -> np.ndarray:
        """Return (worlds,), what a joint's drives do; see ``Joint.effort``."""
        self.require("effort")
        raise NotImplementedError

    def joint_loads(self, joints: Sequence[Grip]) -> tuple[np.ndarray, np.ndarray]:
        """Return what joints bore and did in the last frame, as ``Joint.wrench`` and ``Joint.effort`` tell of each.

        Returns:
            Force [N] and torque [N m] of each body on the other, (worlds, n, 6), in the world's axes and about the
            joint, and what motors, springs, friction and stops did, (worlds, n). Zeros before the first frame.
        """
        self.require("wrench", "effort")
        raise NotImplementedError

    def impulses(self, bodies: Sequence[Body]) -> list[dict[str, np.ndarray]]:
        """Return what contacts gave bodies in the last frame, by the other body's name, (worlds, 3) [N s] each.

        Of a cloth or soft body those with static ones are told where ``World.sum_impulses`` asks for them.
        """
        self.require("impulses")
        raise NotImplementedError

    def contacts(self, body: Body, itself: bool) -> Iterable[tuple[Any, ...]]:
        """Return a dynamic body's contacts: rows of point, normal, force, the other's name, and the world."""
        self.require("contacts")
        raise NotImplementedError
