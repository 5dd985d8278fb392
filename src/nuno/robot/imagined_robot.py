"""ImaginedRobot: the copies of a simulated robot in a batch of imagined worlds, each with its own commands."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from nuno.errors import BodyStateError, InvalidInputError
from nuno.robot.joint_batch import JointBatch
from nuno.robot.pinocchio import pin
from nuno.robot.robot_state import RobotState
from nuno.robot.spatial_arrays import placement_arrays
from nuno.robot.trajectory import JointTrajectory, passing_velocities
from nuno.robot.wanted_motion import WantedMotion
from nuno.tables.kinematic_motion import KinematicGroup
from nuno.validation import finite_array, number

if TYPE_CHECKING:
    from nuno.robot.balance import Balance
    from nuno.robot.simulated_robot import SimulatedRobot
    from nuno.world.world import World


class ImaginedRobot:
    """A robot in every world of a batch: ``world.imagine(n).robot``.

    What is under way in the robot's world goes on in each of them. Commands may differ from world to world. Sensors and
    cameras are the original's alone.

    Args:
        original: The robot.
        world: A batch that was imagined from its world.
        of: The copies that these are copies of, and which of them; None where the original is copied.

    Attributes:
        original: The robot.
        world: The batch.
        joint_names: Names of its joints, n of them.
    """

    def __init__(
        self, original: SimulatedRobot, world: World, of: tuple[ImaginedRobot, int] | None = None
    ) -> None:  # fmt: skip
        self.original, self.world = original, world
        self.joint_names = original.actual.joint_names
        state, motion, self._servo = original.saved() if of is None else of[0].saved_of(of[1])
        self._links = [world.find(body.name) for body in original.links.bodies]
        self.balance: Balance | None = None
        if original.balance is not None and (original.is_dynamic if of is None else of[0].balance is not None):
            self.balance = original.balance.imagined(world)
        self._states: list[RobotState] = [state] * world.world_count
        groups = {name: own.names for name, own in original.joints.controllers.items()}
        self._motions = []
        for _ in range(world.world_count):
            own = WantedMotion(original.wanted.copy(), groups, world.time)
            own.load(motion)
            own.disown()
            for name, controller in own.joints.controllers.items():
                controller.near = original.joints.controllers[name].near
            self._motions.append(own)
        self._before = self._states
        self._group = KinematicGroup(tuple(body.key for body in self._links))
        self._data = original.actual.model.createData()
        self._axes, self._origins = placement_arrays(self._data.oMi.tolist())
        self._batch: JointBatch | None = None  # which has what the joints are, while nobody asks their controllers
        self._asked: list[int] = []  # worlds whose controllers were asked in this frame
        self._pending: tuple[Any, ...] = ()

    def __repr__(self) -> str:
        return f"<ImaginedRobot {self.original.actual.name!r} in {self.world.world_count} worlds>"

    # What it does

    def state(self) -> tuple[RobotState, ...]:
        """Return where the robot is and how it moves, and whether it fell, of each world."""
        with self.world.lock:
            return tuple(self._states)

    def angle_vector(
        self, angles: ArrayLike | Mapping[str, ArrayLike] | None = None, seconds: float = 1.0
    ) -> np.ndarray:
        """Send joints to angles in ``seconds`` [s] where they are given, and return where they are, (worlds, n).

        Args:
            angles: (n,) for all worlds or (worlds, n) [rad; m for slides], or by name a number or (worlds,), others
                staying where they are sent.
            seconds: [s].

        Raises:
            InvalidInputError: angles of other shapes, or not finite.
            UnknownNameError: no joint of that name.
            BodyStateError: the robot walks or is under a servo command.
        """
        with self.world.lock:
            worlds = self.world.world_count
            if angles is not None:
                self._bring_motions()
                wanted = np.array([own.joints.desired[0] for own in self._motions])
                if isinstance(angles, Mapping):
                    for name, value in angles.items():
                        k = self.original.actual.joint_index(name)
                        wanted[:, k] = finite_array(f"the angle of {name!r}", value, (), (worlds,))
                else:
                    count = len(self.joint_names)
                    wanted = np.array(
                        np.broadcast_to(finite_array("angles", angles, (count,), (worlds, count)), wanted.shape)
                    )
                self._send(wanted[:, None], np.array([number("seconds", seconds, above=0.0)]))
            robot = self.original.actual
            return np.array([robot.angles_of(state.q) for state in self._states])

    def angle_vector_sequence(self, avs: ArrayLike, times: ArrayLike = 1.0) -> None:
        """Send joints through many angles, as the robot's own ``angle_vector_sequence`` does in its world.

        Args:
            avs: (k, n) for all worlds or (worlds, k, n) [rad; m for slides].
            times: How long each takes [s] from the one before, (k,), or one number for all; what is too fast for the
                joints is stretched, in each world by itself.

        Raises:
            InvalidInputError: other shapes, not finite, or times that are not positive.
            BodyStateError: the robot walks or is under a servo command.
        """
        with self.world.lock:
            worlds, count = self.world.world_count, len(self.joint_names)
            given = finite_array("avs", avs, ("k", count), (worlds, "k", count))
            spans = np.array(np.broadcast_to(finite_array("times", times, (), given.shape[-2:-1]), given.shape[-2]))
            if (spans <= 0.0).any():
                raise InvalidInputError(f"times must be above 0, got {spans.min():g}")
            self._bring_motions()
            self._send(np.broadcast_to(given, (worlds, *given.shape[-2:])), spans)

    def _send(self, wanted: np.ndarray, spans: np.ndarray) -> None:
        """Send each world's joints through angles (worlds, k, n), each of which takes a span (k,) [s]."""
        if self._servo is not None or any(own.gait.is_walking for own in self._motions):
            raise BodyStateError(f"{self.original.actual.name!r} walks or is under a servo command there")
        shortest = self.original.angle_vector_duration
        for own, goals in zip(self._motions, wanted, strict=True):
            begin = own.joints.desired[0]
            steps = np.array([self.original.sub_angle_vector(b, a) for a, b in pairwise((begin, *goals))])
            needed = [shortest(a, b) for a, b in pairwise((begin, *goals))]
            longer = np.maximum(spans, needed)  # as the driver stretches what is too fast
            speeds, times = passing_velocities(steps, longer), np.cumsum(longer)
            for name, rows in own.joints.rows.items():
                names = own.joints.controllers[name].names
                own.joints.send(name, JointTrajectory(names, times, goals[:, rows], speeds[:, rows]))

    def saved_of(self, world: int) -> tuple[RobotState, Any, Any]:
        """Return state, wanted motion and servo command of one world, as ``SimulatedRobot.saved`` does."""
        if not 0 <= world < len(self._motions):
            raise InvalidInputError(f"world must be in 0 to {len(self._motions) - 1}, got {world}")
        self._bring_motions()
        return self._states[world], self._motions[world].save(), self._servo

    # What the world asks of it

    def begin_frame(self, start: float, end: float) -> None:
        """Set the motors for a frame, or send the links on their way."""
        if not self._is_whole():
            return
        span, self._before = end - start, self._states
        if self.balance is None:
            self._begin_kinematic(start, end)
            return
        aims = [own.begin(end, span) for own in self._motions]
        if span <= 0.0:
            return
        loads = self.balance.dynamics.loads()
        told = [
            self.balance.command(state, aim, span, self._servo, load)
            for state, aim, load in zip(self._states, aims, loads, strict=True)
        ]
        self.balance.dynamics.drive(*(np.array(part) for part in zip(*told, strict=True)))

    def end_frame(self) -> None:
        """Take the frame's motion as done."""
        if not self._is_whole():
            return
        if self.balance is None:
            self._end_kinematic()
            return
        q, v = self.balance.dynamics.read()
        torques = self.balance.dynamics.efforts_now()
        states = list(self._states)
        for w, own in enumerate(self._motions):
            state = self.balance.judge(states[w], own.aim, q[w], v[w], torques[w], self.world.time)
            states[w] = state
            own.joints.take_step((self.original.actual.angles_of(state.q), state.v[6:], state.a[6:]))
            own.gait.end_frame()
        self._states = states

    def cancel_frame(self) -> None:
        """Go back to where the robot was when the frame began."""
        self._states = self._before
        for w in range(len(self._motions)) if self.balance is not None else self._asked:
            self._motions[w].cancel()
        self._asked, self._pending = [], ()

    def save(self) -> Any:
        """Return all that it is, for a snapshot."""
        joints = () if self.balance is None else self.balance.dynamics.joints
        self._bring_motions()
        return list(self._states), [own.save() for own in self._motions], joints, self._servo

    def load(self, saved: Any) -> None:
        """Become what it was when a snapshot was taken."""
        states, motions, joints, self._servo = saved
        self._states, self._batch = list(states), None
        for own, motion in zip(self._motions, motions, strict=True):
            own.load(motion)
        if self.balance is not None:
            self.balance.dynamics.joints = joints

    def imagined(self, futures: World, world: int) -> ImaginedRobot | None:
        """Return the copies of one world's robot in a batch that was imagined from that world; None without links."""
        if not self._is_whole():
            return None
        return ImaginedRobot(self.original, futures, (self, world))

    def _is_whole(self) -> bool:
        """Return True as long as no link was removed from the batch; without all of them the robot does nothing."""
        return set(self.world.bodies).issuperset(self._links)

    # Without dynamics

    def _begin_kinematic(self, start: float, end: float) -> None:
        """Work out where all robots are at the end of the frame, and send their links there.

        Robots of which a controller must be asked, or whose base moves, are worked out one by one.
        """
        span, self._asked, self._pending = end - start, [], ()
        if span <= 0.0:
            for own in self._motions:
                own.begin(end, span)
            self._asked = list(range(len(self._motions)))
            return
        if self._batch is None:
            self._batch = JointBatch([own.joints for own in self._motions])
        batch, servo = self._batch, None if self._servo is None else self._serve
        motion, desired, rests = batch.step(span)
        alone = batch.due(span)
        legs = self._motions[0].leg_rows
        alone |= (motion[0] != batch.motion[0])[:, legs].any(axis=1) | motion[1:, :, legs].any(axis=(0, 2))
        alone |= np.array([servo is not None or own.gait.is_walking for own in self._motions])
        states = list(self._states)
        for w in np.flatnonzero(alone).tolist():
            self._bring(w)
            states[w] = self._motions[w].begin(end, span, servo)
        self._asked = np.flatnonzero(alone).tolist()
        for w in np.flatnonzero(~alone).tolist():
            q, v, a = states[w].q, states[w].v, states[w].a
            if not rests[w]:
                q = self.original.actual.configuration_of(motion[0, w], q[:7])
                v, a = np.zeros_like(v), np.zeros_like(a)
                v[6:], a[6:] = motion[1:, w]
            states[w] = RobotState(end, q, v, a)
        moved = [w for w, state in enumerate(states) if not np.array_equal(state.q, self._states[w].q)]
        if moved:
            self._lead(start, end, states)
        self._states, self._pending = states, (~alone, span, motion, desired)

    def _end_kinematic(self) -> None:
        for w in self._asked:
            own = self._motions[w]
            own.joints.take_step()
            own.gait.end_frame()
            if self._batch is not None:
                self._batch.gather(w)
        if self._batch is not None and self._pending:
            self._batch.take(*self._pending)
        self._asked, self._pending = [], ()

    def _bring_motions(self) -> None:
        """Bring the motions of all worlds up to date, for whoever reads or changes them."""
        if self._batch is not None:
            for w in range(len(self._motions)):
                self._bring(w)
            self._batch = None

    def _bring(self, world: int) -> None:
        assert self._batch is not None
        self._batch.scatter(world)
        self._motions[world].take(self._states[world])

    def _lead(self, start: float, end: float, states: list[RobotState]) -> None:
        """Send the links to where the robots are at the end of the frame, on a path for each world."""
        axes = np.empty((len(states), *self._axes.shape))
        origins = np.empty((len(states), *self._origins.shape))
        for w, state in enumerate(states):
            pin.forwardKinematics(self.original.actual.model, self._data, state.q)
            axes[w], origins[w] = self._axes, self._origins
        ends = self.original.links.poses_at(axes, origins)
        begins = self._group.arrived(self._links, start)
        worlds, keys = len(states), []
        for begin, aim in zip(begins, ends, strict=True):
            first = begin if begin.ndim == 3 else begin[:, None]
            both = np.stack(np.broadcast_arrays(first, aim.swapaxes(0, 1)), axis=2)
            keys.append(both if worlds > 1 else both[:, 0])
        self._group.lead(self._links, self.world, np.array([start, end]), keys[0], keys[1])

    def _serve(self, before: RobotState, others: Any, base: Any, span: float) -> tuple[np.ndarray, Any]:
        return self._servo.rows, self._servo.step(before, others, base, span, None)
