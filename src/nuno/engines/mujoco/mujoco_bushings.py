"""All bushings of a world in MuJoCo: their elements in a spec, and their laws before each substep."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from nuno.engines.mujoco.mujoco_bushing import (
    KEPT_NUMBERS,
    Bushing,
    Linear,
    basis_of,
    inverse_mass,
    is_limited,
    limited,
)
from nuno.engines.mujoco.mujoco_elements import SpecElements
from nuno.engines.mujoco.mujoco_kinematics import Kinematics
from nuno.engines.mujoco.mujoco_package import mujoco_package
from nuno.shapes import quaternion as quat

STIFFEST, STIFFEST_ROTATION = 1e6, 1e5
"""[N/m], [N m/rad] At least, of what does not give way below its limit."""
STIFFNESS = 20.0
"""Times the held mass over the square of a substep, of the same: a body's weight moves it by g h^2 / 20 = 2 um."""
STRONGEST = 1e9
"""[N], [N m] Of what has no limit."""
CATCH_UP = 1.0
"""[m/s], [rad/s] What does not give way comes back no faster from where its limit let it be taken, as in Nuno's own."""
KEPT = "bushings"
"""Of a body's state, `Bushing.last` of all (worlds, n, 12)."""


class Bushings(SpecElements):
    """All bushings of a world."""

    def __init__(self) -> None:
        super().__init__()
        self._all: list[Bushing] = []
        self._batch: Any = None
        self._kinematics: Any = None

    @property
    def changes(self) -> bool:
        """Return True if any is followed from substep to substep."""
        return any(own.changes for own in self._all)

    # The spec

    def clear(self) -> None:
        """Take all bushings out of the spec."""
        super().clear()
        self._all = []

    def add(
        self, spec: Any, bodies: tuple[Any, Any], frames: Sequence[np.ndarray], of: Any, mass: float, step: float,
        dynamics: Any, other_moves: bool, turns: bool = True,
    ) -> Bushing:  # fmt: skip
        """Add a bushing to a spec.

        Args:
            spec: The spec.
            bodies: The body and the other one in it.
            frames: See `Bushing`.
            of: The numbers of the grip, weld or joint: its compliance, limit and free direction.
            mass: Of the body [kg].
            step: [s], of a substep.
            dynamics: Of the body.
            other_moves: Whether the other one is moved by what holds the body.
            turns: Whether it holds turns besides.
        """
        mujoco = mujoco_package()
        self._made, self._spec = self._made + 1, spec
        gives = of.compliance > 0.0
        stiff = (max(STIFFEST, STIFFNESS * mass / step**2), STIFFEST_ROTATION)
        stiffness = np.full(2, 1.0 / of.compliance) if gives else np.array(stiff)
        own = Bushing(
            f"s{self._made}", (bodies[0].name, bodies[1].name), tuple(frames), turns, stiffness,  # type: ignore[arg-type]
            np.zeros(2) if gives else step * stiffness, np.asarray(of.max_force) if is_limited(of) else None,
            getattr(of, "free", None), gives, np.ones(len(frames[0]), dtype=bool),
            dynamics, other_moves,
        )  # fmt: skip
        for body, end in zip((bodies[0], bodies[1], bodies[1]), ("", ".to", ".turn"), strict=True):
            # one that is the body's frame as it is compiled would stay that
            self._elements.append(
                body.add_site(name=f"{own.name}{end}", pos=(1.0, 2.0, 3.0), quat=(1.0, 2.0, 3.0, 4.0))
            )
        for k in range(6 if turns else 3):
            actuator = spec.add_actuator(
                name=f"{own.name}.{k}", target=own.name, refsite=f"{own.name}.{'to' if k < 3 else 'turn'}",
                trntype=mujoco.mjtTrn.mjTRN_SITE, gaintype=mujoco.mjtGain.mjGAIN_FIXED,
                biastype=mujoco.mjtBias.mjBIAS_AFFINE, forcelimited=1, forcerange=(-1.0, 1.0), gear=np.eye(6)[k],
            )  # fmt: skip
            actuator.gainprm[0] = 0.0
            self._elements.append(actuator)
        self._all.append(own)
        return own

    # The model

    def find(self, model: Any, batch: Any, kinematics: Kinematics) -> None:
        """Note where all is in a compiled model, and write what does not change with time."""
        self._batch, self._kinematics = batch, kinematics
        for own in self._all:
            own.site, own.other_site, own.turn_site = (
                int(model.site(f"{own.name}{end}").id) for end in ("", ".to", ".turn")
            )
            own.number = np.array([model.actuator(f"{own.name}.{k}").id for k in range(6 if own.turns else 3)])
            place, turn, other_place, other_turn = own.frames
            places, quaternions = batch.expand("site_pos"), batch.expand("site_quat")
            places[:, own.site], quaternions[:, own.site] = place, turn
            for site in (own.other_site, own.turn_site):
                places[:, site], quaternions[:, site] = other_place, other_turn
            law, limits = batch.expand("actuator_biasprm"), batch.expand("actuator_forcerange")
            law[:, own.number] = 0.0
            which = np.repeat([0, 1], 3)[: len(own.number)]
            law[:, own.number, 1], law[:, own.number, 2] = -own.stiffness[which], -own.damping[which]
            if own.free is not None:
                law[:, own.number[0], 1:3] = 0.0
            most = np.where(own.worlds, STRONGEST, 0.0)[:, None]
            limits[:, own.number] = np.stack([-most, most], axis=-1)

    def begin(self) -> None:
        """Take over, before a frame, what the last substep was, as the bodies' states have it."""
        for own, values, k, count in self._kept():
            kept, shape = values.get(KEPT), (len(own.worlds), count, KEPT_NUMBERS)
            own.last = kept[:, k].copy() if kept is not None and kept.shape == shape else np.zeros((shape[0], shape[2]))
            own.first = own.last.copy()

    def restart(self) -> None:
        """Go back to the start of the frame."""
        for own in self._all:
            own.last, own.linear = own.first.copy(), {}

    def end(self, step: float) -> None:
        """Note, after a frame, what its last substep was, in the bodies' states."""
        if self.changes:
            self.note(step)
        for own, values, k, count in self._kept():
            if k == 0:
                values[KEPT] = np.zeros((len(own.worlds), count, KEPT_NUMBERS))
            values[KEPT][:, k] = own.last

    def _kept(self) -> Iterator[tuple[Bushing, dict[str, np.ndarray], int, int]]:
        """Yield each bushing that changes, its body's state, its place among those of the body, and their number."""
        changing = [own for own in self._all if own.changes]
        for own in changing:
            theirs = [other for other in changing if other.dynamics is own.dynamics]
            yield own, own.dynamics.values, theirs.index(own), len(theirs)

    def follow(self, step: float) -> None:
        """Write, before a substep, along which directions bodies slide, and what bears its limit in it."""
        if not self.changes:
            return
        self.note(step)
        for world, model, data in self._kinematics.of_worlds():
            for own in self._all:
                if own.changes and own.worlds[world]:
                    self._follow(own, world, model, data, step)

    def note(self, step: float) -> None:
        """Note what the last substep did, of ``step`` [s]."""
        qvel = self._batch.bind("qvel")
        for own in self._all:
            for world, parts in own.linear.items():
                for kind, part in enumerate(parts):
                    force = part.given
                    if force is None:
                        stiffness, damping = part.held * own.stiffness[kind], part.held * own.damping[kind]
                        rate = part.jacobian @ qvel[world]
                        force = -stiffness * (part.drawn + step * rate) - damping * rate
                    own.last[world, 6 * kind : 6 * kind + 6] = (np.stack([force, part.slips]) @ part.axes.T).ravel()
            own.linear = {}

    def _follow(self, own: Bushing, world: int, model: Any, data: Any, step: float) -> None:
        mujoco = mujoco_package()
        body, to = (int(k) for k in model.site_bodyid[[own.site, own.other_site]])
        point, other, turned = data.site_xpos[own.site], data.xpos[to], data.xquat[to]
        at, frame = other + quat.rotate(turned, own.frames[2][world]), quat.multiply(turned, own.frames[3][world])
        axes, held = quat.to_matrix(frame), np.ones(3)
        if own.free is not None:
            axes, held = basis_of(own.free), np.array((0.0, 1.0, 1.0))
            along = np.zeros(4)
            mujoco.mju_mat2Quat(along, axes.ravel())
            self._batch.expand("site_quat")[world, own.other_site] = quat.multiply(quat.inverse(turned), along)
        moves, turns = (np.zeros((2, 3, model.nv)) for _ in range(2))
        for k, (number, place) in enumerate(((body, point), (to, at))):
            mujoco.mj_jac(model, data, moves[k], turns[k], place, number)
        parts = [(axes, held, moves, axes.T @ (point - at))]
        if own.turns:
            off, now = np.zeros(3), quat.multiply(data.xquat[body], own.frames[1][world])
            mujoco.mju_quat2Vel(off, quat.multiply(quat.inverse(frame), now), 1.0)
            parts.append((quat.to_matrix(frame), np.ones(3), turns, off))
        own.linear[world] = []
        for kind, (basis, holds, jacobians, apart) in enumerate(parts):
            drawn = apart
            if not own.gives:  # with this damping it comes back with half of what it is apart, a substep
                length = float(np.linalg.norm(holds * apart))
                drawn = apart * min(1.0, 2.0 * CATCH_UP * step / max(length, 1e-12))
            jacobian = basis.T @ (jacobians[0] - jacobians[1])
            part = Linear(jacobian, basis, holds, jacobian @ data.qvel, drawn)
            inverse = basis.T @ inverse_mass(own, kind, (body, to), model, data, (point, at)) @ basis
            self._bear(own, world, kind, part, apart, inverse, step)
            own.linear[world].append(part)

    def _bear(
        self, own: Bushing, world: int, kind: int, part: Linear, apart: np.ndarray, inverse: np.ndarray, step: float
    ) -> None:  # fmt: skip
        """Write the law of three actuators: a spring, or what the limit leaves of it, which is noted."""
        number, law = own.number[3 * kind : 3 * kind + 3], self._batch.expand("actuator_biasprm")
        stiffness, damping = part.held * own.stiffness[kind], part.held * own.damping[kind]
        law[world, number, 0] = stiffness * (apart - part.drawn)
        law[world, number, 1], law[world, number, 2] = -stiffness, -damping
        if own.limit is None:
            return
        last = own.last[world, 6 * kind : 6 * kind + 6].reshape(2, 3) @ part.axes
        # what else acts on it, by how its velocity has changed; nothing is known of it in the first substep
        load = -last[0]
        if last.any():
            load = load + np.linalg.solve(inverse, part.slips - last[1]) / step
        part.given = limited(
            part.drawn, part.slips, load, inverse, stiffness, step * stiffness + damping, float(own.limit[world]), step
        )
        if part.given is not None:
            law[world, number, 0], law[world, number, 1:3] = part.given, 0.0

    def borne(self, own: Bushing, world: int, data: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the force [N] and torque [N m] of a bushing on its body, and where [m], of data with forces.

        Of one that changes they are those of the last substep.
        """
        place = data.site_xpos[own.site].copy()
        if own.changes:
            return own.last[world, :3], own.last[world, 6:9], place
        given = data.actuator_force[own.number]
        force = data.site_xmat[own.other_site].reshape(3, 3) @ given[:3]
        torque = data.site_xmat[own.turn_site].reshape(3, 3) @ given[3:] if own.turns else np.zeros(3)
        return force, torque, place
