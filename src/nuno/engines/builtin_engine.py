"""Nuno's own engine behind the protocol: its solvers are the world's, and `nuno.world.advancing` steps them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.bodies.dynamics import Dynamics, ParticleDynamics, State
from nuno.bodies.given_velocity import GivenVelocity
from nuno.bodies.make_dynamics import make_dynamics, start_dynamics
from nuno.engines.engine import CAPABILITIES, Engine
from nuno.engines.world_view import dynamics_of
from nuno.materials import Material, Rigid

if TYPE_CHECKING:
    from nuno.bodies.body import Body


class BuiltinEngine(Engine):
    """The XPBD solvers in Warp kernels."""

    name = "nuno"
    capabilities = frozenset(CAPABILITIES)
    is_builtin = True

    def attach(self, body: Body, material: Any) -> Dynamics:
        """Return dynamics for a static body in the shape that it has now, at rest."""
        return start_dynamics(body, material, self.world)

    def make(self, body: Body, material: Material, state: State, friction: Any, neutral: bool = False) -> Dynamics:
        """Return dynamics for a body in a state of its own kind, or a neutral one."""
        if not neutral:
            return make_dynamics(body, material, state, friction, self.world)
        if isinstance(material, Rigid):
            from nuno.bodies.rigid_dynamics import RigidDynamics

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

    @property
    def _stepping(self) -> Any:
        return self.world._stepping

    def wrench(self, grip: Any) -> tuple[np.ndarray, np.ndarray]:
        """Return what a grip bears."""
        return self._stepping.wrench(grip)

    def effort(self, joint: Any) -> np.ndarray:
        """Return what a joint's drives do."""
        return self._stepping.effort(joint)
