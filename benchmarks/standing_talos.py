"""Talos on a floor under Nuno's balance, in Nuno and in another engine; for `robot_against_mujoco.py`."""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any

import numpy as np
import pinocchio as pin

import nuno
from nuno.robot.robot_state import RobotState

FRAME = 1.0 / 60.0
STEPS = 10
"""Of a frame, in all engines."""
HANDS = {"left": "arm_left_7_link", "right": "arm_right_7_link"}
"""Sides, and the links that hold."""


def in_links(robot: nuno.Humanoid) -> dict[str, np.ndarray]:
    """Return where the links hold loads, (3,) each in the link's frame [m]."""
    return {
        link: robot.frame_pose(link).to_local([robot.frame_pose(f"{side}_hand").position])[0]
        for side, link in HANDS.items()
    }


class InEngine:
    """Talos in another engine under Nuno's balance; what is wanted comes from a robot without dynamics.

    Args:
        engine: Makes it of the model, the step [s] and loads (mass [kg] and place in the world (3,) [m], by link).
        load: What each hand holds [kg].
    """

    def __init__(self, engine: Any, load: float) -> None:
        self.world = nuno.World(device="cpu", substeps=STEPS)
        self.model = robot = nuno.Humanoid("talos")
        links = robot.copy().enter(self.world, "joints")
        self.driver = nuno.SimulatedRobot(robot, self.world, links=links)
        places = {link: (load, robot.frame_pose(f"{side}_hand").position) for side, link in HANDS.items()}
        self.body = engine(robot, FRAME / STEPS, places if load else {})
        motors = self.driver.balance.dynamics
        self.body.limit(motors.efforts + motors.joint_friction)
        self.load, self.places = load, in_links(robot)
        q, v = self.body.read()
        self.now = RobotState(0.0, q, v, np.zeros(robot.model.nv), loads=self.loads(q))
        self.spent: list[float] = []
        self.control: list[float] = []

    def loads(self, q: np.ndarray) -> np.ndarray | None:
        """Return the weight of what the hands hold, as the balance takes it."""
        model = self.model.model
        if not self.load:
            return None
        found = np.zeros((model.njoints, 6))
        data = model.createData()
        pin.framesForwardKinematics(model, data, q)
        for link, place in self.places.items():
            frame, pose = model.frames[self.model.frame_index(link)], data.oMf[self.model.frame_index(link)]
            force = pose.rotation.T @ (0.0, 0.0, -9.81 * self.load)
            found[frame.parentJoint] += frame.placement.act(pin.Force(force, np.cross(place, force))).vector
        return found

    def load_place(self) -> np.ndarray:
        """Return where what the left hand holds is (3,) [m]."""
        return load_place(self.model, self.now.q, self.places)

    def step(self) -> None:
        """Go on by a frame."""
        self.world.step()
        begun = time.process_time()
        wanted = self.driver.state()
        self.body.drive(*self.driver.balance.command(self.now, wanted, FRAME, None))
        middle = time.process_time()
        self.body.advance(STEPS)
        self.spent.append(time.process_time() - middle)
        self.control.append(middle - begun)
        q, v = self.body.read()
        self.now = self.driver.balance.judge(
            self.now, wanted, q, v, self.body.torques(), self.world.time, self.loads(q)
        )


class InNuno:
    """Talos with dynamics in Nuno; boxes of 0.1 m are fixed to its hands."""

    def __init__(self, load: float) -> None:
        self.world = nuno.World(device="cpu", substeps=STEPS)
        self.world.add(nuno.plane(name="floor", friction=0.8))
        self.driver = nuno.SimulatedRobot(nuno.Humanoid("talos"), self.world, dynamics=True)
        self.model = self.driver.actual
        self.boxes = []
        links = self.driver.links
        for side, link in HANDS.items() if load else ():
            place = self.model.frame_pose(f"{side}_hand").position
            box = self.world.add(nuno.box((0.1, 0.1, 0.1), name=f"{side} load", position=place))
            self.world.attach(box, nuno.Rigid(mass=load))
            for other in links.bodies:
                self.world.ignore_contact(box, other)
            nuno.fixed_joint(box, links.bodies[links.names.index(link)])
            self.boxes.append(box)
        self.places = in_links(self.model)
        self.spent: list[float] = []
        self.control: list[float] = []
        for name in ("begin_frame", "end_frame"):
            setattr(self.driver, name, self._timed(getattr(self.driver, name)))

    @property
    def now(self) -> RobotState:
        """How it moves."""
        return self.driver.state()

    def load_place(self) -> np.ndarray:
        """Return where what the left hand holds is (3,) [m]."""
        return np.ravel(self.boxes[0].pose()[0]) if self.boxes else load_place(self.model, self.now.q, self.places)

    def step(self) -> None:
        """Go on by a frame."""
        self.control.append(0.0)
        begun = time.process_time()
        self.world.step()
        self.spent.append(time.process_time() - begun - self.control[-1])

    def _timed(self, call: Any) -> Any:
        def timed(*arguments: Any) -> None:
            begun = time.process_time()
            call(*arguments)
            self.control[-1] += time.process_time() - begun

        return timed


def load_place(model: nuno.Humanoid, q: np.ndarray, places: Mapping[str, np.ndarray]) -> np.ndarray:
    """Return where what the left hand holds is (3,) [m], by the robot's configuration."""
    data = model.model.createData()
    pin.framesForwardKinematics(model.model, data, q)
    pose = data.oMf[model.frame_index(HANDS["left"])]
    return np.asarray(pose.rotation @ places[HANDS["left"]] + pose.translation)
