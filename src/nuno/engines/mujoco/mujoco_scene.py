"""The scene of a MuJoCo engine: a spec that follows the world's bodies, the compiled model, and its batch.

Only what has changed is edited in the spec. The states are the bodies' own arrays, so that nothing is lost as the model
is compiled anew.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.engines.array_dynamics import ArrayParticles, ArrayRigid
from nuno.engines.mujoco.mujoco_balls import Balls, is_driven_spherical
from nuno.engines.mujoco.mujoco_bounces import Bounces
from nuno.engines.mujoco.mujoco_bushings import Bushings
from nuno.engines.mujoco.mujoco_flex import FlexMesh, add_flex, write_flex
from nuno.engines.mujoco.mujoco_geoms import add_parts
from nuno.engines.mujoco.mujoco_grips import Holds
from nuno.engines.mujoco.mujoco_joints import Joints, hang
from nuno.engines.mujoco.mujoco_kinematics import Kinematics
from nuno.engines.mujoco.mujoco_leaders import LEADER
from nuno.engines.mujoco.mujoco_package import mujoco_package, warnings_logged
from nuno.engines.mujoco.mujoco_placed import Placed
from nuno.engines.mujoco.mujoco_sums import Sums
from nuno.engines.mujoco.mujoco_touch import (
    CONTACT,
    IMPEDANCE,
    TouchingPair,
    set_masks,
    set_pairs,
    write_friction,
    write_pairs,
)
from nuno.engines.mujoco.mujoco_tree import depth_of, frames_of, is_of_tree, plan_tree
from nuno.engines.world_view import attached, bodies_by_key, dynamics_of, rules_of
from nuno.tables.kinematic_motion import is_kinematic

if TYPE_CHECKING:
    from nuno.bodies.body import Body
    from nuno.engines.world_view import EngineWorld
    from nuno.joints.joint import Joint

THIN = 0.02
"""Share of its body's mass that the helper of a joint has that is loose or a ball."""
LEADING = 0.5 * LEADER
"""[kg] and [kg m2] What has more is a body that leads, or a flywheel."""


class MujocoScene:
    """The spec, the model and the batch.

    Attributes:
        placed: What each body is, by its key.
        model: The compiled model.
        batch: The batch of as many simulations as there are worlds.
        holds: The grips, and what is held as grips are, as equality constraints.
        joints: The hinges and sliders.
        bushings, balls: The bushings, and the ball joints with drives.
        bounces: The pairs that bounce.
        sums: What joints bear and contacts give over a frame; None of cloth and soft bodies that were not asked about.
        compilations: How often the model was compiled.
        shortened: Whether a substep was of another length than the model's.

    Args:
        world: The world.
    """

    def __init__(self, world: EngineWorld) -> None:
        self._world = world
        self._mujoco = mujoco_package()
        self._made = 0
        self.placed: dict[str, Placed]
        self.holds: Holds
        self.joints: Joints
        self.bushings: Bushings
        self.balls: Balls
        self.bounces: Bounces
        self.model: Any = None
        self.batch: Any = None
        self.sums: Sums | None = None
        self.compilations = 0
        self.shortened = False  # whether the substep has been another than the model's
        self._settings: tuple[Any, ...] = ()
        self._pairs: list[TouchingPair] = []
        self._begin()

    def _begin(self) -> None:
        mujoco, spec = self._mujoco, self._mujoco.MjSpec()
        spec.option.solver = mujoco.mjtSolver.mjSOL_NEWTON
        spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
        spec.option.impratio = 10.0
        spec.option.gravity = self._world.gravity
        # bodies that a joint joins touch each other where the world says so, not where MuJoCo would
        spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_FILTERPARENT
        self.spec, self.placed = spec, {}
        self.bushings, self.balls = Bushings(), Balls()
        self.holds, self.joints = Holds(self._world, self.bushings, self.balls), Joints(self._world, self.bushings)
        self._settings = (self._world.gravity, self._world.world_count)

    def bring(self, substep: float) -> None:
        """Edit the spec to what the world is now, and compile it, for substeps so long [s]."""
        world = self._world
        tree = plan_tree(world)
        found = [(depth_of(body.key, tree), body.key, body) for body in world.bodies]
        found.sort(key=lambda each: each[0])  # a body comes after what it hangs on
        wanted: dict[str, Any] = {}
        for _, key, body in found:
            role, signature = _role_and_signature(world, body)
            if key in tree:
                target = tree[key].target
                above = None if target is None else (target.key, wanted[target.key][2])
                signature = (*signature, tree[key].kind, *frames_of(tree[key]), above)
            wanted[key] = body, role, signature
        dropped = [key for key, own in self.placed.items() if key not in wanted or own.signature != wanted[key][2]]
        # to delete a flex's bodies one by one takes longer than to begin anew: 9 s of a cloth of 30 x 30 cells
        if self._settings != (world.gravity, world.world_count) or any(self.placed[k].role == "flex" for k in dropped):
            self._begin()
        else:
            for part in (self.bushings, self.holds, self.balls, self.joints):  # what refers to others goes first
                part.clear()
            for key in sorted(dropped, key=lambda key: -self.placed[key].depth):  # a body's children go with it
                self._delete(key)
        for depth, key, body in found:
            if key not in self.placed:
                _, role, signature = wanted[key]
                self.placed[key] = self._place(body, role, signature, tree.get(key))
                self.placed[key].depth = depth
        carriers = {joint.target.key for joint in _helped(world) if joint.target is not None}
        for key, own in self.placed.items():
            own.carries, own.helpers, own.thin = key in carriers, [], []
        bodies = [(body, self.placed[key]) for key, body in bodies_by_key(world).items()]
        set_masks(world, bodies)
        self._pairs = set_pairs(self.spec, world, bodies)
        self.holds.add(self.spec, self.placed, substep)
        self.joints.add(self.spec, self.placed, tree, substep)
        for body, own in bodies:
            if own.role == "rigid":
                _share_mass(dynamics_of(body), _shares(own))
        self.spec.option.timestep, self.shortened = substep, False
        self.spec.option.integrator = self._mujoco.mjtIntegrator.mjINT_DISCRETE
        self.spec.option.disableflags |= self._mujoco.mjtDisableBit.mjDSBL_AUTORESET
        with warnings_logged():
            self.model = self.spec.compile()
        _set_tolerance(self.model)
        # the forces of contacts are read from the data after each substep
        kept = bool(world.engine.rules.summed) or any(own.role == "rigid" for own in self.placed.values())
        self.batch = self._mujoco.batch.Batch(self.model, world.world_count, 1, kept)
        self.compilations += 1
        for own in self.placed.values():
            self._find(own)
        self.joints.find(self.model, self.batch, substep)
        self._set_numbers(bodies)
        write_friction(self.model, self.batch, bodies)
        write_pairs(self.model, self.batch, self._pairs)
        movable = {own.id for own in self.placed.values() if own.role == "rigid"}
        kinematics = Kinematics(self.batch)
        bouncing = [(pair.name, pair.restitution) for pair in self._pairs]
        self.bounces = Bounces(self.model, self.batch, bouncing, movable, kinematics, (CONTACT, IMPEDANCE))
        self.joints.weld(self.model, self.batch, substep)
        self.holds.find(self.model, self.batch, self.placed, substep)
        self.bushings.find(self.model, self.batch, kinematics)
        self.balls.find(self.model, self.batch, kinematics, substep)
        self.sums = Sums(self.model, self.batch, self.joints, self.placed, world.world_count) if kept else None

    def set_step(self, step: float) -> None:
        """Let the substeps to come be so long [s]; `bring` sets them to the engine's."""
        self.batch.expand("opt.timestep")[:] = step
        self.joints.set_step(step)
        self.shortened = True

    def _delete(self, key: str) -> None:
        own = self.placed.pop(key)
        for element in [*own.flexes, *own.bodies, *own.assets]:
            self.spec.delete(element)

    def _place(self, body: Body, role: str, signature: tuple[Any, ...], joint: Joint | None) -> Placed:
        self._made += 1
        name, dynamics = f"b{self._made}", dynamics_of(body)
        spec = self.spec
        if isinstance(dynamics, ArrayParticles):
            mesh = FlexMesh(dynamics)
            flex, bodies = add_flex(spec, name, mesh, dynamics)
            flex.selfcollide = 4 if _touches_itself(self._world, body) else 0
            own = Placed(role, signature, bodies, flexes=[flex], mesh=mesh)
        else:
            from nuno.dynamics.body_parts import parts_of

            other = None if joint is None else joint.target
            parent = spec.worldbody if other is None else self.placed[other.key].bodies[0]
            made = parent.add_body(name=name)
            if isinstance(dynamics, ArrayRigid):
                if joint is None:
                    made.add_freejoint(name=name)
                else:
                    hang(made, name, joint)
                parts = dynamics.parts
            else:
                parts = parts_of(body, moves=False)
                if role == "moving":
                    made.mass, made.inertia, made.explicitinertial, made.gravcomp = LEADER, [LEADER] * 3, True, 1.0
                    made.add_freejoint(name=name)
                else:
                    made.mocap = True
            geoms, assets, flexes = add_parts(spec, made, name, parts)
            own = Placed(role, signature, [made], geoms, assets, flexes)
        for shape in (*own.geoms, *own.flexes):
            shape.solref, shape.solimp, shape.condim = CONTACT, IMPEDANCE, 3
        return own

    def _find(self, own: Placed) -> None:
        """Note where a body's coordinates are in the compiled model."""
        model = self.model
        own.id = int(model.body(own.bodies[0].name).id)
        if own.role == "static":
            return
        ids = own.id + np.arange(len(own.bodies))
        assert model.body(own.bodies[-1].name).id == ids[-1]
        own.dof = model.body_dofadr[ids]
        own.qpos = model.jnt_qposadr[model.body_jntadr[ids]]

    def _set_numbers(self, bodies: list[tuple[Body, Placed]]) -> None:
        """Write what a spec has no place for, or what differs between worlds."""
        model, batch = self.model, self.batch
        worlds = self._world.world_count
        moving: list[tuple[Any, Placed]] = [(dynamics_of(b), own) for b, own in bodies if dynamics_of(b) is not None]
        for dynamics, own in moving:
            if own.role == "flex":
                ids = own.id + np.arange(len(own.bodies))
                batch.expand("body_mass")[:, ids] = dynamics.mass
                continue
            share = np.trace(dynamics.inertia, axis1=1, axis2=2)
            for made, part in _shares(own):
                each = int(model.body(made.name).id)
                batch.expand("body_mass")[:, each] = dynamics.mass * part
                batch.expand("body_inertia")[:, each] = model.body_inertia[each] * (share / share[0])[:, None]
        if moving:
            batch.set_const()  # of all worlds, so that one is the same in any batch
        for dynamics, own in moving:
            drag = dynamics.material.resolved(worlds, self._elements(dynamics))["air_drag"][:, 0]
            if drag.any():
                self._set_drag(own, dynamics, drag.astype(np.float64))
            if own.mesh is not None:
                write_flex(model, batch, flex_id(model, own.flexes[0].name), own.mesh, dynamics)

    @staticmethod
    def _elements(dynamics: Any) -> int:
        from nuno.bodies.shape_topology import element_count

        return 1 if dynamics.is_rigid else element_count(dynamics.shape)

    def _set_drag(self, own: Placed, dynamics: Any, drag: np.ndarray) -> None:
        """Let still air take the velocity away at a rate (worlds,) [1/s]."""
        damping = self.batch.expand("dof_damping")
        if own.role == "flex":
            for axis in range(3):
                damping[:, own.dof + axis] = drag[:, None] * dynamics.mass
            return
        spin = np.trace(dynamics.inertia, axis1=1, axis2=2) / 3.0
        for axis in range(3):
            damping[:, own.dof[0] + axis] = drag * dynamics.mass
            damping[:, own.dof[0] + 3 + axis] = drag * spin


def _set_tolerance(model: Any) -> None:
    """Let the solver go on until what is left is small beside the bodies, not beside those that lead.

    MuJoCo measures it by the mean inertia of all coordinates, and leaders and flywheels have a million times that.
    """
    light = model.dof_M0[model.dof_M0 < LEADING]
    if 0 < len(light) < model.nv:
        model.opt.tolerance *= max(float(light.mean()) / float(model.dof_M0.mean()), 1e-7)


def _shares(own: Placed) -> list[tuple[Any, float]]:
    """Return a rigid body and its helpers, with their shares of its mass."""
    heavy, left = [*own.bodies, *own.helpers], 1.0 - THIN * len(own.thin)
    return [*((made, left / len(heavy)) for made in heavy), *((made, THIN) for made in own.thin)]


def _share_mass(dynamics: Any, shares: list[tuple[Any, float]]) -> None:
    """Give a rigid body and its helpers their shares of its mass and inertia."""
    for made, part in shares:
        inertia = dynamics.inertia[0] * part
        made.mass, made.ipos, made.explicitinertial = float(dynamics.mass[0]) * part, dynamics.centre, True
        made.fullinertia = [
            inertia[0, 0], inertia[1, 1], inertia[2, 2], inertia[0, 1], inertia[0, 2], inertia[1, 2]
        ]  # fmt: skip


def _helped(world: EngineWorld) -> list[Joint]:
    """Return the joints whose body, or a helper of it, hangs on the other body."""
    grips = [grip for dynamics in attached(world) for grip in dynamics.grips]
    return [grip for grip in grips if is_of_tree(grip) or is_driven_spherical(grip.spec)]


def flex_id(model: Any, name: str) -> int:
    """Return the number of a flex in a model."""
    mujoco = mujoco_package()
    return int(mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_FLEX, name))


def _role_and_signature(world: EngineWorld, body: Body) -> tuple[str, tuple[Any, ...]]:
    role = _role(body)
    return role, _signature(world, body, role)


def _role(body: Body) -> str:
    if dynamics_of(body) is not None:
        return "rigid" if dynamics_of(body).is_rigid else "flex"
    return "moving" if is_kinematic(body) else "static"


def _signature(world: EngineWorld, body: Body, role: str) -> tuple[Any, ...]:
    if dynamics_of(body) is not None:
        # another material makes other dynamics
        return role, id(dynamics_of(body)), rules_of(world).touches_itself(body)
    return role, id(body.shape), body.local_vertices().tobytes() if body.is_deformed else None, body.thickness


def _touches_itself(world: EngineWorld, body: Body) -> bool:
    """Return True if the parts of a cloth touch each other, or those of a soft body whose material asks for it."""
    return rules_of(world).touches_itself(body) and getattr(dynamics_of(body).material, "self_contact", True)
