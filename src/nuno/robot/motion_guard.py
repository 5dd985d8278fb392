"""MotionGuard: looks ahead along what a robot without dynamics is asked to do, and keeps it out of static shapes."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.errors import InvalidInputError
from nuno.robot.coal_shapes import LinkHulls
from nuno.robot.collision import Collision
from nuno.robot.joint_placements import JointPlacements
from nuno.robot.link_sweep import Inside, Sweep, first_entry, spare_way
from nuno.robot.running_walk import RunningWalk
from nuno.robot.static_shapes import StaticShapes

if TYPE_CHECKING:
    from nuno.robot.gait import Looks
    from nuno.robot.links import Links
    from nuno.robot.trajectory_controller import TrajectoryController
    from nuno.robot.walk import TimedMotion
    from nuno.robot.wanted_motion import WantedMotion
    from nuno.world.world import World

logger = logging.getLogger(__name__)

COLLISIONS = ("stop", "warn", "ignore")
FAR = 20.0
"""[s] That are looked ahead at once; a longer motion is looked at again on the way."""
AROUND = 2.5
"""[m] From the base, within which the next three steps may take a link."""
ARM = 1.5
"""[m] By which a link moves at most for each radian of a joint, and more than a metre for each of the base."""
SAME = object()
"""Stands for the commands and shapes of now."""
SOON = 1e-9
"""[s] Rounding of sums of frames."""


class MotionGuard:
    """Sweeps a robot's links along what it is about to do, once for each command and whenever static shapes change.

    With "stop" joints stop before they take a link more than 5 mm into something, and walks come to rest before that;
    their goals end as aborted. With "warn" the robot goes on. Both are reported once for a link and a body, as a
    warning.

    Args:
        links: The robot's links.
        mode: "stop", "warn" or "ignore".
        world: The batch that the links' copies are in; None is their own world.
        of: The guard of the links themselves, where these are copies, whose shapes are the same; copies are silent.
        index: Which world of the batch.

    Attributes:
        mode: "stop", "warn" or "ignore"; it may be changed at any time.
        met: What the last motion that was begun would run into, or was stopped by; None for nothing.

    Raises:
        InvalidInputError: another mode.
    """

    def __init__(
        self, links: Links, mode: str, world: World | None = None, of: MotionGuard | None = None, index: int = 0
    ) -> None:  # fmt: skip
        self.check_mode(mode)
        self.mode = mode
        self.met: Collision | None = None
        self._links, self._robot, self._of = links, links.robot, of
        self._world = links.world if world is None else world
        self._made: tuple[LinkHulls, StaticShapes] | None = None
        self._placements: JointPlacements | None = None
        self._reported: set[tuple[str, str]] = set() if of is None else of._reported
        self._key: Any = None
        self._rests_since = -1  # the commands when nothing was left to do of them
        self._own: Any = None  # the commands after what was done here
        self._until = -np.inf  # the joints' clock up to which the way is known to be free
        self._acts = np.inf  # the clock at which joints are to stop
        self._walks_on = False  # whether the walk under way is free, and other joints are what is to stop
        self._inside: Inside = {}
        self._spare = 0.0  # [m] that links may move until they must be looked at again, step by step
        self._spare_key: Any = None
        self._index = index

    @staticmethod
    def check_mode(mode: str) -> None:
        """Raise where there is no such mode.

        Raises:
            InvalidInputError: so.
        """
        if not isinstance(mode, str) or mode not in COLLISIONS:
            raise InvalidInputError(f"collisions must be one of {COLLISIONS}, got {mode!r}")

    def forget(self) -> None:
        """Look anew before the next frame: the robot was put elsewhere."""
        self._key = self._spare_key = self._own = self.met = None
        self._spare, self._acts, self._until, self._rests_since = 0.0, np.inf, -np.inf, -1

    def save(self) -> tuple[Any, ...]:
        """Return what it has found, for ``load``."""
        return self._acts, self._until, self.met, self._spare, self._walks_on

    def load(self, saved: tuple[Any, ...] | None) -> None:
        """Go on from what was found when robot and world were as they are now; None begins anew.

        So the robot stops in the same frame, whenever it was looked at.
        """
        self.forget()
        if saved is not None:
            self._acts, self._until, self.met, self._spare, self._walks_on = saved
            self._key = SAME

    def before_frame(self, motion: WantedMotion, span: float) -> None:
        """Look ahead where anything has changed, and stop what is about to run into something.

        Args:
            motion: What the robot is asked to do.
            span: [s] of the frame that comes.
        """
        joints, gait = motion.joints, motion.gait
        if not self.is_due(motion, joints.clock, span):
            return
        key, at = (joints.commands, gait.walk, self._shapes().key()), joints.clock + span - SOON
        if gait.walk is None and joints.is_resting:
            self._rests_since = joints.commands
            return
        if key != self._key or at > self._until:
            self._look(motion, span)
            self._key = (joints.commands, gait.walk, key[2])
        if joints.clock + span > self._acts + SOON:
            self._stop(motion)

    def is_due(self, motion: WantedMotion, clock: float, span: float) -> bool:
        """Return True if ``before_frame`` has anything to do.

        Args:
            motion: What the robot is asked to do.
            clock: That of its joints [s].
            span: [s] of the frame that comes.
        """
        commands = motion.joints.commands
        if commands == self._rests_since or self.mode == "ignore":
            return False
        key, at = (commands, motion.gait.walk, self._shapes().key()), clock + span - SOON
        if self._key is SAME:
            self._key = key
        return bool(key != self._key or at > self._until or at > self._acts)

    def quiet_until(self, motion: WantedMotion) -> float:
        """Return up to when ``before_frame`` has nothing to do, by the joints' clock [s], if it is not due now."""
        if motion.joints.commands == self._rests_since or self.mode == "ignore":
            return np.inf
        return min(self._until, self._acts) + SOON

    def after_step(self, motion: WantedMotion, before: np.ndarray) -> Collision | None:
        """Return what the links run into in a frame that nobody could look ahead to, None for nothing.

        Args:
            motion: What the robot is asked to do, which has been worked out for the frame.
            before: Configuration (nq,) when it began.
        """
        if self.mode == "ignore":
            return None
        key, after = self._shapes().key(), motion.aim.q
        if self._spare_key is None:  # as it was loaded
            self._spare_key = key
        self._spare -= ARM * float(np.abs(after - before).sum())
        if self._spare > 0.0 and key == self._spare_key:
            return None
        robot, now, span = motion.robot, self._world.time, motion.aim.time - self._world.time
        angles = np.stack([robot.angles_of(before), robot.angles_of(after)])
        sweep = self._sweep(motion, np.array([now, now + span]), angles, np.stack([before[:7], after[:7]]))
        met = self._first(sweep)
        self._spare, self._spare_key = spare_way(sweep, self._shapes(), self._index), key
        if met is not None:
            self.met, self._spare = met, 0.0
            self._tell(met, "the joints stop before that" if self.mode == "stop" else "and goes through it")
        return met

    def velocities_of(self, motion: WantedMotion) -> Looks:
        """Return what to ask before a robot takes a velocity, see ``Gait.looks``."""

        def look(walk: RunningWalk, since: float) -> Collision | None:
            dynamic = self._of is None and self._links.bodies[0].is_dynamic  # copies with dynamics have no guard
            # in the open nothing is worked out before it is walked
            if self.mode != "stop" or dynamic or not self._near_anything(motion):
                return None
            met = self._on_walk(motion, walk, since, 1.0 / self._world.frame_rate)
            if met is not None:
                self.met = met
                self._tell(met, "the walk ends before that")
            return met

        return look

    # Inside

    def _meets(self, motion: WantedMotion, span: float) -> Callable[[TimedMotion, float], Collision | None]:
        return lambda walk, since: self._on_walk(motion, walk, since, span)

    def _on_walk(self, motion: WantedMotion, walk: TimedMotion, since: float, span: float) -> Collision | None:
        """Return what a robot on a walk would run into from a time [s] of the walk on, now."""
        clock, end = motion.joints.clock, float(walk.times[-1])
        count = max(int(np.ceil((end - since) / span - SOON)), 1)
        times = clock + span * np.arange(count + 1)
        own = since + span * np.arange(count + 1)
        configurations = walk.sampled(own)
        if motion.gait.walk is not None and (first := own < walk.times[0]).any():
            configurations[first] = motion.gait.ahead(times)[first]
        return self._swept(motion, times, *self._angles(motion, times, configurations), on_feet=False)

    def _near_anything(self, motion: WantedMotion) -> bool:
        """Return True if anything but planes may be in the way of the next steps."""
        shapes = self._shapes()
        shapes.key()  # which has what is there now
        now, place = np.array([self._world.time]), motion.robot.position
        for obstacle in shapes.obstacles:
            if obstacle.is_plane:
                continue
            places, axes = obstacle.poses(now, self._index)
            if obstacle.path is not None:
                return True
            apart = np.abs(axes[0].T @ (place - places[0]) - obstacle.middle) - obstacle.half
            if np.linalg.norm(np.maximum(apart, 0.0)) < AROUND:
                return True
        return False

    def _tools(self) -> tuple[LinkHulls, StaticShapes]:
        if self._made is None and self._of is not None and self._of._world is self._world:
            self._made = self._of._tools()
        if self._made is None:
            bodies = [self._world.find(body.name) for body in self._links.bodies] if self._of else self._links.bodies
            hulls = LinkHulls(self._robot) if self._of is None else self._of._tools()[0]
            if self._links.are_joints:
                owners = [bodies[joint - 1] for joint in hulls.joints]
            else:
                owners = list(bodies) if len(bodies) == len(hulls.names) else []
            self._made = hulls, StaticShapes(self._world, owners)
        return self._made

    def _shapes(self) -> StaticShapes:
        return self._tools()[1] if self._made is None else self._made[1]

    def _look(self, motion: WantedMotion, span: float) -> None:
        """Find what the motion under way runs into, and when joints are to stop for that."""
        joints, gait = motion.joints, motion.gait
        clock, self._acts, self._until = joints.clock, np.inf, np.inf
        end = min(max(joints.end, gait.end), clock + FAR)
        count = int(np.ceil((end - clock) / span - SOON))
        if count < 1:
            return
        times = clock + span * np.arange(count + 1)
        self._until = float(times[-1])
        walked = None if gait.walk is None else gait.ahead(times)
        met = self._swept(motion, times, *self._angles(motion, times, walked), on_feet=walked is None)
        if met is None:
            if (joints.commands, gait.walk) != self._own:
                self.met = None
            return
        self.met = met
        hit = clock + met.time - self._world.time  # that of a frame, after which it is too late
        late = any(own.end > hit for own in self._leading(motion, met))
        self._walks_on = walked is not None and late and self._is_of_others(motion, times, walked)
        goes_back = self.mode == "stop" and walked is not None and not self._walks_on
        if goes_back and gait.turn_back(hit, str(met), self._meets(motion, span)):
            self._tell(met, "the walk ends before that")
            self._until = -np.inf  # the way is another one
            self._own = joints.commands, gait.walk
            return
        does = "the motion stops before that" if self.mode == "stop" else "and goes through it"
        self._tell(met, does)
        if self.mode == "stop":
            self._acts = hit

    def _is_of_others(self, motion: WantedMotion, times: np.ndarray, walked: np.ndarray) -> bool:
        """Return True if the walk itself is free, with all joints but those of the legs as they are now."""
        angles, base = self._angles(motion, times, walked)
        others = np.ones(angles.shape[1], dtype=bool)
        others[motion.gait.rows] = False
        angles[:, others] = angles[0, others]
        return self._swept(motion, times, angles, base, on_feet=False) is None

    def _angles(
        self, motion: WantedMotion, times: np.ndarray, walked: np.ndarray | None
    ) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
        """Return the joints' angles (k, n) and the base (k, 7) at times of the joints' clock (k,)."""
        robot = motion.robot
        if walked is None:
            angles = motion.joints.ahead(times)
            base = np.tile(motion.aim.q[:7], (len(times), 1))
            return angles, base
        rows = motion.gait.rows
        given = np.array([robot.angles_of(q) for q in walked])[:, rows]
        return motion.joints.ahead(times, given, rows), walked[:, :7]

    def _swept(
        self, motion: WantedMotion, times: np.ndarray, angles: np.ndarray, base: np.ndarray, on_feet: bool
    ) -> Collision | None:  # fmt: skip
        """Return what the links run into; ``on_feet``: the base goes where its foot leaves it."""
        if not self._shapes().obstacles:
            return None
        if on_feet and (stood := motion.stance.ahead(angles)) is not None:
            base = stood
        clock = self._world.time + times - motion.joints.clock
        return self._first(self._sweep(motion, clock, angles, base))

    def _sweep(self, motion: WantedMotion, clock: np.ndarray, angles: np.ndarray, base: np.ndarray) -> Sweep:
        """Return the links along angles (k, n) and poses of the base (k, 7) at times of the world's clock (k,)."""
        robot, data = motion.robot, motion.robot.scratch
        if self._placements is None or self._placements.data is not data:
            self._placements = JointPlacements(robot.model, data)
        return Sweep(self._tools()[0], clock, *self._placements.at(robot.configuration_of(angles, base)))

    def _first(self, sweep: Sweep) -> Collision | None:
        hulls, shapes = self._tools()
        found = first_entry(sweep, shapes, self._index, self._inside)
        for own, body in self._inside:
            if self._is_new(hulls.names[own], body.name):
                logger.warning(
                    "%r: %s is in %r when it sets off; it may leave it, and go no deeper. Move the body, or put the "
                    "robot elsewhere", self._robot.name, hulls.names[own], body.name,
                )  # fmt: skip
        if found is None:
            return None
        k, link, obstacle, point = found
        return Collision(hulls.names[link], obstacle.body.name, float(sweep.times[k]), point, int(hulls.joints[link]))

    def _leading(self, motion: WantedMotion, met: Collision) -> list[TrajectoryController]:
        """Return the controllers whose joints lead a link to what it would run into: its own, and the legs'."""
        rows = {joint - 2 for joint in self._robot.model.supports[met.joint].tolist()}
        rows |= {int(row) for row in motion.gait.rows}
        joints = motion.joints
        return [joints.controllers[name] for name, own in joints.rows.items() if rows & set(own.tolist())]

    def _stop(self, motion: WantedMotion) -> None:
        """Let what takes the link there stop at once."""
        assert self.met is not None
        joints, text, before = motion.joints, str(self.met), motion.joints.commands
        if motion.gait.is_walking and not self._walks_on:
            motion.gait.give_up(text, aborted=True)
            self._key = None
        for name, own in joints.controllers.items():
            if own.end > joints.clock - SOON and own in self._leading(motion, self.met):
                joints.stop(name, text)
        if joints.commands == before and self._key is not None:  # something came to the robot, not the robot to it
            self._acts = np.inf
        else:
            self._key, self._own = None, (joints.commands, motion.gait.walk)

    def _tell(self, met: Collision, does: str) -> None:
        if not self._is_new(met.link, met.body):
            return
        logger.warning(
            '%r: %s; %s. Send it elsewhere, move the body, or let it pass with collisions="ignore" or '
            "world.ignore_contact(link, body)", self._robot.name, met, does,
        )  # fmt: skip

    def _is_new(self, link: str, body: str) -> bool:
        """Return True once for a link and a body; never of copies, whose states tell."""
        if (link, body) in self._reported or self._of is not None:
            return False
        self._reported.add((link, body))
        return True
