"""Substeps: a Newton solver's states on the device, and the frame of substeps that is recorded and replayed."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from nuno.engines.array_dynamics import ArrayRigid
from nuno.engines.newton import newton_kernels as kernels
from nuno.engines.world_view import dynamics_of
from nuno.shapes import quaternion as quat

if TYPE_CHECKING:
    from nuno.bodies.body import Body
    from nuno.engines.newton.newton_model import NewtonModel
    from nuno.engines.world_view import EngineWorld

SLIP = 1e-4
"""[m/s] below which friction is less than Coulomb's: what sticks creeps by less."""


class NewtonSubsteps:
    """A solver, its contacts, and its state.

    Args:
        made: The model.
        world: Its world.
        iterations: Of the solver in a substep.
    """

    def __init__(self, made: NewtonModel, world: EngineWorld, iterations: int) -> None:
        import newton

        self.made, self.worlds = made, world.world_count
        model = self.model = made.model
        self.device = model.device
        self.pipeline: Any = None
        self.contacts: Any = None
        if model.shape_count:
            self.pipeline = newton.CollisionPipeline(model, soft_contact_gap=0.005)
            self.contacts = self.pipeline.contacts()
        touching = made.touching
        self.solver = newton.solvers.SolverVBD(
            model, iterations=iterations, friction_epsilon=SLIP, particle_enable_tile_solve=False,
            particle_enable_self_contact=touching is not None, particle_self_contact_margin=touching,
            particle_self_contact_gap=None if touching is None else 0.5 * touching,
        )  # fmt: skip
        self.now, self.after, self.control = model.state(), model.state(), model.control()
        self.positions = np.zeros((model.particle_count, 3), np.float32)
        self.velocities, self.force = np.zeros_like(self.positions), np.zeros_like(self.positions)
        self.poses = np.zeros((model.body_count, 7), np.float32)
        self.speeds = np.zeros((model.body_count, 6), np.float32)
        self.wrenches = np.zeros_like(self.speeds)
        self.forces_on: Any = wp.zeros(int(model.particle_count), dtype=wp.vec3, device=self.device)
        twist: Any = wp.spatial_vector
        self.wrenches_on: Any = wp.zeros(int(model.body_count), dtype=twist, device=self.device)
        self.leads: dict[str, tuple[np.ndarray, np.ndarray]] = {}
        self.body_leads: dict[str, tuple[np.ndarray, np.ndarray, np.ndarray]] = {}
        self._tables: dict[str, Any] = {}
        self._graphs: dict[tuple[int, float], Any] = {}
        self._drags = self._air_drags(world)

    def _air_drags(self, world: EngineWorld) -> tuple[np.ndarray, np.ndarray]:
        """Return the rates of particles and of bodies [1/s]."""
        of_particles, of_bodies = np.zeros(self.model.particle_count), np.zeros(self.model.body_count)
        for body in world.bodies:
            if not body.is_dynamic:
                continue
            dynamics = dynamics_of(body)
            rates = np.broadcast_to(np.asarray(dynamics.material.air_drag).reshape(-1), (self.worlds,))
            if body.key in self.made.bodies:
                of_bodies[self.made.bodies[body.key]] = rates
            else:
                count = dynamics.mass.shape[1]
                for first, rate in zip(self.made.particles[body.key], rates, strict=True):
                    of_particles[first : first + count] = rate
        return of_particles, of_bodies

    # What a frame begins with

    def put_particles(self, body: Body, dynamics: Any) -> None:
        """Take a deformable body's positions and velocities."""
        count = dynamics.values["positions"].shape[1]
        for world, first in enumerate(self.made.particles[body.key]):
            self.positions[first : first + count] = dynamics.values["positions"][world] - self.made.origin
            self.velocities[first : first + count] = dynamics.values["velocities"][world]

    def put_body(self, body: Body, values: dict[str, np.ndarray]) -> None:
        """Take a rigid body's pose and speeds."""
        rows = self.made.bodies[body.key]
        self.poses[rows, :3] = values["place"] - self.made.origin
        self.poses[rows, 3:] = values["turn"][:, [1, 2, 3, 0]]
        self.speeds[rows, :3], self.speeds[rows, 3:] = values["velocity"], values["spin"]

    def held(self, body: Body) -> bool:
        """Return True if a body may have driven vertices."""
        return bool(dynamics_of(body).grips)

    def lead_particles(self, body: Body, grips: list[tuple[np.ndarray, np.ndarray]]) -> None:
        """Take where grips' vertices (worlds, k) are driven to at each substep's end, (worlds, k, substeps, 3) [m]."""
        first = self.made.particles[body.key][:, None]
        indices, places = [], []
        for vertices, where in grips:
            here = vertices >= 0
            indices.append((np.broadcast_to(first, vertices.shape) + vertices)[here])
            places.append(np.swapaxes((where - self.made.origin)[here], 0, 1))
        self.leads[body.key] = (np.concatenate(indices), np.concatenate(places, axis=1))

    def lead_body(self, body: Body, place: np.ndarray, turn: np.ndarray, dt: float) -> None:
        """Take where a body is driven at the start and at each substep's end: (worlds, substeps + 1, 3) and (.., 4)."""
        rows = self.made.bodies[body.key]
        poses = np.concatenate([place - self.made.origin, turn[..., [1, 2, 3, 0]]], axis=-1)
        spin = quat.multiply(turn[:, 1:], turn[:, :-1] * np.array([1.0, -1.0, -1.0, -1.0]))
        spin = 2.0 * spin[..., 1:] * np.sign(spin[..., :1]) / dt
        speeds = np.concatenate([np.diff(place, axis=1) / dt, spin], axis=-1)
        self.poses[rows], self.speeds[rows] = poses[:, 0], speeds[:, 0]
        self.body_leads[body.key] = (rows, np.swapaxes(poses[:, 1:], 0, 1), np.swapaxes(speeds, 0, 1))

    def push(self, body: Body, force: np.ndarray) -> None:
        """Add forces [N], of a rigid body forces and torques, for this frame."""
        if body.key in self.made.bodies:
            self.wrenches[self.made.bodies[body.key]] += force
        else:
            for world, first in enumerate(self.made.particles[body.key]):
                self.force[first : first + force.shape[1]] += force[min(world, len(force) - 1)]

    # The frame

    def run(self, count: int, dt: float) -> None:
        """Go through a frame of ``count`` substeps, an even number."""
        now = self.now
        if self.model.particle_count:
            now.particle_q.assign(self.positions)
            now.particle_qd.assign(self.velocities)
            self.forces_on.assign(self.force)
        if self.model.body_count:
            now.body_q.assign(self.poses)
            now.body_qd.assign(self.speeds)
            self.wrenches_on.assign(self.wrenches)
            if hasattr(self.solver, "body_q_prev"):
                self.solver.body_q_prev.assign(self.poses)  # else what was put elsewhere would seem to have moved
        self._bring_tables(dt)
        key = (count, round(dt, 9))
        if key not in self._graphs:
            self._go(count, dt)  # compiles, and makes what arrays it needs
            self._graphs[key] = None
        elif self._graphs[key] is None:
            with wp.ScopedCapture(device=self.device) as capture:
                self._go(count, dt)
            self._graphs[key] = capture.graph
            wp.capture_launch(capture.graph)
        else:
            wp.capture_launch(self._graphs[key])
        if self.model.particle_count:
            self.positions, self.velocities = now.particle_q.numpy().copy(), now.particle_qd.numpy().copy()
        if self.model.body_count:
            self.poses, self.speeds = now.body_q.numpy().copy(), now.body_qd.numpy().copy()
        self.force[:] = 0.0
        self.wrenches[:] = 0.0
        self.leads.clear()
        self.body_leads.clear()

    def _go(self, count: int, dt: float) -> None:
        state, after, tables = self.now, self.after, self._tables
        for substep in range(count):
            if "indices" in tables:
                wp.launch(
                    kernels.lead_particles, dim=len(tables["indices"]),
                    inputs=[tables["indices"], tables["places"], substep],
                    outputs=[state.particle_q, state.particle_qd], device=self.device,
                )  # fmt: skip
            if "rows" in tables:
                wp.launch(
                    kernels.lead_bodies, dim=len(tables["rows"]),
                    inputs=[tables["rows"], tables["poses"], tables["speeds"], substep],
                    outputs=[state.body_q, state.body_qd], device=self.device,
                )  # fmt: skip
            if self.model.particle_count:
                wp.copy(state.particle_f, self.forces_on)
                wp.launch(kernels.drag_particles, dim=self.model.particle_count,
                          inputs=[tables["drag"], state.particle_qd], device=self.device)  # fmt: skip
            if self.model.body_count:
                wp.copy(state.body_f, self.wrenches_on)
                wp.launch(kernels.drag_bodies, dim=self.model.body_count,
                          inputs=[tables["body drag"], state.body_qd], device=self.device)  # fmt: skip
            if self.pipeline is not None:
                self.pipeline.collide(state, self.contacts)
            self.solver.step(state, after, self.control, self.contacts, dt)
            state, after = after, state

    def _bring_tables(self, dt: float) -> None:
        # not while a frame is recorded: CUDA's graph would copy from the host's arrays again in each frame, long gone
        for name, rates in zip(("drag", "body drag"), self._drags, strict=True):
            self._kept(name, (1.0 / (1.0 + rates * dt)).astype(np.float32), float)
        if self.leads:
            indices = np.concatenate([index for index, _ in self.leads.values()]).astype(np.int32)
            places = np.concatenate([place for _, place in self.leads.values()], axis=1).astype(np.float32)
            self._kept("indices", indices, wp.int32)
            self._kept("places", places, wp.vec3)
        if self.body_leads:
            rows, poses, speeds = zip(*self.body_leads.values(), strict=True)
            self._kept("rows", np.concatenate(rows).astype(np.int32), wp.int32)
            self._kept("poses", np.concatenate(poses, axis=1).astype(np.float32), wp.transform)
            self._kept("speeds", np.concatenate(speeds, axis=1).astype(np.float32), wp.spatial_vector)

    def _kept(self, name: str, values: np.ndarray, dtype: Any) -> Any:
        """Return an array on the device that a recorded frame may go on reading, with these values now."""
        there = self._tables.get(name)
        axes = 1 if dtype in (wp.int32, float) else 2
        if there is None or there.shape != values.shape[: there.ndim]:
            self._graphs.clear()
            self._tables[name] = wp.array(values, dtype=dtype, device=self.device, ndim=axes)
        else:
            there.assign(values)
        return self._tables[name]

    # What it leaves

    def read(self, body: Body, dynamics: Any) -> None:
        """Give a body what came out."""
        values = dynamics.values
        if isinstance(dynamics, ArrayRigid):
            rows = self.made.bodies[body.key]
            poses, speeds = self.poses[rows].astype(float), self.speeds[rows].astype(float)
            turn = poses[:, [6, 3, 4, 5]]
            values["place"] = poses[:, :3] + self.made.origin
            values["turn"] = turn / np.linalg.norm(turn, axis=1, keepdims=True)
            values["velocity"], values["spin"] = speeds[:, :3], speeds[:, 3:]
            return
        count = values["positions"].shape[1]
        for world, first in enumerate(self.made.particles[body.key]):
            values["positions"][world] = self.positions[first : first + count].astype(float) + self.made.origin
            values["velocities"][world] = self.velocities[first : first + count]
