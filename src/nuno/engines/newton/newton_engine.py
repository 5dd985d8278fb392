"""The Newton engine: cloth, soft and rigid bodies in one system by Newton's vertex block descent (SolverVBD)."""

from __future__ import annotations

from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.dynamics.dynamics import Dynamics, State
from nuno.engines.array_dynamics import ArrayParticles, make_arrays, state_at_rest
from nuno.engines.driven_motion import driven_hold, driven_points, kinematic_poses
from nuno.engines.engine import Engine
from nuno.engines.newton.newton_resolution import MINIMUM, substeps_for
from nuno.engines.world_view import attached, dynamics_of
from nuno.errors import MissingPackageError
from nuno.joints.tie import HoldSpec
from nuno.kernels.quiet import quiet_warp
from nuno.materials import Material

if TYPE_CHECKING:
    from nuno.bodies.body import Body
    from nuno.engines.newton.newton_model import NewtonModel
    from nuno.engines.newton.newton_substeps import NewtonSubsteps
    from nuno.engines.world_view import EngineWorld

ITERATIONS = 5
"""Of a substep."""


class NewtonEngine(Engine):
    """Newton's SolverVBD on the CPU or CUDA, its substeps recorded once and replayed for each frame."""

    name = "newton"
    capabilities = frozenset(
        {
            "rigid bodies", "cloth", "soft bodies", "self-contact of cloth", "worlds' materials", "moving shapes",
            "grips of vertices", "grips of rigid bodies", "elastic energy", "air drag", "batch", "cuda",
        }
    )  # fmt: skip

    def __init__(self, world: EngineWorld) -> None:
        super().__init__(world)
        if find_spec("newton") is None:
            raise MissingPackageError("newton", "newton", 'World(engine="newton")')
        quiet_warp()
        self._made: NewtonModel | None = None
        self._substeps: NewtonSubsteps | None = None
        self._gravity: tuple[float, ...] = ()
        self._count = MINIMUM
        self._settings: tuple[float, int | None] = (0.0, None)

    def attach(self, body: Body, material: Any) -> Dynamics:
        """Return dynamics for a static body in the shape that it has now, at rest."""
        state = state_at_rest(body, material, self.world.world_count)
        return self.make(body, material, state, material.friction)

    def make(self, body: Body, material: Material, state: State, friction: Any, neutral: bool = False) -> Dynamics:
        """Return dynamics for a body in a state."""
        self.changed()
        return make_arrays(body, material, state, friction, self.world)

    def load(self, body: Body, state: State, neutral: bool = False) -> None:
        """Set a dynamic body's state."""
        dynamics_of(body).load_state(state)

    def changed(self) -> None:
        """Build the model anew before the next step."""
        self._made = self._substeps = None

    def step(self, start: float, end: float) -> None:
        """Advance all dynamic bodies from ``start`` to ``end`` [s]."""
        gravity = tuple(float(part) for part in self.world.gravity)
        if self._made is None or gravity != self._gravity or any(own.grips_changed for own in attached(self.world)):
            from nuno.engines.newton.newton_model import build_model

            for each in attached(self.world):
                each.grips_changed = False
            self._made, self._substeps, self._gravity = build_model(self.world), None, gravity
            self._settings = (0.0, None)
        settings = (float(self.world.frame_rate), self.world.substeps)
        if settings != self._settings:
            self._count, self._settings = substeps_for(self.world), settings
            for each in attached(self.world):
                each.substeps = self._count
        if self._substeps is None:
            from nuno.engines.newton.newton_substeps import NewtonSubsteps

            self._substeps = NewtonSubsteps(self._made, self.world, ITERATIONS)
        frame = 1.0 / self.world.frame_rate
        span = end - start
        count = max(2, 2 * round(0.5 * self._count * span / frame + 1e-6))  # even: states change places
        times = start + span * np.arange(1, count + 1) / count
        substeps, worlds = self._substeps, self.world.world_count
        for body in self._moving():
            dynamics: Any = dynamics_of(body)
            if isinstance(dynamics, ArrayParticles):
                substeps.put_particles(body, dynamics)
                if substeps.held(body):
                    from nuno.engines.newton.newton_model import held_vertices

                    driven = [(grip, v, driven_points(grip, start, span, times)) for grip, v in held_vertices(body)]
                    substeps.lead_particles(body, [(v, places) for _, v, places in driven])
            else:
                substeps.put_body(body, dynamics.values)
                if body.key in self._made.driven_bodies:
                    holds = [grip for grip in dynamics.grips if isinstance(grip.spec, HoldSpec)]
                    ends = np.concatenate([[start], times])
                    substeps.lead_body(body, *driven_hold(holds[-1], start, end, ends, worlds), span / count)
        for body in self.world.bodies:
            if not body.is_dynamic and body.key in self._made.driven_bodies:
                ends = np.concatenate([[start], times])
                substeps.lead_body(body, *kinematic_poses(self.world, body, start, end, ends), span / count)
        for body in self._moving():
            for push in dynamics_of(body).pushing(start):
                substeps.push(body, push.force)
        substeps.run(count, span / count)
        for body in self._moving():
            substeps.read(body, dynamics_of(body))

    def _moving(self) -> list[Body]:
        return [body for body in self.world.bodies if body.is_dynamic]
