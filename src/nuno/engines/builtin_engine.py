"""Nuno's own engine behind the protocol: its solvers are the world's, and `nuno.world.advancing` steps them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.bodies.given_velocity import GivenVelocity
from nuno.dynamics.dynamics import Dynamics, ParticleDynamics, State
from nuno.dynamics.make_dynamics import make_dynamics, start_dynamics
from nuno.engines.builtin_contacts import contact_impulses, contact_rows
from nuno.engines.engine import CAPABILITIES, Engine
from nuno.engines.world_view import attached, dynamics_of
from nuno.materials import Material, Rigid

if TYPE_CHECKING:
    from nuno.bodies.body import Body
    from nuno.dynamics.rigid_dynamics import RigidScene
    from nuno.engines.builtin_world import BuiltinWorld, FrameSteps
    from nuno.joints.grip import Grip
    from nuno.numbers.device_array import DeviceArray


class BuiltinEngine(Engine):
    """The XPBD solvers in Warp kernels."""

    name = "nuno"
    capabilities = frozenset(CAPABILITIES)
    is_builtin = True

    world: BuiltinWorld

    def allow_dynamics(self, body: Body, material: Material) -> None:
        """Refuse nothing."""

    def allow_grip(self, spec: Any, on_moving: bool) -> None:
        """Refuse nothing."""

    def attach(self, body: Body, material: Any) -> Dynamics:
        """Return dynamics for a static body in the shape that it has now, at rest."""
        return start_dynamics(body, material, self.world)

    def make(self, body: Body, material: Material, state: State, friction: Any, neutral: bool = False) -> Dynamics:
        """Return dynamics for a body in a state of its own kind, or a neutral one."""
        if not neutral:
            return make_dynamics(body, material, state, friction, self.world)
        if isinstance(material, Rigid):
            from nuno.dynamics.rigid_dynamics import RigidDynamics

            return RigidDynamics(body, material, friction, self.world)
        return ParticleDynamics(
            body.shape, material, state["positions"], state["velocities"], friction, self.world
        )  # fmt: skip

    def load(self, body: Body, state: State, neutral: bool = False) -> None:
        """Set a dynamic body's state."""
        dynamics = dynamics_of(body)
        if not neutral:
            dynamics.load_state(state)
        elif isinstance(dynamics, ParticleDynamics):
            worlds = np.arange(self.world.world_count)
            dynamics.set_vertices(state["positions"], state["velocities"], worlds)
        else:
            dynamics.place(body, state["place"], state["turn"])
            dynamics.set_velocity(body, GivenVelocity(state["velocity"], state["spin"]))

    def changed(self) -> None:
        """Do nothing: the world's own tables say what has changed."""

    def step(self, start: float, end: float) -> None:
        """Advance all dynamic bodies."""
        self._stepping.run(start, end)

    def prepare_run(self) -> None:
        """List the static bodies that rigid ones may meet: what a run goes back to has them, and their pairs."""
        if any(dynamics.is_rigid for dynamics in attached(self.world)):
            self.world._bring_rigid()

    def keep(self) -> Any:
        """Return copies of all states where they are; nobody waits for a device."""
        own = attached(self.world)
        rigid = self._rigid
        return (
            [(dynamics, dynamics.keep()) for dynamics in own if isinstance(dynamics, ParticleDynamics)],
            None if rigid is None else rigid.save(),
            # a rigid body's forces are among what is saved
            [(dynamics, dynamics._pushing) for dynamics in own if dynamics.is_rigid],
        )

    def put_back(self, kept: Any) -> None:
        """Set all states to what they were."""
        particles, rigid, pushed = kept
        for dynamics, state in particles:
            dynamics.put_back(state)
        if rigid is not None and self._rigid is not None:
            self._rigid.load(rigid)
        for dynamics, pushing in pushed:
            dynamics._pushing = pushing

    def keeps(self, dynamics: Any) -> bool:
        """Return True if dynamics are of the solver that the world has now."""
        return not dynamics.is_rigid or dynamics.scene is self._rigid

    @property
    def _rigid(self) -> RigidScene | None:
        return self.world._rigid

    @property
    def _stepping(self) -> FrameSteps:
        return self.world._stepping

    def positions(self, body: Body) -> DeviceArray:
        """Return the vertices of a cloth or soft body, where the solver has them."""
        positions: DeviceArray = dynamics_of(body).solver.positions_on_device()
        return positions

    def rigid_motions(self, bodies: Sequence[Body]) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Return where dynamic rigid bodies are and how they move."""
        assert self._rigid is not None  # there are rigid bodies
        return self._rigid.motions(bodies)

    def velocity_at(self, body: Body | None, point: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the velocity of a point of a body that does not deform, and its spin."""
        scene = self._rigid
        slot = None if body is None or scene is None else scene.slot_of(body)
        if scene is None or slot is None:
            return np.zeros_like(point), np.zeros_like(point)
        velocity, spin = scene.solver.velocity(slot)
        middle, _ = scene.solver.pose(slot)
        return velocity + np.cross(spin, point - middle), spin

    def wrench(self, grip: Any) -> tuple[np.ndarray, np.ndarray]:
        """Return what a grip bears."""
        return self._stepping.wrench(grip)

    def effort(self, joint: Any) -> np.ndarray:
        """Return what a joint's drives do."""
        return self._stepping.effort(joint)

    def joint_loads(self, joints: Sequence[Grip]) -> tuple[np.ndarray, np.ndarray]:
        """Return what joints bore and did in the last frame."""
        worlds = self.world.world_count
        wrenches, efforts = np.zeros((worlds, len(joints), 6)), np.zeros((worlds, len(joints)))
        for coupled in self._stepping.last:
            index, borne, along = coupled.joint_loads()
            pairs = [(n, index[joint]) for n, joint in enumerate(joints) if joint in index]
            if not pairs:
                continue
            own, their = ([*part] for part in zip(*pairs, strict=True))
            kept = np.array([np.broadcast_to(coupled.kept[joints[n].body], (worlds,)) for n in own]).T
            wrenches[:, own] = np.where(kept[..., None], borne[:, their], wrenches[:, own])
            efforts[:, own] = np.where(kept, along[:, their], efforts[:, own])
        return wrenches, efforts

    def impulses(self, bodies: Sequence[Body]) -> list[dict[str, np.ndarray]]:
        """Return what contacts gave bodies in the last frame."""
        return contact_impulses(self.world, bodies)

    def contacts(self, body: Body, itself: bool) -> list[tuple[Any, ...]]:
        """Return a dynamic body's contacts."""
        return contact_rows(self.world, body, itself)
