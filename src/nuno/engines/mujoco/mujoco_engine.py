"""MuJoCo as a world's engine: its own arrays are the bodies', and the batch of MuJoCo steps them."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from nuno.bodies.dynamics import Dynamics, State
from nuno.engines.array_dynamics import ArrayParticles, ArrayRigid
from nuno.engines.driven_motion import kinematic_poses
from nuno.engines.engine import CAPABILITIES, Engine
from nuno.engines.mujoco.mujoco_package import mujoco_package, warnings_logged
from nuno.engines.world_view import attached, bodies_by_key, dynamics_of
from nuno.materials import Material, Rigid
from nuno.shapes import quaternion as quat

if TYPE_CHECKING:
    from nuno.bodies.body import Body
    from nuno.world.simulation import Simulation

STEP = 0.0021
"""[s] The longest substep where none are asked for: MuJoCo's default is 2 ms, a frame of 1/60 s has 8 of 2.08 ms."""
BAD = ("mjWARN_BADQPOS", "mjWARN_BADQVEL", "mjWARN_BADQACC")
"""Of numbers that are not finite or beyond 1e10, by which MuJoCo tells that a simulation has diverged."""
LACKING = {
    "self-contact of soft bodies", "restitution", "sliding grips", "compliant grips", "limited grips", "sliders",
    "joint drives", "effort", "impulses", "cuda", "robots with dynamics",
}  # fmt: skip


class MujocoEngine(Engine):
    """MuJoCo 4: flexes with the ``discrete`` integrator, on the CPU; see docs/engines.md."""

    name = "mujoco"
    capabilities: ClassVar[frozenset[str]] = frozenset(CAPABILITIES) - LACKING

    def __init__(self, world: Simulation) -> None:
        super().__init__(world)
        mujoco_package()
        self._scene: Any = None
        self._is_current = False
        self._settings: tuple[Any, ...] = ()

    # Dynamics

    def attach(self, body: Body, material: Any) -> Dynamics:
        """Return dynamics for a static body in the shape that it has now, at rest."""
        worlds = self.world.world_count
        if isinstance(material, Rigid):
            place, turn = (np.broadcast_to(part, (worlds, part.shape[-1])) for part in body.pose())
            still = np.zeros((worlds, 3))
            values = {"place": place, "turn": turn, "velocity": still, "spin": still}
            return ArrayRigid(body, material, material.friction, self.world, values)
        vertices = np.broadcast_to(body.vertices, (worlds, *body.vertices.shape[-2:]))
        values = {"positions": vertices, "velocities": np.zeros(vertices.shape)}
        return ArrayParticles(body, material, material.friction, self.world, values)

    def make(self, body: Body, material: Material, state: State, friction: Any, neutral: bool = False) -> Dynamics:
        """Return dynamics for a body in a state."""
        kind = ArrayRigid if isinstance(material, Rigid) else ArrayParticles
        return kind(body, material, friction, self.world, state)

    def load(self, body: Body, state: State, neutral: bool = False) -> None:
        """Set a dynamic body's state."""
        dynamics_of(body).load_state(state)

    def changed(self) -> None:
        """Let the spec be looked through before the next step."""
        self._is_current = False

    @property
    def scene(self) -> Any:
        """The spec, the model and the batch, as the world is now."""
        if self._scene is None:
            from nuno.engines.mujoco.mujoco_scene import MujocoScene

            self._scene = MujocoScene(self.world)
        settings = (self.world.gravity, self.world.frame_rate, self.world.substeps, self.world.world_count)
        if not self._is_current or settings != self._settings:
            self._scene.bring(self.substep)
            self._is_current, self._settings = True, settings
        return self._scene

    @property
    def substep(self) -> float:
        """[s] The time of a substep of a whole frame."""
        frame = 1.0 / self.world.frame_rate
        return frame / (self.world.substeps or math.ceil(frame / STEP))

    # Time

    def step(self, start: float, end: float) -> None:
        """Advance all dynamic bodies from ``start`` to ``end`` [s]."""
        scene, bodies = self.scene, bodies_by_key(self.world)
        batch = scene.batch
        count = max(1, math.ceil((end - start) / self.substep - 1e-6))
        step = (end - start) / count
        if not math.isclose(step, self.substep, rel_tol=1e-9) or scene.shortened:
            batch.expand("opt.timestep")[:] = step
            scene.shortened = True
        self.write(start)
        times = start + step * np.arange(count + 1)
        moving = [
            (own, kinematic_poses(self.world, bodies[key], start, end, times))
            for key, own in scene.placed.items()
            if own.role == "moving"
        ]
        targets = scene.holds.targets(start, end, times)
        bad = [int(getattr(mujoco_package().mjtWarning, name)) for name in BAD]
        before = batch.warning[:, bad].copy()
        with warnings_logged():
            if not moving and not targets:
                batch.step(nstep=count)
            else:
                self._step_driven(count, step, moving, targets)
        self._read()
        diverged = (batch.warning[:, bad] != before).reshape(len(before), -1).any(axis=1)
        for dynamics in attached(self.world) if diverged.any() else ():
            for values in dynamics.values.values():
                values[diverged] = np.nan

    def _step_driven(self, count: int, step: float, moving: Any, targets: Any) -> None:
        """Advance by substeps of ``step`` [s], before each of which is written what leads and what follows a path."""
        from nuno.engines.mujoco.mujoco_grips import send

        batch, holds = self._scene.batch, self._scene.holds
        for k in range(count):
            for own, (place, turn) in moving:
                send(batch, (int(own.qpos[0]), int(own.dof[0])), place[:, k : k + 2], turn[:, k : k + 2], step)
            holds.write(targets, batch, k, step)
            batch.step()

    def write(self, time: float) -> None:
        """Write all states and pushes into the batch."""
        scene, bodies = self.scene, bodies_by_key(self.world)
        batch = scene.batch
        qpos, qvel, warm = (batch.bind(name) for name in ("qpos", "qvel", "qacc_warmstart"))
        warm[:] = 0.0
        applied, wrenches = batch.bind("qfrc_applied"), batch.bind("xfrc_applied")
        applied[:], wrenches[:] = 0.0, 0.0
        for key, own in scene.placed.items():
            body = bodies[key]
            dynamics = dynamics_of(body)
            if own.role == "static":
                k = int(scene.model.body_mocapid[own.id])
                batch.bind("mocap_pos")[:, k], batch.bind("mocap_quat")[:, k] = body.pose()
            elif own.role == "moving":  # where it is now; a step sends it on
                at, to = int(own.qpos[0]), int(own.dof[0])
                qpos[:, at : at + 3], qpos[:, at + 3 : at + 7] = body.pose()
                velocity, spin = self.velocity_at(body, qpos[:, at : at + 3].copy())
                qvel[:, to : to + 3] = velocity
                qvel[:, to + 3 : to + 6] = quat.rotate(quat.inverse(qpos[:, at + 3 : at + 7]), spin)
            if dynamics is None:
                continue
            values = dynamics.values
            pushes = dynamics.pushing(time)
            if own.role == "flex":
                dofs = own.dof[:, None] + np.arange(3)
                qpos[:, own.qpos[:, None] + np.arange(3)] = values["positions"] - own.mesh.rest
                qvel[:, dofs] = values["velocities"]
                if pushes:
                    applied[:, dofs] = np.sum([push.force for push in pushes], axis=0)
            else:
                at, to = int(own.qpos[0]), int(own.dof[0])
                dofs = to + np.arange(6)
                turn, spin = values["turn"], values["spin"]
                qpos[:, at : at + 3], qpos[:, at + 3 : at + 7] = values["place"], turn
                qvel[:, to : to + 3] = values["velocity"] - np.cross(spin, dynamics.middle() - values["place"])
                qvel[:, to + 3 : to + 6] = quat.rotate(quat.inverse(turn), spin)
                if pushes:
                    wrenches[:, own.id] = np.sum([push.force for push in pushes], axis=0)
            if "warmstart" in values:
                warm[:, dofs] = values["warmstart"]

    def _read(self) -> None:
        """Read all states out of the batch."""
        scene, bodies = self._scene, bodies_by_key(self.world)
        qpos, qvel, warm = (scene.batch.bind(name) for name in ("qpos", "qvel", "qacc_warmstart"))
        for key, own in scene.placed.items():
            dynamics = dynamics_of(bodies[key])
            if dynamics is None:
                continue
            values = dynamics.values
            if own.role == "flex":
                dofs = own.dof[:, None] + np.arange(3)
                values["positions"] = qpos[:, own.qpos[:, None] + np.arange(3)] + own.mesh.rest
                values["velocities"] = qvel[:, dofs]
            else:
                at, to = int(own.qpos[0]), int(own.dof[0])
                dofs = to + np.arange(6)
                values["place"], values["turn"] = qpos[:, at : at + 3].copy(), qpos[:, at + 3 : at + 7].copy()
                values["spin"] = quat.rotate(values["turn"], qvel[:, to + 3 : to + 6])
                arm = dynamics.middle() - values["place"]
                values["velocity"] = qvel[:, to : to + 3] + np.cross(values["spin"], arm)
            values["warmstart"] = warm[:, dofs]

    # What it tells

    def wrench(self, grip: Any) -> tuple[np.ndarray, np.ndarray]:
        """Return what a grip or joint bears, in the state that the world is in."""
        from nuno.engines.mujoco.mujoco_forces import wrench_of

        return wrench_of(self, grip)

    def contacts(self, body: Body, itself: bool) -> list[tuple[Any, ...]]:
        """Return a dynamic body's contacts, in the state that the world is in."""
        from nuno.engines.mujoco.mujoco_forces import contacts_of

        return contacts_of(self, body, itself)
