"""Hinges and sliders as joints of MuJoCo: their elements in a spec, and the numbers of their drives in a batch.

A drive is what MuJoCo has: stops are a joint's range, springs its stiffness and damping, friction a dry friction of
its coordinate. A motor with gains is an actuator with an affine law and a limit. A motor that keeps a velocity exactly
is a clutch, a dry friction as large as its effort between the joint and a flywheel that turns at that velocity.

MuJoCo cuts off an actuator's force before the substep, not at its end: a strong motor of a light joint would throw it
to and fro. Such a motor is a clutch too, which gives way as its gains do: with the stiffness k, the damping d, substeps
h and the limit F, min(k (x - x_next) - d v_next, F) is a friction of at most F that has the coefficient c = k h + d
against the velocity k (x - x_now) / c. MuJoCo's friction f obeys (v_next - v) / h + b v = -R f, where ``discrete``
takes b at the velocity of the substep's end: f is the motor's for R = b / c and a large b.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.engines.mujoco.mujoco_bushing import Bushing, is_limited
from nuno.engines.mujoco.mujoco_bushings import Bushings
from nuno.engines.mujoco.mujoco_elements import SpecElements
from nuno.engines.mujoco.mujoco_package import mujoco_package
from nuno.engines.mujoco.mujoco_stiff import CLOSING, STIFF
from nuno.engines.mujoco.mujoco_tree import (
    JointStates,
    axis_of,
    depth_of,
    hinges_and_sliders,
    inertias,
    rest_pose,
)
from nuno.engines.world_view import dynamics_of
from nuno.joints.joint import Joint
from nuno.joints.joint_drives import DRIVES
from nuno.shapes import quaternion as quat

if TYPE_CHECKING:
    from nuno.engines.world_view import EngineWorld

FAR = 1e10
"""[rad, m] Where the stops are of what has none."""
STRONGEST = 1e9
"""[N m, N] Of a motor without a limit."""
FLYWHEEL = 1e6
"""[kg]"""
STEEPNESS = 300.0
"""b h of such a friction: what is left of the acceleration's term is one in so many."""
LIGHT = 1.0
"""Of (h^2 k + h d) over the inertia, from where on a motor with a limit is a clutch."""


@dataclass(eq=False)
class Jointed:
    """A hinge or slider as it is in the spec.

    Attributes:
        joint: The joint.
        depth: Of its body in the tree; -1 where a helper stands for it.
        name: Of MuJoCo's joint, site, actuator and sensors.
        helper: The helper, or None: a copy of the body, which takes a share of its mass.
        clutch: Whether it has one.
        weld: Whether the body is welded to the helper.
        bushing: By which else the helper holds it.
    """

    joint: Joint
    depth: int
    name: str
    helper: Any = None
    clutch: bool = False
    weld: bool = False
    bushing: Bushing | None = None


def hang(made: Any, name: str, joint: Joint) -> None:
    """Let a body of a spec, which is the child of the other one, move by a joint alone."""
    place, turn = rest_pose(joint.spec)
    made.pos, made.quat = place[0], turn[0]
    _add_joint(made, name, joint, joint.spec.place[0], axis_of(joint.spec)[0])


def _add_joint(made: Any, name: str, joint: Joint, place: Any, axis: Any) -> None:
    kinds = mujoco_package().mjtJoint
    kind = kinds.mjJNT_HINGE if joint.kind == "hinge" else kinds.mjJNT_SLIDE
    own = made.add_joint(name=name, type=kind, pos=place, axis=axis, limited=1, range=(-FAR, FAR))
    own.solimp_limit = own.solimp_friction = STIFF
    made.add_site(name=name, pos=place)


class Joints(SpecElements):
    """All hinges and sliders of a world.

    Args:
        world: The world.
        bushings: Its bushings.

    Attributes:
        states: Their coordinates from the bodies' states, and back.
        qpos, dof, number: Addresses (n,) of their coordinates and velocities in the model, and their numbers there.
    """

    def __init__(self, world: EngineWorld, bushings: Bushings) -> None:
        super().__init__()
        self._world, self._bushings = world, bushings
        self._joined: list[Jointed] = []
        self.states: Any = None
        self.qpos = self.dof = self.number = np.zeros(0, dtype=int)
        self._step = 0.0
        self._carried: dict[Joint, np.ndarray] = {}
        self._wheel, self._gives = np.zeros(0, dtype=int), np.zeros(0, dtype=bool)
        self._is_driven = False  # whether the numbers of the drives are those that the batch has

    def __len__(self) -> int:
        return len(self._joined)

    @property
    def joints(self) -> list[Joint]:
        """The joints, in their order here."""
        return [own.joint for own in self._joined]

    def carriers(self) -> dict[str, np.ndarray]:
        """Return `JointStates.carriers`, of no joints none."""
        return {} if self.states is None else self.states.carriers()

    # The spec

    def clear(self) -> None:
        """Take what belongs to joints, but for those of bodies themselves, out of the spec."""
        super().clear()
        self._joined = []

    def add(self, spec: Any, placed: dict[str, Any], tree: dict[str, Joint], step: float) -> None:
        """Put all into the spec, as the bodies of the tree are in it, for substeps so long [s]."""
        self._spec, self._step = spec, step
        self._carried = inertias(tree)
        for joint in hinges_and_sliders(self._world):
            if tree.get(joint.body.key) is joint:
                own = Jointed(joint, depth_of(joint.body.key, tree), placed[joint.body.key].bodies[0].name)
            else:
                own = self._add_helper(joint, placed)
            self._joined.append(own)
            self._add_drive(own)

    def _add_helper(self, joint: Joint, placed: dict[str, Any]) -> Jointed:
        self._made += 1
        joined = placed[joint.body.key]
        parent = self._spec.worldbody if joint.target is None else placed[joint.target.key].bodies[0]
        helper = parent.add_body(name=f"j{self._made}")
        hang(helper, helper.name, joint)
        self._elements.append(helper)
        if is_limited(joint.spec):
            joined.thin.append(helper)
            return Jointed(joint, -1, helper.name, helper, bushing=self._add_bushing(joint, joined.bodies[0], helper))
        joined.helpers.append(helper)
        mujoco = mujoco_package()
        weld = self._spec.add_equality(
            name=helper.name, type=mujoco.mjtEq.mjEQ_WELD, objtype=mujoco.mjtObj.mjOBJ_BODY, name1=helper.name,
            name2=joined.bodies[0].name, solimp=STIFF,
        )  # fmt: skip
        self._elements.append(weld)
        return Jointed(joint, -1, helper.name, helper, weld=True)

    def _add_bushing(self, joint: Joint, body: Any, helper: Any) -> Bushing:
        """Let a limited force hold a body at the helper that its joint has."""
        spec, turn = joint.spec, np.tile(quat.IDENTITY, (self._world.world_count, 1))
        dynamics = dynamics_of(joint.body)
        frames = spec.place, turn, spec.place, turn
        return self._bushings.add(
            self._spec, (body, helper), frames, spec, float(dynamics.mass[0]), self._step, dynamics, other_moves=False
        )

    def _add_drive(self, own: Jointed) -> None:
        mujoco, spec, name = mujoco_package(), self._spec, own.name
        motor = spec.add_actuator(
            name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT, gaintype=mujoco.mjtGain.mjGAIN_FIXED,
            biastype=mujoco.mjtBias.mjBIAS_AFFINE, forcelimited=1, forcerange=(-1.0, 1.0),
        )  # fmt: skip
        motor.gainprm[0] = 0.0
        self._elements.append(motor)
        for kind in ("FORCE", "TORQUE"):
            sensor = spec.add_sensor(
                name=f"{name}.{kind}", type=getattr(mujoco.mjtSensor, f"mjSENS_{kind}"),
                objtype=mujoco.mjtObj.mjOBJ_SITE, objname=name,
            )  # fmt: skip
            self._elements.append(sensor)
        if not self._needs_clutch(own.joint):
            return
        own.clutch = True
        wheel = spec.worldbody.add_body(
            name=f"{name}.wheel", mass=FLYWHEEL, inertia=[FLYWHEEL] * 3, explicitinertial=True, gravcomp=1.0
        )
        wheel.add_joint(name=wheel.name, type=mujoco.mjtJoint.mjJNT_SLIDE, axis=(1.0, 0.0, 0.0))
        clutch = spec.add_tendon(name=name, frictionloss=1.0, solimp_friction=STIFF)
        clutch.wrap_joint(name, 1.0)
        clutch.wrap_joint(wheel.name, -1.0)
        self._elements += [wheel, clutch]

    # The model

    def find(self, model: Any, batch: Any, step: float) -> None:
        """Note where all is in a compiled model, and write what does not change with time."""
        joined = self._joined
        self.number = np.array([model.joint(own.name).id for own in joined], dtype=int)
        self.qpos, self.dof = model.jnt_qposadr[self.number], model.jnt_dofadr[self.number]
        self._is_driven, self.states = False, None
        self._wheel, self._gives = np.zeros(0, dtype=int), np.zeros(0, dtype=bool)
        if not joined:
            return
        self._motor = np.array([model.actuator(own.name).id for own in joined], dtype=int)
        self._site = np.array([model.site(own.name).id for own in joined], dtype=int)
        first = np.array([int(model.sensor(f"{own.name}.FORCE").adr[0]) for own in joined])
        self._sensor = first[:, None] + np.arange(6)
        assert all(model.sensor(f"{own.name}.TORQUE").adr[0] == at + 3 for own, at in zip(joined, first, strict=True))
        clutched = [own for own in joined if own.clutch]
        self._clutched = np.flatnonzero([own.clutch for own in joined])
        self._clutch = np.array([model.tendon(own.name).id for own in clutched], dtype=int)
        wheels = [model.joint(f"{own.name}.wheel") for own in clutched]
        self._wheel = np.array([int(wheel.dofadr[0]) for wheel in wheels], dtype=int)
        self._wheel_at = np.array([int(wheel.qposadr[0]) for wheel in wheels], dtype=int)
        closing = (CLOSING * step, 1.0)
        batch.expand("jnt_solref")[:, self.number] = closing
        batch.expand("dof_solref")[:, self.dof] = closing
        for own in joined:
            self._set_frames(own, model, batch)
        self.states = JointStates(self._world, self.joints, [own.depth for own in joined])

    def _set_frames(self, own: Jointed, model: Any, batch: Any) -> None:
        """Write a joint's frames where they differ between worlds."""
        spec, body, joint = own.joint.spec, model.body(own.name).id, model.joint(own.name).id
        place, turn = rest_pose(spec)
        if any(np.ptp(part, axis=0).any() for part in (place, turn, spec.place, spec.turn)):
            batch.expand("body_pos")[:, body], batch.expand("body_quat")[:, body] = place, turn
            batch.expand("jnt_pos")[:, joint], batch.expand("jnt_axis")[:, joint] = spec.place, axis_of(spec)
            batch.expand("site_pos")[:, model.site(own.name).id] = spec.place

    def weld(self, model: Any, batch: Any, step: float) -> None:
        """Write of each helper that it is where the body is, after MuJoCo's constants are set, which would undo it."""
        for own in self._joined:
            if not own.weld:
                continue
            row, place = model.equality(own.name).id, own.joint.spec.place
            batch.expand("eq_solref")[:, row] = CLOSING * step, 1.0
            data = batch.expand("eq_data")
            data[:, row, 0:3], data[:, row, 3:6] = place, place
            data[:, row, 6:10], data[:, row, 10] = quat.IDENTITY, 1.0

    def drives_changed(self, joint: Joint) -> bool:
        """Be told that a joint's drives are others now; return whether the spec has what they need."""
        self._is_driven = False
        own = next((own for own in self._joined if own.joint is joint), None)
        return own is not None and (own.clutch or not self._needs_clutch(joint))

    def _needs_clutch(self, joint: Joint) -> bool:
        """Return True if, in any world, a motor keeps a velocity exactly, or is strong for what its joint carries."""
        drives = dict(zip(DRIVES, np.moveaxis(joint.spec.drives, -1, 0), strict=True))
        keeps, step = np.isinf(drives["damping"]), self._step
        if (keeps & (drives["max_effort"] > 0.0)).any():
            return True
        stiff = step * (step * drives["stiffness"] + np.where(keeps, 0.0, drives["damping"]))
        carried = self._carried.get(joint, np.inf)  # one in a loop is stiff by the others
        return bool((np.isfinite(drives["max_effort"]) & (stiff > LIGHT * carried)).any())

    def set_step(self, step: float) -> None:
        """Let the substeps to come be so long [s]."""
        self._step, self._is_driven = step, False

    def write(self, batch: Any, moved: dict[str, tuple[np.ndarray, ...]]) -> None:
        """Write the joints' coordinates, as the bodies are, and their drives where these have changed."""
        if not self._joined:
            return
        positions, velocities = self.states.coordinates(moved)
        batch.bind("qpos")[:, self.qpos], batch.bind("qvel")[:, self.dof] = positions, velocities
        if not self._is_driven:
            self._write_drives(batch)
            self._is_driven = True
        if len(self._wheel):
            batch.bind("qpos")[:, self._wheel_at] = 0.0
            batch.bind("qvel")[:, self._wheel] = self._speeds

    def lead(self, batch: Any) -> None:
        """Turn the flywheels of motors with gains as the next substep needs it."""
        if not self._gives.any():
            return
        stiffness, pull, coefficient = self._gains
        speeds = (pull - stiffness * batch.bind("qpos")[:, self.qpos[self._clutched]]) / coefficient
        batch.bind("qvel")[:, self._wheel] = np.where(self._gives, speeds, self._speeds)

    def _write_drives(self, batch: Any) -> None:
        table = np.stack([own.joint.spec.drives for own in self._joined], axis=1)
        own = dict(zip(DRIVES, np.moveaxis(table, -1, 0), strict=True))
        batch.expand("jnt_range")[:, self.number] = np.clip(np.stack([own["lower"], own["upper"]], -1), -FAR, FAR)
        batch.expand("dof_frictionloss")[:, self.dof] = own["friction"]
        batch.expand("jnt_stiffness")[:, self.number] = own["spring"]
        batch.expand("qpos_spring")[:, self.qpos] = own["rest"]
        batch.expand("dof_damping")[:, self.dof] = own["spring_damping"]
        keeps = np.isinf(own["damping"])
        damping = np.where(keeps, 0.0, own["damping"])
        most = np.minimum(own["max_effort"], STRONGEST)
        by_clutch = np.zeros(keeps.shape, dtype=bool)
        by_clutch[:, self._clutched] = True
        law = batch.expand("actuator_biasprm")
        law[:, self._motor, 0] = np.where(
            by_clutch, 0.0, own["stiffness"] * own["position"] + damping * own["velocity"]
        )
        law[:, self._motor, 1] = np.where(by_clutch, 0.0, -own["stiffness"])
        law[:, self._motor, 2] = np.where(by_clutch, 0.0, -damping)
        batch.expand("actuator_forcerange")[:, self._motor] = np.stack([-most, most], -1)
        if len(self._wheel):
            clutched = {name: values[:, self._clutched] for name, values in own.items()}
            self._write_clutches(batch, clutched, damping[:, self._clutched], most[:, self._clutched])

    def _write_clutches(self, batch: Any, own: dict[str, np.ndarray], damping: np.ndarray, most: np.ndarray) -> None:
        keeps, step = np.isinf(own["damping"]), self._step
        coefficient = own["stiffness"] * step + damping
        self._speeds, self._gives = own["velocity"], ~keeps & (coefficient > 0.0)
        pull = own["stiffness"] * own["position"] + damping * own["velocity"]
        self._gains = own["stiffness"], pull, np.where(self._gives, coefficient, 1.0)
        inverse = np.stack([batch.get_model(k).tendon_invweight0[self._clutch] for k in range(len(keeps))])
        share = step * coefficient * inverse / STEEPNESS
        impedance = np.clip(share / (1.0 + share), 1e-4, STIFF[0])  # R is (1 - d) / d of the inverse inertia
        batch.expand("tendon_frictionloss")[:, self._clutch] = np.where(keeps | self._gives, most, 0.0)
        solimp = batch.expand("tendon_solimp_fri")
        solimp[:, self._clutch] = STIFF
        solimp[:, self._clutch, :2] = np.where(self._gives, impedance, STIFF[0])[..., None]
        gives = np.stack([np.full_like(impedance, -1e-9), -STEEPNESS * impedance / step], axis=-1)
        solref = np.where(self._gives[..., None], gives, (CLOSING * step, 1.0))
        batch.expand("tendon_solref_fri")[:, self._clutch] = solref

    def read(self, batch: Any, moved: dict[str, tuple[np.ndarray, ...]]) -> None:
        """Set the states of the bodies that hang in the tree; ``moved`` is as `JointStates.set_bodies` takes it."""
        if self._joined:
            self.states.set_bodies(batch.bind("qpos")[:, self.qpos], batch.bind("qvel")[:, self.dof], moved)

    def loads(self, batch: Any, step: float) -> tuple[np.ndarray, np.ndarray]:
        """Return what the joints bore and did in the last substep, of ``step`` [s].

        Force [N] and torque [N m] of each body on the other, (worlds, n, 6), along the world's axes and about the
        joint; and the part of it along the free direction that drives do to the body [N m; N], (worlds, n).
        """
        given = batch.bind("sensordata")[:, self._sensor].reshape(self._world.world_count, -1, 2, 3)
        frames = batch.bind("site_xmat")[:, self._site].reshape(*given.shape[:2], 3, 3)
        on_body = np.einsum("wnxy,wnky->wnkx", frames, given)
        self._bushings.note(step)
        for n, own in enumerate(self._joined):
            if own.bushing is not None:  # which MuJoCo's sensors do not see
                on_body[:, n] += own.bushing.last.reshape(-1, 2, 6)[..., :3]
        axis = batch.bind("xaxis")[:, self.number]
        which = np.where(self.states.slides, 0, 1)
        along = np.einsum("wnx,wnx->wn", on_body[:, np.arange(len(which)), which], axis)
        return -on_body.reshape(*given.shape[:2], 6), along
