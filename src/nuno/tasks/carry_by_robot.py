"""Carrying a mat by a whole robot: one that stands on its own feet and motors, or one that goes where it is sent."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.bodies.body import Body
from nuno.bodies.make_bodies import plane
from nuno.shapes import quaternion as quat
from nuno.shapes.compound import Compound
from nuno.shapes.shape import Hull
from nuno.tasks.arm_tracks import FRAME_RATE
from nuno.tasks.carry_trials import CALM, EVERY, CarryPlan, judge, laid_places
from nuno.world.world import World

if TYPE_CHECKING:
    from nuno.robot.humanoid import Humanoid
    from nuno.robot.simulated_robot import SimulatedRobot

HANDS = ("left_hand", "right_hand")
FULL_FOR = 0.1
"""[s] For which a motor must give all that it can, for that to be a failure: longer than the blow of a landing foot."""


@dataclass(frozen=True)
class CarryByRobot:
    """The outcome of one trial with a whole robot.

    Attributes:
        value: F [m s], of the true base; NaN where the trial failed.
        failed_at: [s] from the start of the walk, NaN where it did not.
        reason: How it failed; "" where it did not.
        base_error: [m], how far the base is at the end from where the walk was planned to end; NaN where it failed.
    """

    value: float
    failed_at: float
    reason: str
    base_error: float


def carry_by_robot(
    robot: Humanoid, plan: CarryPlan, walk: int, offset: np.ndarray, *, dynamics: bool,
    goal: tuple[float, float, float], watch: Callable[[SimulatedRobot, Body, float], None] | None = None,
) -> CarryByRobot:  # fmt: skip
    """Let a robot carry a mat, and end the trial where it fails.

    The mat lies on the robot's own links, each the hulls of its collision shapes; ``carry`` has one hull a hand, and
    arms that are led. The trial fails as there, and, with dynamics, also when the robot falls or a motor gives all
    that it can for ``FULL_FOR``.

    Args:
        robot: The robot, which is left as it was.
        plan: What trials have in common; of its tracks only the stance that they begin in is used.
        walk: Which of the plan's stances it takes.
        offset: (2,) [m], from the mat's centre of gravity to the middle between the hands, ahead and to the left.
        dynamics: Whether the robot has weight.
        goal: Where it walks: ahead and to the left [m], turned by [rad].
        watch: Called with the robot, the mat and the time [s] from the start of the walk, after each frame.
    """
    from nuno.robot.simulated_robot import SimulatedRobot

    carrier = robot.copy()
    carrier.take_configuration(plan.configurations[walk, 0])
    world = World(device="cpu", frame_rate=FRAME_RATE)
    world.add(plane(name="floor"))
    driver = SimulatedRobot(carrier, world, links=carrier.enter(world, "joints"), dynamics=dynamics)
    for body in (body for arm in _arms(driver) for body in arm):
        if dynamics:
            assert body.material is not None
            world.set_material(body, replace(body.material, friction=plan.friction))  # type: ignore[call-arg]
        else:
            body.friction = plan.friction
    mat = _laid(world, plan, walk, offset)
    measure = _Measure(driver, mat, plan)
    measure.look()
    begin = round(plan.settle * FRAME_RATE)
    for frame in range(plan.frames):
        if frame == begin:
            world.set_material(mat, plan.material)
            driver.go_pos(goal[0], goal[1], goal[2], wait=False)
        driver.sleep(1.0 / FRAME_RATE)
        measure.look()
        if watch is not None:
            watch(driver, mat, (frame + 1) / FRAME_RATE - plan.settle)
        if (frame + 1) % EVERY == 0 and (failed := measure.failure()):
            return CarryByRobot(np.nan, failed[0], failed[1], np.nan)
    outcome = measure.judged()
    apart = measure.base[-1] - plan.base[walk, -1]
    return CarryByRobot(float(outcome.value[0]), np.nan, "", float(np.linalg.norm(apart)))


class _Measure:
    """Measurements of a trial, frame by frame."""

    def __init__(self, driver: SimulatedRobot, mat: Body, plan: CarryPlan) -> None:
        self.driver, self.mat, self.plan = driver, mat, plan
        self.base: list[np.ndarray] = []
        self._middle: list[np.ndarray] = []
        self._gaps: list[list[float]] = []
        self._full = np.zeros(len(driver.actual.joint_names), dtype=int)
        self._robot_failed: tuple[float, str] | None = None
        self._arms = _arms(driver)

    def look(self) -> None:
        """See the present state."""
        vertices, state = self.mat.vertices, self.driver.state()
        if len(self._middle) % EVERY == 0:
            self._gaps.append([_gap(bodies, vertices) for bodies in self._arms])
        self._middle.append(vertices.mean(axis=0))
        self.base.append(state.q[:3].copy())
        if self._robot_failed is not None:
            return
        time = (len(self.base) - 1) / FRAME_RATE - self.plan.settle
        names = self.driver.actual.joint_names
        full = np.array([name in state.over_torque for name in names])
        self._full = np.where(full, self._full + 1, 0)
        if state.fallen is not None:
            self._robot_failed = (time, f"the robot fell: {state.fallen}")
        elif self._full.max(initial=0) >= round(FULL_FOR * FRAME_RATE):
            name = names[int(self._full.argmax())]
            self._robot_failed = (time, f"{name} gave all that it can for {FULL_FOR:g} s")

    def judged(self) -> Any:
        """Return the outcome so far, as of trials whose arms are led."""
        base = np.repeat(np.array(self.base), 2, axis=0)[None]
        own = replace(self.plan, base=base)
        return judge(own, np.zeros(1, dtype=int), np.array(self._middle)[:, None], np.array(self._gaps)[:, None])

    def failure(self) -> tuple[float, str] | None:
        """Return when [s] from the start of the walk the trial failed first, and how; None where it has not."""
        found = [] if self._robot_failed is None else [self._robot_failed]
        begun = len(self.base) > round(self.plan.settle * FRAME_RATE) + 1
        outcome = self.judged() if begun else None
        if outcome is not None and outcome.reason[0]:
            found.append((float(outcome.failed_at[0]), outcome.reason[0]))
        return min(found, default=None)


def _laid(world: World, plan: CarryPlan, walk: int, offset: np.ndarray) -> Body:
    """Put the mat just above the arms, with dynamics from now on."""
    turn = quat.from_axis_angle(np.array([0.0, 0.0, 1.0]), np.array(0.5 * np.pi)) if plan.turned else quat.IDENTITY
    mat = world.add(Body(plan.mat, name="mat", quaternion=turn))
    mat.locate(laid_places(plan, np.array([walk]), np.asarray(offset, dtype=float)[None])[0])
    world.ignore_contact(mat, mat)
    world.attach(mat, replace(plan.material, air_drag=CALM))  # type: ignore[call-arg]
    return mat


def _arms(driver: SimulatedRobot) -> list[list[Body]]:
    """Return the links of the left and of the right arm, without those that carry both."""
    robot, links = driver.actual, driver.links
    chains = [set(robot.model.supports[robot.model.frames[robot.frame_index(hand)].parentJoint]) for hand in HANDS]
    arms: list[list[Body]] = []
    for own, other in (chains, chains[::-1]):
        first = min(own - other)
        bodies = zip(links.bodies, links.joints, strict=True)
        arms.append([body for body, joint in bodies if first in robot.model.supports[joint]])
    return arms


def _gap(bodies: list[Body], vertices: np.ndarray) -> float:
    """Return how far [m] the nearest of vertices (n, 3) is from bodies' hulls, by their planes; 0 inside."""
    nearest = np.inf
    for body in bodies:
        if not isinstance(body.shape, Compound):
            continue
        position, quaternion = body.pose()
        local = quat.rotate(quat.inverse(quaternion), vertices - position)
        for shape, place, turn in body.shape.parts:
            if isinstance(shape, Hull):
                planes = shape.planes
                there = quat.rotate(quat.inverse(np.array(turn)), local - np.array(place))
                nearest = min(nearest, float((there @ planes[:, :3].T - planes[:, 3]).max(axis=1).min()))
    return max(nearest, 0.0)
