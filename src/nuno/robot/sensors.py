"""Sensors: what a simulated robot's encoders, inertial unit, force sensors and soles tell at a tick."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin

from nuno import quaternion as quat
from nuno.errors import InvalidInputError, UnknownNameError
from nuno.robot.ground import Soles, lowest_corners, moment, zero_moment_point
from nuno.robot.imu import read_imu
from nuno.robot.loads import LinkLoads, Load
from nuno.robot.sensor_model import Channel, SensorModel
from nuno.robot.state import RobotState
from nuno.robot.wrenches import WrenchSensor
from nuno.validation import number

if TYPE_CHECKING:
    from nuno.robot.humanoid import Humanoid
    from nuno.robot.links import Links

WRENCHES = ("left_wrist", "right_wrist", "left_ankle", "right_ankle")
"""The frames of a description that have 6-axis sensors."""
LIFTED = 5e-3
"""[m] How far above the ground the lowest corner of a sole is when its foot no longer stands."""
CONTACT = 0.02
"""Share of the robot's weight with which a foot presses on the ground at least when it is said to touch."""


@dataclass(frozen=True, eq=False)
class Readings:
    """What all sensors tell at one time; each is what it was when its last sample was taken.

    Attributes:
        time: [s], of the world, when they were read.
        positions: (n,) float [rad; m for slides], of the joints in the order of ``joint_names``.
        velocities: (n,) float [rad/s; m/s].
        torques: (n,) float [N m; N], of the motors.
        orientation: (4,) float, (w, x, y, z), of the inertial unit in the world.
        angular_velocity: (3,) float [rad/s], in the unit's own axes.
        specific_force: (3,) float [m/s2], likewise: acceleration less gravity, upwards at rest.
        wrenches: By sensor ("left_wrist", "right_ankle" ...), force and torque (6,) float [N, N m] of what is beyond
            the sensor on what is before it, in the sensor's axes and about its origin.
        contacts: By foot, whether it presses on the ground.
        zero_moment_point: (2,) float [m] on the ground, NaN where nothing presses on it.
        sampled: By channel ("positions", "left_wrist" ...), when its sample was taken [s].
    """

    time: float
    positions: np.ndarray
    velocities: np.ndarray
    torques: np.ndarray
    orientation: np.ndarray
    angular_velocity: np.ndarray
    specific_force: np.ndarray
    wrenches: Mapping[str, np.ndarray]
    contacts: Mapping[str, bool]
    zero_moment_point: np.ndarray
    sampled: Mapping[str, float]


class Sensors:
    """All sensors of a simulated robot.

    The motion is given, and the forces follow from it by inverse dynamics, with what the bodies of the world do to the
    links. Feet that stand share what the ground must do (``nuno.robot.ground``); where none stands, the base is held.

    Args:
        robot: The robot; its description tells the frames of the sensors.
        links: The robot's links in a world, whose bodies then bear on it; None is a robot without a world.
        models: By channel, how it departs from the truth: "positions", "velocities", "torques", "orientation" (noise
            and bias as turns about the unit's axes [rad]), "angular_velocity", "specific_force", "zero_moment_point"
            [m], "contacts" (noise and bias as forces [N]), and the names of the wrenches. Others are exact.
        ground: Height of the ground [m].
        seed: Of all noise; the same one gives the same readings.

    Raises:
        UnknownNameError: a model for a channel that there is not.
        InvalidInputError: a model that does not fit its channel, or links of another robot.
    """

    def __init__(
        self, robot: Humanoid, links: Links | None = None, *, models: Mapping[str, SensorModel] | None = None,
        ground: float = 0.0, seed: int = 0,
    ) -> None:  # fmt: skip
        if links is not None and links.robot.model is not robot.model:
            raise InvalidInputError(f"the links are those of another robot, {links.robot.name!r}")
        self.robot, self.links = robot, links
        self.ground = number("ground", ground)
        self._model = robot.model.copy()
        if links is not None:
            self._model.gravity.linear = np.array(links.world.gravity)
        self._data = self._model.createData()
        self._external = pin.StdVec_Force()
        for _ in range(self._model.njoints):
            self._external.append(pin.Force.Zero())
        self._stood: Soles | None = None  # the feet that stood last, most often where they stand now
        self._borne: set[int] = set()  # joints on which something acts
        frames = robot.description.frames
        self._wrenches = {name: WrenchSensor(robot, name) for name in WRENCHES if name in frames}
        self._feels = {name: self._felt_links(sensor) for name, sensor in self._wrenches.items()}
        self._loads = None if links is None else LinkLoads(links, self._groups())
        self._imu = robot.frame_index("imu") if "imu" in frames else None
        self._feet = tuple(robot.description.feet)
        self._soles = np.array([_corners(frames[foot]) for foot in self._feet]).reshape(-1, 4, 3)
        self._foot_frames = [robot.frame_index(foot) for foot in self._feet]
        self._foot_joints = [int(robot.model.frames[frame].parentJoint) for frame in self._foot_frames]
        self._weight = robot.mass * float(np.linalg.norm(self._model.gravity.linear))
        self._channels = self._make_channels(dict(models or {}), seed)

    @property
    def channels(self) -> tuple[str, ...]:
        """The names that ``models`` may have."""
        return tuple(self._channels)

    def read(self, state: RobotState | None = None, stance: Sequence[str] | None = None) -> Readings:
        """Return what all sensors tell.

        Args:
            state: How the robot moves, at the time that the world has now; None is at rest where it is.
            stance: The feet that stand; None are those whose soles are on the ground.

        Raises:
            UnknownNameError: a foot that the robot has not.
            InvalidInputError: a state of another robot.
        """
        state = self.state_at_rest() if state is None else state
        model, data = self._model, self._data
        if state.q.shape != (model.nq,) or state.v.shape != (model.nv,) or state.a.shape != (model.nv,):
            raise InvalidInputError(
                f"a state of {self.robot.name!r} has q ({model.nq},), v and a ({model.nv},), got "
                f"{state.q.shape}, {state.v.shape}, {state.a.shape}"
            )
        pin.forwardKinematics(model, data, state.q, state.v, state.a)
        loads = () if self._loads is None else self._loads.read()
        beyond = self._bear(loads)
        torques = pin.rnea(model, data, state.q, state.v, state.a, self._external)
        point, pressed = np.full(2, np.nan), dict.fromkeys(self._feet, 0.0)
        standing = self._standing(stance)
        if standing:
            point, pressed = self._stand(standing, beyond)
            torques = pin.rnea(model, data, state.q, state.v, state.a, self._external)
        read = {"positions": self._angles(state.q), "velocities": state.v[6:].copy(), "torques": torques[6:].copy()}
        turn = quat.IDENTITY
        if self._imu is not None:
            turn, spin, specific = read_imu(model, data, self._imu)
            read |= {"orientation": np.zeros(3), "angular_velocity": spin, "specific_force": specific}
        for name, sensor in self._wrenches.items():
            read[name] = sensor.read(data, beyond[name])
        read["zero_moment_point"] = point
        read["contacts"] = np.array(list(pressed.values()))
        return self._told(state.time, read, turn)

    def state_at_rest(self) -> RobotState:
        """Return the state of the robot at rest where it is now, at the world's time."""
        nothing = np.zeros(self._model.nv)
        time = 0.0 if self.links is None else self.links.world.time
        return RobotState(time, self.robot.configuration(), nothing, nothing)

    # -- forces

    def _bear(self, loads: Sequence[Load]) -> dict[str, Any]:
        """Set what acts on each joint from outside, and return what of that each wrench sensor has beyond it."""
        for j in self._borne:
            self._external[j] = pin.Force.Zero()
        self._borne.clear()
        beyond = {name: pin.Force.Zero() for name in self._wrenches}
        for load in loads:
            assert self.links is not None
            joint = self.links.joint_of(load.link)
            acting = self._in_joint(joint, load.point, load.force, load.torque)
            self._external[joint] += acting
            self._borne.add(joint)
            for name, sensor in self._wrenches.items():
                if sensor.joint == joint and self._feels[name][load.link]:
                    beyond[name] += acting
        return beyond

    def _in_joint(self, joint: int, point: np.ndarray, force: np.ndarray, torque: np.ndarray) -> Any:
        """Return a force at a point of the world as Pinocchio has it in a joint's frame."""
        placement = self._data.oMi[joint]
        return placement.actInv(pin.Force(force, torque + moment(point, force)))

    def _standing(self, stance: Sequence[str] | None) -> list[int]:
        """The numbers of the feet that stand."""
        if not self._feet:
            return []
        self._corners = np.empty_like(self._soles)
        for k, frame in enumerate(self._foot_frames):
            placement = pin.updateFramePlacement(self._model, self._data, frame)
            self._corners[k] = self._soles[k] @ placement.rotation.T + placement.translation
        if stance is None:
            return np.flatnonzero(lowest_corners(self._corners) < self.ground + LIFTED).tolist()
        for foot in stance:
            if foot not in self._feet:
                raise UnknownNameError("foot", str(foot), list(self._feet))
        return [k for k, foot in enumerate(self._feet) if foot in stance]

    def _stand(self, standing: list[int], beyond: dict[str, Any]) -> tuple[np.ndarray, dict[str, float]]:
        """Add what the ground does to the feet; return the zero moment point and how hard each foot presses [N]."""
        needed = self._data.oMi[1].act(self._data.f[1])
        force, torque = np.array(needed.linear), np.array(needed.angular)
        corners = self._corners[standing]
        if self._stood is None or not np.array_equal(self._stood.corners, corners):
            self._stood = Soles(corners)
        forces, torques = self._stood.share(force, torque)
        pressed = dict.fromkeys(self._feet, 0.0)
        for k, own_force, own_torque, middle in zip(standing, forces, torques, self._stood.middles, strict=True):
            joint = self._foot_joints[k]
            acting = self._in_joint(joint, middle, own_force, own_torque)
            self._external[joint] += acting
            self._borne.add(joint)
            for name, sensor in self._wrenches.items():
                if sensor.joint == joint:
                    beyond[name] += acting
            pressed[self._feet[k]] = float(own_force[2])
        return zero_moment_point(force, torque, self.ground), pressed

    def _felt_links(self, sensor: WrenchSensor) -> list[bool]:
        """Which of the bodies in the world are links beyond a sensor, of those that its joint carries."""
        if self.links is None:
            return []
        return [sensor.feels(link) for link in self.links.names]

    def _groups(self) -> list[str | int]:
        """For each of the bodies in the world, the wrench sensor beyond which its link is, or else its joint."""
        assert self.links is not None
        groups: list[str | int] = []
        for k, joint in enumerate(self.links._joints.tolist()):
            behind = [
                name
                for name, sensor in self._wrenches.items()
                if (self._feels[name][k] if joint == sensor.joint else sensor.carries(joint))
            ]
            groups.append(behind[0] if behind else joint)
        return groups

    # -- what becomes of it

    def _make_channels(self, models: dict[str, SensorModel], seed: int) -> dict[str, Channel]:
        n = len(self.robot.joint_names)
        sizes = {"positions": n, "velocities": n, "torques": n}
        if self._imu is not None:
            sizes |= {"orientation": 3, "angular_velocity": 3, "specific_force": 3}
        sizes |= dict.fromkeys(self._wrenches, 6)
        if self._feet:
            sizes |= {"zero_moment_point": 2, "contacts": len(self._feet)}
        for name in models:
            if name not in sizes:
                raise UnknownNameError("channel", name, list(sizes))
        exact = SensorModel()
        return {name: Channel(name, models.get(name, exact), size, seed) for name, size in sizes.items()}

    def _told(self, time: float, read: dict[str, np.ndarray], turn: np.ndarray) -> Readings:
        told: dict[str, Any] = {}
        sampled: dict[str, float] = {}
        for name, channel in self._channels.items():
            if name == "orientation":
                # the true turn goes along: what is told late is how it was turned then
                sampled[name], error = channel.read(time, _Turned(turn))
                told[name] = error.told()
            else:
                sampled[name], told[name] = channel.read(time, read[name])
        pressed = told.get("contacts", ())
        nothing = np.full(3, np.nan)
        return Readings(
            time, told["positions"], told["velocities"], told["torques"],
            told.get("orientation", np.full(4, np.nan)), told.get("angular_velocity", nothing),
            told.get("specific_force", nothing), {name: told[name] for name in self._wrenches},
            {foot: bool(force > CONTACT * self._weight) for foot, force in zip(self._feet, pressed, strict=True)},
            told.get("zero_moment_point", np.full(2, np.nan)), sampled,
        )  # fmt: skip

    def _angles(self, q: np.ndarray) -> np.ndarray:
        rows, free = self.robot._rows, self.robot._turns_freely
        angles = q[rows]
        if free.any():
            angles[free] = np.arctan2(q[rows[free] + 1], angles[free])
        return angles


class _Turned:
    """A turn, and errors about its own axes (3,) [rad] that are added to it."""

    def __init__(self, turn: np.ndarray, error: np.ndarray | None = None) -> None:
        self.turn, self.error = turn, error

    def __add__(self, error: np.ndarray) -> _Turned:
        return _Turned(self.turn, error if self.error is None else self.error + error)

    def told(self) -> np.ndarray:
        """Return the quaternion (4,), (w, x, y, z)."""
        if self.error is None:
            return self.turn
        angle = float(np.linalg.norm(np.broadcast_to(self.error, (3,))))
        if angle == 0.0:
            return self.turn
        return quat.multiply(self.turn, quat.from_axis_angle(self.error / angle, np.array(angle)))


def _corners(sole: Any) -> np.ndarray:
    """Return the corners (4, 3) [m] of a sole in its own frame."""
    half = np.zeros(2) if sole.size is None else 0.5 * sole.size
    return np.array([(sx * half[0], sy * half[1], 0.0) for sx in (-1.0, 1.0) for sy in (-1.0, 1.0)])
