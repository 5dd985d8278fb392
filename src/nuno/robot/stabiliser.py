"""Stabiliser: the aims of a robot on its feet: the motion that is wanted, on its true footing, or a step."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.robot.aims import Aims, FootAim
from nuno.robot.capture_step import BEYOND, CaptureStep, Pendulum, carried_on, lifted, nearest_in, outside
from nuno.robot.carried import Carried
from nuno.robot.footing import FIRM, STANDS, Footing, Soles, found_footing
from nuno.robot.pinocchio import pin
from nuno.robot.robot_state import RobotState
from nuno.robot.sensors import sole_corners
from nuno.robot.support import convex_outline

if TYPE_CHECKING:
    from nuno.robot.robot import Robot

WORLD_AXES = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
MOVES = 1e-3
"""[m/s, rad/s] Slower than this a foot is wanted at rest."""
DT = 1e-3
"""[s] Of differences of a foot's way."""
FRAMES = 2
"""Frames one after the other in which a robot must be out of balance before it makes a step."""
INSIDE = 0.01
"""[m] By which the capture point is to be inside the soles' outline after a step, or another one follows."""
MIN_SHARE = 0.4
"""Share of the soles' outline that the centre of mass of a robot and its load stays in, standing."""
LIFTED = 3e-3
"""[m] How far above the other a sole may be that bears nothing, and still stands."""
MAX_STEPS = 8
"""That it makes for one push."""


class Stabiliser:
    """The aims of a robot on its feet, and its steps where it is pushed.

    Args:
        robot: The robot.
        gravity: (3,) [m/s2].

    Attributes:
        gravity: [m/s2].
    """

    def __init__(self, robot: Robot, gravity: Any) -> None:
        self._model = robot.model
        self._data, self._wanted = robot.model.createData(), robot.model.createData()
        self._feet = [robot.frame_index(foot) for foot in robot.description.feet]
        self._outlines = [sole_corners(robot.description.frames[foot])[[0, 2, 3, 1]] for foot in robot.description.feet]
        self.gravity = float(np.linalg.norm(gravity))
        self._mass, self._weight = robot.mass, robot.mass * self.gravity
        pin.framesForwardKinematics(robot.model, self._wanted, robot.posture_configuration())
        places = [self._wanted.oMf[foot].translation.copy() for foot in self._feet]
        self._stance = float(np.linalg.norm(places[0] - places[-1]))

    def aims(self, now: RobotState, wanted: RobotState, time: float) -> Aims:
        """Return what the whole-body control is to bring about until a time [s]."""
        model, ref, footing = self._model, self._wanted, now.footing
        pin.centerOfMass(model, ref, wanted.q, wanted.v, wanted.a)
        pin.forwardKinematics(model, ref, wanted.q, wanted.v, wanted.a)
        pin.updateFramePlacements(model, ref)
        centre = np.array([ref.com[0], ref.vcom[0], ref.acom[0]])
        if footing is None:
            footing = found_footing(None, self._soles_of(None, wanted), self._weight, 0.0)
        centre[0] += footing.centre
        feet = []
        for k, frame in enumerate(self._feet):
            place = pin.SE3(
                pin.exp3(footing.tilts[k]) @ ref.oMf[frame].rotation, ref.oMf[frame].translation + footing.offsets[k]
            )
            speed = pin.getFrameVelocity(model, ref, frame, WORLD_AXES).vector
            acceleration = pin.getFrameClassicalAcceleration(model, ref, frame, WORLD_AXES).vector
            is_late = not footing.bears[k] and not np.abs(speed).max() > MOVES
            feet.append(FootAim(place, np.array(speed), np.array(acceleration), footing.bears[k], is_late))
        aims = Aims(centre, wanted.q, wanted.v, wanted.a, tuple(feet))
        return aims if footing.step is None else self._stepping(now, aims, footing.step, time)

    def _stepping(self, now: RobotState, aims: Aims, step: CaptureStep, time: float) -> Aims:
        """Return the aims of a robot that makes a step to catch itself."""
        pendulum, centre = self._pendulum(now.q, now.v)
        other = 1 - step.foot
        ground = pendulum.feet[other, 2]
        goal = np.zeros((3, 3))
        goal[0] = *pendulum.feet[:, :2].mean(axis=0), pendulum.feet[:, 2].mean() + step.height
        feet = list(aims.feet)
        if step.landed is None:
            point = nearest_in(pendulum.inner(other), pendulum.point)
            goal[0, 2] = ground + step.height
            goal[2, :2] = pendulum.rate**2 * (centre[:2] - point)
            ahead = time + DT * np.array([0.0, -1.0, 1.0])
            here, before, after = (step.pose(own, ground) for own in ahead)
            swing, pushes = (after - before) / (2.0 * DT), (after - 2.0 * here + before) / DT**2
            feet[step.foot] = FootAim(
                _placed(here), np.array([*swing[:3], 0.0, 0.0, swing[3]]), np.array([*pushes[:3], 0.0, 0.0, pushes[3]]),
                False, step.share(time) > 1.0,
            )  # fmt: skip
            feet[other] = FootAim(_placed(pendulum.feet[other]), np.zeros(6), np.zeros(6), True)
        else:
            feet = [
                FootAim(_placed(own), np.zeros(6), np.zeros(6), bears, True)
                for own, bears in zip(pendulum.feet, now.footing.bears if now.footing else (True, True), strict=True)
            ]
        v, a = aims.v.copy(), aims.a.copy()
        v[:6] = a[:6] = 0.0
        return Aims(goal, aims.q, v, a, tuple(feet), step.landed is None)

    def footing(
        self, before: RobotState, wanted: RobotState, q: np.ndarray, v: np.ndarray, pressed: np.ndarray, time: float,
        load: Carried | None = None,
    ) -> Footing:  # fmt: skip
        """Return the footing at the end of a frame, with the step that the robot begins or goes on with."""
        was, span = before.footing, time - before.time
        if was is not None and was.step is not None and was.step.is_finished:
            was = None  # what is wanted begins anew from where the robot stands
        soles = self._soles_of((q, pressed), wanted)
        footing = found_footing(was, soles, self._weight, span, self._lean(q, wanted, soles, load))
        if len(self._feet) != 2 or was is None:
            return footing
        pendulum, _ = self._pendulum(q, v, load)
        touches = tuple(bool(force > FIRM * self._weight) for force in pressed)
        step = was.step
        if step is not None:
            ground = pendulum.feet[:, 2].min() + LIFTED
            still = [stood and foot[2] < ground for stood, foot in zip(was.bears, pendulum.feet, strict=True)]
            stands = tuple(bool(a or b) for a, b in zip(touches, still, strict=True))
            footing = replace(was, bears=stands, frames=was.frames)
            step = carried_on(step, pendulum, touches[step.foot], time)
            if step.landed is None:
                return replace(footing, step=step)
        model, ref = self._model, self._wanted
        point = pendulum.point
        if step is None:
            pin.centerOfMass(model, ref, wanted.q, wanted.v, wanted.a)
            # what keeps the capture point as far from where it is wanted as it is; at rest that is the point itself
            point = point - ref.vcom[0][:2] / pendulum.rate - ref.acom[0][:2] / pendulum.rate**2
        bearing = [k for k in (0, 1) if footing.bears[k] or (step is None and _is_planned(soles, k))]
        if not bearing:
            return replace(footing, step=step)
        outline = convex_outline(np.concatenate([pendulum.outlines[k] for k in bearing]))
        frames = was.frames + 1 if outside(outline, point, BEYOND if step is None else -INSIDE) else 0
        if frames >= FRAMES and (step is None or step.count < MAX_STEPS):
            bears = footing.bears if step is None else tuple(True for _ in self._feet)
            found = lifted(pendulum, bears, time, 1 if step is None else step.count + 1)
            step, frames = found or step, 0
        return replace(footing, step=step, frames=frames)

    def ground(self, q: np.ndarray) -> float:
        """Return the height of the lowest sole in a configuration [m]."""
        pin.framesForwardKinematics(self._model, self._wanted, q)
        return float(min(self._wanted.oMf[foot].translation[2] for foot in self._feet))

    def _pendulum(self, q: np.ndarray, v: np.ndarray, load: Carried | None = None) -> tuple[Pendulum, np.ndarray]:
        """Return the robot as a pendulum, and the place of its centre of mass."""
        model, data = self._model, self._data
        pin.centerOfMass(model, data, q, v)
        pin.updateFramePlacements(model, data)
        centre, speed = np.array(data.com[0]), np.array(data.vcom[0])
        if load is not None:
            centre += load.mass / (load.mass + self._mass) * (load.place - centre)
        places = [data.oMf[foot] for foot in self._feet]
        feet = np.array([[*own.translation, np.arctan2(own.rotation[1, 0], own.rotation[0, 0])] for own in places])
        height = max(float(centre[2] - feet[:, 2].mean()), 0.1)
        rate = float(np.sqrt(self.gravity / height))
        outlines = [
            corners @ own.rotation[:2].T + own.translation[:2]
            for corners, own in zip(self._outlines, places, strict=True)
        ]
        point = centre[:2] + speed[:2] / rate
        pendulum = Pendulum(point, speed[:2], rate, height, feet, tuple(outlines), self._stance)  # type: ignore[arg-type]
        return pendulum, centre

    def _lean(self, q: np.ndarray, wanted: RobotState, soles: Soles, load: Carried | None) -> np.ndarray:
        """Return by how much (3,) [m] a robot that stands leans back from its load, so that both are over its soles.

        A walk was planned with its load.
        """
        if load is None or np.abs(wanted.v[:6]).max() > 0.0:
            return np.zeros(3)
        there = np.array(pin.centerOfMass(self._model, self._wanted, wanted.q))[:2]
        now = np.array(pin.centerOfMass(self._model, self._data, q))[:2]
        both = there + load.mass / (load.mass + self._mass) * (load.place[:2] - now)
        corners = [
            own @ place.rotation[:2].T + place.translation[:2]
            for own, place in zip(self._outlines, soles.wanted, strict=True)
        ]
        outline = convex_outline(np.concatenate(corners))
        middle = outline.mean(axis=0)
        back = (nearest_in(middle + MIN_SHARE * (outline - middle), both) - both) * (1.0 + load.mass / self._mass)
        return np.array([*back, 0.0])

    def _soles_of(self, actual: tuple[np.ndarray, np.ndarray] | None, wanted: RobotState) -> Soles:
        """Return the soles in a configuration, with what they press, and as they are wanted."""
        model, ref, data = self._model, self._wanted, self._data
        pin.forwardKinematics(model, ref, wanted.q, wanted.v)
        pin.updateFramePlacements(model, ref)
        sinking = np.array([pin.getFrameVelocity(model, ref, foot, WORLD_AXES).linear[2] for foot in self._feet])
        there = [ref.oMf[foot].copy() for foot in self._feet]
        if actual is None:
            return Soles(there, there, sinking, None)
        pin.framesForwardKinematics(model, data, actual[0])
        return Soles([data.oMf[foot].copy() for foot in self._feet], there, sinking, actual[1])


def _is_planned(soles: Soles, k: int) -> bool:
    return bool(soles.wanted[k].translation[2] < min(own.translation[2] for own in soles.wanted) + STANDS)


def _placed(pose: np.ndarray) -> Any:
    return pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.0, float(pose[3])), pose[:3].copy())
