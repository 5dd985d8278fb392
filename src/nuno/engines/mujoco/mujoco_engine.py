"""MuJoCo as a world's engine: its own arrays are the bodies', and the batch of MuJoCo steps them."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import partial
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from nuno.dynamics.dynamics import Dynamics, State
from nuno.engines.array_dynamics import make_arrays, state_at_rest
from nuno.engines.driven_motion import kinematic_poses
from nuno.engines.engine import CAPABILITIES, Engine
from nuno.engines.mujoco.mujoco_leaders import push, send
from nuno.engines.mujoco.mujoco_package import mujoco_package, warnings_logged
from nuno.engines.mujoco.mujoco_touch import touch_classes
from nuno.engines.mujoco.mujoco_tree import is_of_tree
from nuno.engines.world_view import attached, bodies_by_key, dynamics_of
from nuno.materials import Material
from nuno.shapes import quaternion as quat

if TYPE_CHECKING:
    from nuno.bodies.body import Body
    from nuno.engines.world_view import EngineWorld

STEP = 0.0021
"""[s] The longest substep where none are asked for: MuJoCo's default is 2 ms, a frame of 1/60 s has 8 of 2.08 ms."""
BAD = ("mjWARN_BADQPOS", "mjWARN_BADQVEL", "mjWARN_BADQACC")
"""Of numbers that are not finite or beyond 1e10, by which MuJoCo tells that a simulation has diverged."""


class MujocoEngine(Engine):
    """MuJoCo 4: flexes with the ``discrete`` integrator, on the CPU; see docs/engines.md."""

    name = "mujoco"
    capabilities: ClassVar[frozenset[str]] = frozenset(CAPABILITIES) - {"cuda"}

    def __init__(self, world: EngineWorld) -> None:
        super().__init__(world)
        mujoco_package()
        self._scene: Any = None
        self._is_current = False
        self._settings: tuple[Any, ...] = ()
        self._sums: Any = None
        self._later: Callable[[], None] | None = None

    # What it can do

    def allow_contacts(self) -> None:
        """Refuse more classes of bodies that touch different others than MuJoCo's masks have bits."""
        if not self._is_current:
            touch_classes(self.world, self.world.bodies)

    # Dynamics

    def attach(self, body: Body, material: Any) -> Dynamics:
        """Return dynamics for a static body in the shape that it has now, at rest."""
        state = state_at_rest(body, material, self.world.world_count)
        return self.make(body, material, state, material.friction)

    def make(self, body: Body, material: Material, state: State, friction: Any, neutral: bool = False) -> Dynamics:
        """Return dynamics for a body in a state."""
        return make_arrays(body, material, state, friction, self.world)

    def load(self, body: Body, state: State, neutral: bool = False) -> None:
        """Set a dynamic body's state."""
        dynamics_of(body).load_state(state)
        self._sums = self._later = None

    def changed(self) -> None:
        """Let the spec be looked through before the next step."""
        self._is_current = False

    def drives_changed(self, joint: Any) -> None:
        """Write a joint's drives before the next step; the model is compiled anew where they need what it lacks."""
        if self._scene is None or not self._scene.joints.drives_changed(joint):
            self.changed()

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
        if math.isclose(step, self.substep, rel_tol=1e-9):
            step = self.substep  # to the bit what the model was compiled with, also after one that was cut short
        if step != self.substep or scene.shortened:
            scene.set_step(step)
        times = start + step * np.arange(count + 1)
        paths = {
            key: kinematic_poses(self.world, bodies[key], start, end, times)
            for key, own in scene.placed.items()
            if own.role == "moving"
        }
        self.write(start, {key: (place[:, 0], turn[:, 0]) for key, (place, turn) in paths.items()})
        moving = [
            (push if own.carries else send, (int(own.qpos[0]), int(own.dof[0])), paths[key])
            for key, own in scene.placed.items()
            if key in paths
        ]
        go = partial(_go, batch, scene, count, step, moving, scene.holds.targets(start, end, times))
        bad = [int(getattr(mujoco_package().mjtWarning, name)) for name in BAD]
        before = batch.warning[:, bad].copy()
        self._sums, self._later = scene.sums, None
        if self._sums is not None:
            self._sums.begin()
        eager = len(scene.joints) > 0 or bool(self.rules.summed)
        if self._sums is not None and not eager:
            self._later = partial(_go_again, batch, batch.state.copy(), go, self._sums)
        with warnings_logged():
            go(self._sums if eager else None)
        self._read()
        diverged = (batch.warning[:, bad] != before).reshape(len(before), -1).any(axis=1)
        for dynamics in attached(self.world) if diverged.any() else ():
            for values in dynamics.values.values():
                values[diverged] = np.nan

    def _summed(self) -> Any:
        """Return the sums over the last frame, which is gone through once more where they were not expected."""
        if self._later is not None:
            go, self._later = self._later, None
            go()
        return self._sums

    def write(self, time: float, poses: Mapping[str, Any] | None = None) -> None:
        """Write all states and pushes into the batch; within a run bodies on paths are at other ``poses``, by key."""
        scene, bodies = self.scene, bodies_by_key(self.world)
        batch = scene.batch
        qpos, qvel, warm = (batch.bind(name) for name in ("qpos", "qvel", "qacc_warmstart"))
        warm[:] = 0.0
        applied, wrenches = batch.bind("qfrc_applied"), batch.bind("xfrc_applied")
        applied[:], wrenches[:] = 0.0, 0.0
        moved: dict[str, tuple[np.ndarray, ...]] = {}
        before = scene.joints.carriers()
        for key, own in scene.placed.items():
            body = bodies[key]
            dynamics = dynamics_of(body)
            if own.role == "static":
                k = int(scene.model.body_mocapid[own.id])
                batch.bind("mocap_pos")[:, k], batch.bind("mocap_quat")[:, k] = body.pose()
            elif own.role == "moving":  # where it is now; a step sends it on
                at, to = int(own.qpos[0]), int(own.dof[0])
                qpos[:, at : at + 3], qpos[:, at + 3 : at + 7] = (poses or {}).get(key, body.pose())
                place, turn = qpos[:, at : at + 3].copy(), qpos[:, at + 3 : at + 7].copy()
                velocity, spin = self.velocity_at(body, place)
                if own.carries:
                    velocity, spin = np.split(before.get(key, np.concatenate([velocity, spin], -1)), 2, axis=-1)
                    moved[key] = place, turn, velocity, spin
                qvel[:, to : to + 3] = velocity
                qvel[:, to + 3 : to + 6] = quat.rotate(quat.inverse(turn), spin)
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
                dofs = own.dof
                if not own.depth:
                    at, to = int(own.qpos[0]), int(own.dof[0])
                    dofs = to + np.arange(6)
                    turn, spin = values["turn"], values["spin"]
                    qpos[:, at : at + 3], qpos[:, at + 3 : at + 7] = values["place"], turn
                    qvel[:, to : to + 3] = values["velocity"] - np.cross(spin, dynamics.middle() - values["place"])
                    qvel[:, to + 3 : to + 6] = quat.rotate(quat.inverse(turn), spin)
                if pushes:
                    wrenches[:, own.id] = np.sum([push.force for push in pushes], axis=0)
            if np.shape(values.get("warmstart"))[1:] == dofs.shape:  # a joint that is new has other coordinates
                warm[:, dofs] = values["warmstart"]
        scene.joints.write(batch, moved)
        scene.holds.place(batch)
        scene.balls.write()
        scene.bushings.begin()
        scene.holds.begin()

    def _read(self) -> None:
        """Read all states out of the batch."""
        scene, bodies = self._scene, bodies_by_key(self.world)
        qpos, qvel, warm = (scene.batch.bind(name) for name in ("qpos", "qvel", "qacc_warmstart"))
        moved: dict[str, tuple[np.ndarray, ...]] = {}
        for key, own in scene.placed.items():
            dynamics = dynamics_of(bodies[key])
            if own.role == "moving" and own.carries:
                at, to = int(own.qpos[0]), int(own.dof[0])
                turn = qpos[:, at + 3 : at + 7].copy()
                spin = quat.rotate(turn, qvel[:, to + 3 : to + 6])
                moved[key] = qpos[:, at : at + 3].copy(), turn, qvel[:, to : to + 3].copy(), spin
            if dynamics is None:
                continue
            values = dynamics.values
            if own.role == "flex":
                dofs = own.dof[:, None] + np.arange(3)
                values["positions"] = qpos[:, own.qpos[:, None] + np.arange(3)] + own.mesh.rest
                values["velocities"] = qvel[:, dofs]
            elif own.depth:
                dofs = own.dof
            else:
                at, to = int(own.qpos[0]), int(own.dof[0])
                dofs = to + np.arange(6)
                values["place"], values["turn"] = qpos[:, at : at + 3].copy(), qpos[:, at + 3 : at + 7].copy()
                values["spin"] = quat.rotate(values["turn"], qvel[:, to + 3 : to + 6])
                arm = dynamics.middle() - values["place"]
                values["velocity"] = qvel[:, to : to + 3] + np.cross(values["spin"], arm)
            values["warmstart"] = warm[:, dofs]
        scene.joints.read(scene.batch, moved)

    # What it tells

    def wrench(self, grip: Any) -> tuple[np.ndarray, np.ndarray]:
        """Return what a grip or joint bears in the present state, a hinge or slider in the mean over the last frame."""
        if is_of_tree(grip):
            borne = self.joint_loads([grip])[0][:, 0]
            return borne[:, :3], borne[:, 3:]
        from nuno.engines.mujoco.mujoco_forces import wrench_of

        return wrench_of(self, grip)

    def effort(self, joint: Any) -> np.ndarray:
        """Return what a joint's drives did, in the mean over the last frame; a ball's cone, in the present state."""
        if not is_of_tree(joint):
            from nuno.engines.mujoco.mujoco_forces import effort_of

            return effort_of(self, joint)
        return self.joint_loads([joint])[1][:, 0]

    def joint_loads(self, joints: Any) -> tuple[np.ndarray, np.ndarray]:
        """Return what hinges and sliders bore, and what their drives did, in the mean over the last frame."""
        if self._sums is None:
            return np.zeros((self.world.world_count, len(joints), 6)), np.zeros((self.world.world_count, len(joints)))
        borne, along = self._sums.loads(joints)
        return borne, along

    def impulses(self, bodies: Any) -> list[dict[str, np.ndarray]]:
        """Return what contacts gave bodies in the last frame."""
        sums = self._summed()
        if sums is None:
            return [{} for _ in bodies]
        names = {key: body.name for key, body in bodies_by_key(self.world).items()}
        given = [sums.impulses(body.key) for body in bodies]
        return [{names[key]: own for key, own in each.items() if key in names} for each in given]

    def contacts(self, body: Body, itself: bool) -> list[tuple[Any, ...]]:
        """Return a dynamic body's contacts, in the state that the world is in."""
        from nuno.engines.mujoco.mujoco_forces import contacts_of

        return contacts_of(self, body, itself)


def _go(batch: Any, scene: Any, count: int, step: float, moving: Any, targets: Any, sums: Any) -> None:
    """Advance by substeps of ``step`` [s], before each of which is written what leads and what follows a path."""
    changes = moving or targets or scene.bounces or scene.bushings.changes or scene.balls.changes
    if not changes and sums is None:
        batch.step(nstep=count)
        return
    scene.bushings.restart()
    scene.holds.restart()
    for k in range(count):
        for lead, address, (place, turn) in moving:
            lead(batch, address, place[:, k : k + 2], turn[:, k : k + 2], step)
        scene.holds.write(targets, batch, k, step)
        scene.joints.lead(batch)
        scene.bushings.follow(step)
        scene.balls.follow()
        scene.bounces.prepare(step)
        batch.step()
        if sums is not None:
            sums.add(step)
    scene.bounces.settle(step)
    scene.bushings.end(step)
    scene.holds.end(batch)


def _go_again(batch: Any, state: np.ndarray, go: Callable[[Any], None], sums: Any) -> None:
    """Go through a frame from its state once more, which is the same to the bit, and sum up."""
    batch.state[:] = state
    with warnings_logged():
        go(sums)
