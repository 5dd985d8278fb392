"""RunningWalk: a walk at a velocity that may change with every step, worked out while the robot walks."""

from __future__ import annotations

import logging
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from nuno.errors import WalkError
from nuno.robot.footsteps import LEFT, RIGHT, Footstep, middle_of, moved, screw, steps_of_velocity
from nuno.robot.leg_motion import LegFollower
from nuno.robot.preview_control import TICK
from nuno.robot.stride import Stride
from nuno.robot.timeline import Schedule, Timeline, timeline
from nuno.robot.walk import TimedMotion
from nuno.robot.walk_check import check_measures, measure_walk, motion_of, zero_moments
from nuno.robot.walk_planner import WalkPlanner, share_of_rest

if TYPE_CHECKING:
    from nuno.robot.walk_planner import States

logger = logging.getLogger(__name__)

AHEAD = 2
"""Steps at the velocity that are always planned, before the one that closes the stance: the preview needs 1.6 s."""
CHUNK = 200
"""[tick] That are worked out and checked together where no further decision comes."""


class RunningWalk(TimedMotion):
    """A walk that ends standing, of which only what is about to be walked is worked out.

    The motion is that of a ``Walk`` over the same footsteps: two passes of preview control and the legs' inverse
    kinematics at every tick. What a tick needs to know of the future ends 1.6 s after it, so a velocity may change
    at every landing for the price of the ticks in between, not for that of a whole walk. Ticks once known do not
    change; another velocity makes another ``RunningWalk`` that begins where this one is left.

    The ticks up to the next landing are worked out and checked when it is made.

    Args:
        planner: Of the robot that walks.
        schedule: Its steps.
        begin: The tick that it begins at.
        q: Configuration (nq,) then.
        states: Of both passes then.
        moving: Velocity and acceleration (nv,) then; None is at rest.

    Attributes:
        is_closing: Whether only the step that closes the stance is left.

    Raises:
        WalkError: the robot cannot walk so.
    """

    def __init__(
        self, planner: WalkPlanner, schedule: Schedule, begin: int, q: np.ndarray, states: States,
        moving: tuple[np.ndarray, np.ndarray] | None = None,
    ) -> None:  # fmt: skip
        planner.check_gaps(schedule)
        self._planner, self._schedule, self.begin = planner, schedule, begin
        wanted = timeline(schedule).after(begin)
        control = planner.control
        self._wanted = replace(wanted, point=control.joined(wanted.point, states[0][0]))
        n = len(wanted.point)
        self.dt, self.times = TICK, (begin + np.arange(n)) * TICK
        self._first = control.follow(self._wanted.point, *states[0])
        centre = self._first[0][:, 0]
        made = planner.targets(self._wanted)
        self._free = 1.0 - share_of_rest(n, planner.stride)
        self._targets = made(centre)  # of the second pass, which adds to the centre of mass tick by tick
        self._near = LegFollower(planner.legs, made(centre), q, None, begin * TICK)
        self._missed = np.zeros((n + len(control.preview_gains), 2))
        self._computed = 0  # ticks of the first pass whose zero moment points are known
        self._second = np.zeros((n, 3, 2)), np.zeros((n, 2))
        self._second[0][0], self._second[1][0] = states[1]
        self._find_near(len(control.preview_gains) + 1)
        computed = self._missed[: self._computed]
        computed[:] = control.joined(computed, states[1][0])
        self._found = LegFollower(planner.legs, self._targets, self._near.found[0], self._near.found, begin * TICK)
        self.configurations = self._found.found
        self.velocities, self.accelerations = (np.zeros((n, self.model.nv)) for _ in range(2))
        if moving is not None:
            self.velocities[0], self.accelerations[0] = moving
        self.is_closing = len(schedule.steps) == 1
        self._done = 0  # ticks that are worked out and checked
        landing = landing_after(self, begin)
        self._work_out(CHUNK if landing is None else landing - begin + 2)

    def __repr__(self) -> str:
        return f"<RunningWalk of {len(self.schedule.steps)} steps from {self.times[0]:.2f} s>"

    @property
    def planner(self) -> WalkPlanner:
        """The settings that it was planned by."""
        return self._planner

    @property
    def schedule(self) -> Schedule:
        """The footsteps and their times."""
        return self._schedule

    @property
    def computed_until(self) -> float:
        """The time [s] up to which all is worked out, and the tick after it."""
        return float(self.times[-1] if self._done == len(self.times) else self.times[max(self._done - 2, 0)])

    def ensure(self, tick: int) -> None:
        """Work out all up to a tick, counted from the beginning of this walk, and the one after it.

        It has been set off on already, so what fails its checks only there goes on, and the log tells of it.
        """
        if self._done >= min(tick + 2, len(self.times)):
            return
        with self._planner.working:
            while self._done < min(tick + 2, len(self.times)):
                try:
                    self._work_out(self._done + CHUNK)
                except WalkError as error:
                    logger.warning("the robot comes to rest otherwise than it safely can: %s", error)

    def states_at(self, tick: int) -> States:
        """Return the states of both passes of preview control at a tick, counted from the first."""
        self.ensure(tick)
        (first, sums), (second, more) = self._first, self._second
        return (first[tick], sums[tick]), (second[tick], more[tick])

    # Inside

    def _work_out(self, until: int) -> None:
        """Work out the ticks before ``until``, and check them."""
        n, done = len(self.times), self._done
        until = min(until, n)
        self._find(min(until, n - 1))
        low, high = max(done - 1, 0), min(until + 1, n)
        velocities, accelerations = motion_of(self.model, self.configurations[low:high], TICK)
        own = slice(max(done, 1), min(until, n - 1))  # both ends are known
        self.velocities[own], self.accelerations[own] = (
            part[own.start - low : own.stop - low] for part in (velocities, accelerations)
        )
        self._done = until
        part = slice(done, until)
        motion = (self.configurations[part], self.velocities[part], self.accelerations[part])
        planner, wanted = self.planner, self._wanted
        reaction = zero_moments(self.model, planner.legs.data, motion, planner.floor)
        there = Timeline(self.begin + done, wanted.support[part], wanted.feet[part], wanted.point[part])
        measures = measure_walk(planner.robot, self.model, motion, reaction, there, TICK, planner.look_for_collisions)
        check_measures(measures, planner.margin)

    def _find_near(self, tick: int) -> None:
        """Find the first pass up to a tick, and what its zero moment points miss."""
        n, done = len(self.times), self._computed
        while self._near.count <= min(tick, n - 1):
            self._near.step()
        computed = n if self._near.count == n else self._near.count - 1
        if computed == done:
            return
        low, high = max(done - 1, 0), min(computed + 1, n)
        q = self._near.found[low:high]
        motion = (q, *motion_of(self.model, q, TICK))
        points = zero_moments(self.model, self.planner.legs.data, motion, self.planner.floor)[0]
        self._missed[done:computed] = self._wanted.point[done:computed] - points[done - low : computed - low]
        if done == 0:
            self._missed[0] = self._missed[1]  # accelerations at the ends are not known
        if computed == n:
            self._missed[n - 1 :] = self._missed[n - 2]
        self._computed = computed

    def _find(self, tick: int) -> None:
        """Find the second pass up to a tick."""
        gains, (states, sums) = self.planner.control.preview_gains, self._second
        self._find_near(tick + len(gains) + 1)
        while self._found.count <= tick:
            k = self._found.count
            if k > 0:
                preview = gains @ self._missed[k : k + len(gains)]
                states[k], sums[k] = self.planner.control.step(states[k - 1], sums[k - 1], self._missed[k - 1], preview)
            self._targets.centre[k, :2] += self._free[k] * states[k, 0]
            self._found.step()


def set_off(planner: WalkPlanner, velocity: np.ndarray) -> RunningWalk:
    """Return the walk at a velocity (3,) [m/s, m/s, rad/s] from standing.

    Raises:
        WalkError: the robot cannot walk so.
        InvalidInputError: it is faster than the stride allows.
    """
    feet = planner.feet[:, [0, 1, 3]]
    steps = steps_at(velocity, feet, planner.stride)
    return RunningWalk(planner, planner.standing(steps), 0, planner.start, planner.standing_states())


def landing_after(walk: TimedMotion, tick: float) -> int | None:
    """Return the tick of the first landing of a walk after another tick; None where there is none."""
    own = walk.schedule
    return next((at for k in range(len(own.steps)) if (at := own.landing(k)) > tick), None)


def run_on(walk: TimedMotion, at: int, velocity: np.ndarray) -> RunningWalk:
    """Return the walk that goes on at a velocity (3,) [m/s, m/s, rad/s] from a landing (tick) of another.

    Raises:
        WalkError: the robot cannot walk so.
        InvalidInputError: it is faster than the stride allows.
    """
    planner = walk.planner
    assert isinstance(planner, WalkPlanner)
    k = at - round(float(walk.times[0]) / TICK)
    with planner.working:
        return _run_on(planner, walk, k, at, velocity)


def _run_on(planner: WalkPlanner, walk: TimedMotion, k: int, at: int, velocity: np.ndarray) -> RunningWalk:
    schedule, states = walk.schedule, walk.states_at(k)
    landed = next(k for k in range(len(schedule.steps)) if schedule.landing(k) == at) + 1
    after = schedule.at(landed)
    last = schedule.steps[landed - 1].foot
    steps = steps_at(velocity, after.feet[:, [0, 1, 3]], planner.stride, last)
    moving = walk.velocities[k], walk.accelerations[k]
    return RunningWalk(planner, after.with_steps(steps), at, walk.configurations[k], states, moving)


def steps_at(
    velocity: np.ndarray, feet: np.ndarray, stride: Stride, last: int | None = None, count: int = AHEAD
) -> tuple[Footstep, ...]:
    """Return the next steps at a velocity, and the one that closes the stance after them.

    Feet alternate. Both go ahead; aside and in turns only the foot on that side goes, as far as two steps take, and the
    other closes up. Where the robot is between steps follows from the foot that landed last.

    Args:
        velocity: (3,) ahead, to the left [m/s], counterclockwise [rad/s].
        feet: (2, 3) where the feet stand.
        stride: How the robot walks.
        last: The foot that landed last; None where the robot stands.
        count: Steps before the closing one; at no velocity the closing one is all.

    Raises:
        InvalidInputError: the velocity is faster than the stride allows.
    """
    steps_of_velocity(velocity, stride.step_time, stride)
    opening = velocity[1] / stride.side_step + velocity[2] / stride.turn_step
    leading = LEFT if opening >= 0.0 else RIGHT
    if last is None:
        body, foot = middle_of(feet), leading
    else:
        body, foot = moved(feet[last], np.array([0.0, -_offset(last, stride), 0.0])), 1 - last
    steps = []
    for k in range((count if velocity.any() else 0) + 1):
        if k < count and velocity.any():
            share = np.array([1.0, 2.0, 2.0]) if foot == leading else np.array([1.0, 0.0, 0.0])
            body = moved(body, screw(velocity * stride.step_time * share))
        place = moved(body, np.array([0.0, _offset(foot, stride), 0.0]))
        steps.append(Footstep(foot, *(float(part) for part in place)))
        foot = 1 - foot
    return tuple(steps)


def _offset(foot: int, stride: Stride) -> float:
    return 0.5 * stride.stance * (1.0 if foot == LEFT else -1.0)
