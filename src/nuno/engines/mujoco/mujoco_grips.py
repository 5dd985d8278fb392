"""Grips, ball and fixed joints in MuJoCo, as equality constraints whose targets are written before each substep.

A held vertex has an equality of each of its coordinates with a number, a point inside a face one of each coordinate's
weighted sum, by fixed tendons. Points that give way, or whose grip bears a limited force, are drawn by springs, see
`nuno.engines.mujoco.mujoco_springs`. A rigid body is welded to what leads it: another body, or a heavy one without a
shape that is sent along the path. Ball joints are one connected point, fixed joints welds; those with drives are in
`nuno.engines.mujoco.mujoco_balls`. What gives way, slides or bears a limited force at a rigid body is held by bushings,
see `nuno.engines.mujoco.mujoco_bushings`. Hinges and sliders are joints of MuJoCo, see
`nuno.engines.mujoco.mujoco_joints`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.engines.driven_motion import driven_hold, driven_points
from nuno.engines.mujoco import mujoco_spring_limits as spring_limits
from nuno.engines.mujoco.mujoco_balls import Balls, is_driven_spherical
from nuno.engines.mujoco.mujoco_blends import add_blend, find_blend, place_blend
from nuno.engines.mujoco.mujoco_bushing import is_loose
from nuno.engines.mujoco.mujoco_bushings import Bushings
from nuno.engines.mujoco.mujoco_elements import SpecElements
from nuno.engines.mujoco.mujoco_held import Held, is_spring
from nuno.engines.mujoco.mujoco_leaders import LEADER, send
from nuno.engines.mujoco.mujoco_package import mujoco_package
from nuno.engines.mujoco.mujoco_spring_limits import limit_springs
from nuno.engines.mujoco.mujoco_springs import add_spring, draw, find_springs
from nuno.engines.mujoco.mujoco_stiff import CLOSING, STIFF
from nuno.engines.mujoco.mujoco_tree import is_of_tree
from nuno.engines.world_view import attached, dynamics_of
from nuno.joints.grip import Grip, GripSpec
from nuno.joints.joint import JointSpec
from nuno.joints.tie import HoldSpec, TieSpec, corners_of
from nuno.shapes import quaternion as quat
from nuno.shapes.coordinates import apply, compose

if TYPE_CHECKING:
    from nuno.engines.world_view import EngineWorld


class Holds(SpecElements):
    """All grips of a world, and its ball and fixed joints.

    Args:
        world: The world.
        bushings: Its bushings.
        balls: Its ball joints with drives.
    """

    def __init__(self, world: EngineWorld, bushings: Bushings, balls: Balls) -> None:
        super().__init__()
        self._world, self._bushings, self._balls = world, bushings, balls
        self._held: list[Held] = []
        self._step = 0.0

    # The spec

    def clear(self) -> None:
        """Take all grips out of the spec; bodies go after them."""
        super().clear()
        self._held = []

    def add(self, spec: Any, placed: dict[str, Any], step: float) -> None:
        """Put all present grips into the spec, for substeps so long [s]."""
        self._spec, self._step = spec, step
        for dynamics in attached(self._world):
            for grip in dynamics.grips:
                if is_of_tree(grip):
                    continue
                own = Held(grip)
                self._held.append(own)
                if isinstance(grip.spec, GripSpec | TieSpec):
                    self._add_points(own, placed)
                elif isinstance(grip.spec, HoldSpec):
                    self._add_hold(own, placed)
                else:
                    self._add_joint(own, placed)

    def _equality(self, own: Held, kind: str, name1: str, name2: str = "", objtype: str | None = None) -> Any:
        mujoco = mujoco_package()
        self._made += 1
        made = self._spec.add_equality(name=f"e{self._made}", type=getattr(mujoco.mjtEq, f"mjEQ_{kind}"), name1=name1)
        if name2:
            made.name2 = name2
        if objtype:
            made.objtype = getattr(mujoco.mjtObj, f"mjOBJ_{objtype}")
        made.solimp = STIFF
        own.names.append(made.name)
        self._elements.append(made)
        return made

    def _add_points(self, own: Held, placed: dict[str, Any]) -> None:
        spec = own.grip.spec
        mine = placed[own.grip.body.key]
        corners, weights = corners_of(spec)
        other_corners, other_weights = getattr(spec, "other_corners", None), getattr(spec, "other_weights", None)
        rigid = isinstance(spec, TieSpec) and spec.places is not None
        # a stiff equality with a light point would give way
        loose = is_loose(spec) or (rigid and bool(((weights > 0.0).sum(axis=-1) > 1).any()))
        target: Any = placed[own.grip.target.key] if own.grip.target is not None else None
        known: dict[Any, int] = {}
        rest: list[np.ndarray] = []
        own.point = np.full(corners.shape[:2], -1)
        for world, k in np.ndindex(corners.shape[:2]):
            terms = [(int(c), float(w)) for c, w in zip(corners[world, k], weights[world, k], strict=True)
                     if c >= 0 and w > 0.0]  # fmt: skip
            if not terms:
                continue
            others: list[tuple[int, float]] = []
            if other_corners is not None and other_weights is not None:
                others = [(int(c), -float(w)) for c, w in
                          zip(other_corners[world, k], other_weights[world, k], strict=True) if w > 0.0]  # fmt: skip
            key = (tuple(terms), tuple(others), k if rigid else -1)
            if key not in known:
                known[key] = len(rest)
                place = sum(w * mine.mesh.rest[c] for c, w in terms)
                if others:
                    place = place + sum(w * target.mesh.rest[c] for c, w in others)
                rest.append(np.asarray(place))
                if loose:
                    self._add_bushing(own, (self._point(own, mine, terms), target.bodies[0]), other=spec.places[:, k])
                elif rigid:
                    self._equality(own, "CONNECT", mine.bodies[terms[0][0]].name, target.bodies[0].name, "BODY")
                else:
                    self._add_coordinates(own, mine, terms, target, others)
            own.point[world, k] = known[key]
        for k, made in enumerate(own.bushings):
            made.worlds = (own.point == k).any(axis=1)
        own.rest = np.array(rest).reshape(-1, 3)

    def _point(self, own: Held, mine: Any, terms: list[tuple[int, float]]) -> Any:
        """Return the body of a vertex in the spec, or of a blend of some, which is added."""
        if len(terms) == 1:
            return mine.bodies[terms[0][0]]
        self._made += 1
        blend = add_blend(self._spec, f"p{self._made}", mine, terms)
        self._elements += blend.elements
        own.blends.append(blend)
        return blend.body

    def _add_coordinates(self, own: Held, mine: Any, terms: Any, target: Any, others: Any) -> None:
        """Add an equality, or a spring, of each coordinate of a point of a flex."""
        soft = is_spring(own.grip.spec)
        if soft:
            own.terms.append(terms)
            own.others.append(others)
        for letter in "xyz":
            if len(terms) == 1 and not others and not soft:
                self._equality(own, "JOINT", f"{mine.bodies[terms[0][0]].name}.{letter}")
                continue
            self._made += 1
            name = f"t{self._made}"
            wraps = [(f"{part.bodies[corner].name}.{letter}", weight)
                     for part, its in ((mine, terms), (target, others)) for corner, weight in its]  # fmt: skip
            if soft:
                own.names.append(name)
                self._elements += add_spring(self._spec, name, wraps)
                continue
            tendon = self._spec.add_tendon(name=name)
            for joint, weight in wraps:
                tendon.wrap_joint(joint, weight)
            self._elements.append(tendon)
            self._equality(own, "TENDON", tendon.name)

    def _add_hold(self, own: Held, placed: dict[str, Any]) -> None:
        grip, mine = own.grip, placed[own.grip.body.key].bodies[0]
        loose = is_loose(grip.spec)
        if grip.target is not None and not (loose and dynamics_of(grip.target) is None):
            leads = placed[grip.target.key].bodies[0]
        else:
            self._made += 1
            leads = own.leader = self._spec.worldbody.add_body(
                name=f"g{self._made}", mass=LEADER, inertia=[LEADER] * 3, explicitinertial=True, gravcomp=1.0
            )
            own.leader.add_freejoint(name=own.leader.name)
            self._elements.append(own.leader)
        if not loose:
            self._equality(own, "WELD", leads.name, mine.name, "BODY")
            return
        place, turn = grip.spec.pose_at(0) if own.leader is None else (None, None)
        self._add_bushing(own, (mine, leads), other=place, other_turn=turn)

    def _add_joint(self, own: Held, placed: dict[str, Any]) -> None:
        grip, joined = own.grip, placed[own.grip.body.key]
        spec, mine = grip.spec, joined.bodies[0]
        other = self._spec.worldbody if grip.target is None else placed[grip.target.key].bodies[0]
        if is_driven_spherical(spec):
            own.ball = self._balls.add(self._spec, grip, mine, other)
            joined.thin.append(own.ball.helper)
            if is_loose(spec):
                self._add_bushing(own, (mine, own.ball.helper), spec.place, other=spec.place)
            else:
                self._equality(own, "WELD", own.ball.helper.name, mine.name, "BODY")
        elif is_loose(spec):
            frames = spec.place, spec.turn, spec.other_place, spec.other_turn
            self._add_bushing(own, (mine, other), *frames, turns=spec.kind == "fixed")
        else:
            self._equality(own, "WELD" if spec.kind == "fixed" else "CONNECT", other.name, mine.name, "BODY")

    def _add_bushing(
        self, own: Held, bodies: Any, place: Any = None, turn: Any = None, other: Any = None, other_turn: Any = None,
        turns: bool = True,
    ) -> None:  # fmt: skip
        """Add a bushing between frames (worlds, 3 or 4) of two bodies; None is the body's own."""
        worlds, spec = self._world.world_count, own.grip.spec
        frames = [np.zeros((worlds, 3)) if part is None else part for part in (place, other)]
        quaternions = [np.tile(quat.IDENTITY, (worlds, 1)) if part is None else part for part in (turn, other_turn)]
        is_tie = isinstance(spec, TieSpec)
        mass = 0.0 if is_tie else float(dynamics_of(own.grip.body).mass[0])
        frames = [frames[0], quaternions[0], frames[1], quaternions[1]]
        target = own.grip.target
        moves = own.leader is None and own.ball is None and target is not None and dynamics_of(target) is not None
        made = self._bushings.add(
            self._spec, bodies, frames, spec, mass, self._step, dynamics_of(own.grip.body), moves, turns and not is_tie
        )
        own.bushings.append(made)

    # The model

    def find(self, model: Any, batch: Any, placed: dict[str, Any], step: float) -> None:
        """Note where the equalities are in a compiled model, and write what does not change with time."""
        if not self._held:
            return
        worlds = self._world.world_count
        data, active = batch.expand("eq_data"), batch.bind("eq_active")
        for own in self._held:
            if is_spring(own.grip.spec):
                find_springs(own, placed, model, batch)
                continue
            own.rows = np.array([model.equality(name).id for name in own.names], dtype=int)
            batch.expand("eq_solref")[:, own.rows] = (CLOSING * step, 1.0)
            spec = own.grip.spec
            for blend in own.blends:
                find_blend(blend, placed[own.grip.body.key], model, batch, step)
            if own.leader is not None:
                body = model.body(own.leader.name).id
                own.address = int(model.jnt_qposadr[model.body_jntadr[body]]), int(model.body_dofadr[body])
            if isinstance(spec, GripSpec | TieSpec):
                if not own.bushings:
                    self._find_points(own, data, active)
            elif own.bushings:
                continue
            elif isinstance(spec, HoldSpec):
                place, turn = np.zeros((worlds, 3)), np.tile(quat.IDENTITY, (worlds, 1))
                if own.leader is None:
                    place, turn = own.grip.offsets if own.grip.offsets is not None else spec.pose_at(0)
                _weld(data, int(own.rows[0]), place, turn)
            elif own.ball is not None:  # at the joint's place in both
                _weld(data, int(own.rows[0]), np.zeros((worlds, 3)), np.tile(quat.IDENTITY, (worlds, 1)))
                data[:, own.rows[0], 0:3], data[:, own.rows[0], 3:6] = spec.place, spec.place
            else:
                _joint(data, own.rows, spec)

    def _find_points(self, own: Held, data: np.ndarray, active: np.ndarray) -> None:
        spec = own.grip.spec
        assert own.point is not None and own.rest is not None
        each = 1 if isinstance(spec, TieSpec) and spec.places is not None else 3
        rows = own.rows.reshape(-1, each)
        active[:, own.rows] = 0.0
        for world, points in enumerate(own.point):
            for k, point in enumerate(points):
                if point < 0:
                    continue
                active[world, rows[point]] = 1.0
                if isinstance(spec, TieSpec):
                    if spec.places is not None:
                        data[world, rows[point, 0], :6] = (0.0, 0.0, 0.0, *spec.places[world, k])
                    else:
                        data[world, rows[point], :5] = 0.0
                        data[world, rows[point], 0] = -own.rest[point]

    def place(self, batch: Any) -> None:
        """Set what is not a body of the world to where it belongs, once those are written."""
        for own in self._held:
            for blend in own.blends:
                place_blend(blend, batch)

    def targets(self, start: float, end: float, times: np.ndarray) -> list[tuple[Held, Any]]:
        """Return where each driven grip leads at ``times`` (k + 1,) [s] from ``start`` to ``end``."""
        frame = 1.0 / self._world.frame_rate
        found: list[tuple[Held, Any]] = []
        for own in self._held:
            if isinstance(own.grip.spec, GripSpec):
                found.append((own, driven_points(own.grip, start, frame, times)))
            elif own.leader is not None:
                found.append((own, driven_hold(own.grip, start, end, times, self._world.world_count)))
            elif own.is_limited_spring:
                found.append((own, None))
        return found

    def present(self, time: float, step: float) -> list[tuple[Held, Any]]:
        """Return of each driven grip where it leads at a time [s] and a ``step`` [s] on; nothing is noted."""
        found: list[tuple[Held, Any]] = []
        for own in self._held:
            spec, target = own.grip.spec, own.grip.target
            if own.is_limited_spring:  # the last substep tells what it bears
                continue
            if isinstance(spec, GripSpec):
                times = np.array([time, time + step])
                if target is None or own.grip.offsets is None:
                    found.append((own, spec.at(times)))
                else:
                    now = np.broadcast_to(apply(target.pose(), own.grip.offsets), own.grip.offsets.shape)
                    found.append((own, np.stack([now, now], axis=2)))
            elif own.leader is not None and target is not None:
                shape = (self._world.world_count, 2)
                lead = compose(target.pose(), own.grip.offsets)
                parts = (np.broadcast_to(part[..., None, :], (*shape, part.shape[-1])) for part in lead)
                found.append((own, tuple(parts)))
            elif own.leader is not None:
                places, turns = zip(spec.at(time), spec.at(time + step), strict=True)
                found.append((own, (np.stack(places, axis=1), np.stack(turns, axis=1))))
        return found

    def write(self, targets: list[tuple[Held, Any]], batch: Any, k: int, step: float, at_end: bool = True) -> None:
        """Write where driven grips lead in substep ``k``, which takes ``step`` [s]; springs at its start or end."""
        for own, goals in targets:
            if own.leader is not None:
                place, turn = (part[:, k : k + 2] for part in goals)
                send(batch, own.address, place, turn, step)
                continue
            if own.is_limited_spring:
                self._limit(own, goals, batch, k, step)
                continue
            if own.terms:
                draw(own, batch, goals[:, :, k + 1 if at_end else k])
                continue
            data = batch.expand("eq_data")
            velocity = (goals[:, :, k + 1] - goals[:, :, k]) / step
            # the spring and damper of an equality lag behind a moving target by as much
            goal = goals[:, :, k + 1] + 2.0 * STIFF[0] * CLOSING * step * velocity
            assert own.point is not None and own.rest is not None
            world, point = np.nonzero(own.point >= 0)
            which = own.point[world, point]
            data[world[:, None], own.rows.reshape(-1, 3)[which], 0] = goal[world, point] - own.rest[which]

    def _limit(self, own: Held, goals: Any, batch: Any, k: int, step: float) -> None:
        assert own.point is not None and own.rest is not None
        world, point = np.nonzero(own.point >= 0)
        rest = own.rest[own.point[world, point]]
        if goals is None:  # a tie draws its sides to each other
            limit_springs(own, batch, -rest, -rest, step)
        else:
            limit_springs(own, batch, goals[world, point, k] - rest, goals[world, point, k + 1] - rest, step)

    def begin(self) -> None:
        """Take over, before a frame, what springs with limits did last."""
        spring_limits.begin(self._held)

    def restart(self) -> None:
        """Go back to the start of the frame."""
        spring_limits.restart(self._held)

    def end(self, batch: Any) -> None:
        """Note, after a frame, what springs with limits did last."""
        spring_limits.end(self._held, batch)

    def held_by(self, grip: Grip) -> Held | None:
        """Return a grip as it is in the spec; None where it is not known there."""
        return next((own for own in self._held if own.grip is grip), None)


def _weld(data: np.ndarray, row: int, place: np.ndarray, turn: np.ndarray) -> None:
    """Write where the second body of a weld is in the frame of the first, (worlds, 3) [m] and (worlds, 4)."""
    data[:, row, 0:3], data[:, row, 3:6], data[:, row, 6:10], data[:, row, 10] = 0.0, place, turn, 1.0


def _joint(data: np.ndarray, rows: np.ndarray, spec: JointSpec) -> None:
    if spec.kind == "fixed":
        turn = quat.multiply(spec.other_turn, quat.inverse(spec.turn))
        place = spec.other_place - quat.rotate(turn, spec.place)
        _weld(data, int(rows[0]), place, turn)
        return
    data[:, rows[0], 0:3], data[:, rows[0], 3:6] = spec.other_place, spec.place
