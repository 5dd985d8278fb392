"""Sensors: what a simulated robot's encoders, inertial unit, force sensors and soles tell at a tick."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.errors import InvalidInputError, UnknownNameError
from nuno.robot.gravity import take_gravity
from nuno.robot.ground import Soles, lowest_corners, moment
from nuno.robot.imu import InertialUnit
from nuno.robot.loads import LinkLoads, Load
from nuno.robot.pinocchio import pin
from nuno.robot.robot_state import RobotState
from nuno.robot.sensor_model import Channel, SensorModel
from nuno.robot.spatial_arrays import placement_arrays, spatial_array
from nuno.robot.support import zero_moment_point
from nuno.robot.wrenches import WrenchSensor
from nuno.shapes import quaternion as quat
from nuno.validation import checked, number

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
    """Readings of all sensors at one time; each is what it was when its last sample was taken.

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

    Without dynamics the motion is given, and the forces follow from it by inverse dynamics, with what the bodies of the
    world do to the links. Feet that stand share what the ground must do (``nuno.robot.ground``); where none stands, the
    base is held. With dynamics, wrenches, contacts and zero moment point follow from what the joints bore in the last
    frame: whatever touches the robot wherever is in them. What a link before a wrist's sensor touches, of the joint
    that carries both, counts as touching beyond it.

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

    @checked
    def __init__(
        self, robot: Humanoid, links: Links | None = None, *, models: Mapping[str, SensorModel] | None = None,
        ground: float = 0.0, seed: int = 0,
    ) -> None:  # fmt: skip
        if links is not None and links.robot.model is not robot.model:
            raise InvalidInputError(f"the links are those of another robot, {links.robot.name!r}")
        self.robot, self.links = robot, links
        self.ground = number("ground", ground)
        self._model = robot.model.copy()
        self._world = None if links is None else links.world
        self._firmly = self._contact_force()
        self._data = self._model.createData()
        self._shapes = ((self._model.nq,), (self._model.nv,), (self._model.nv,))
        self._external = pin.StdVec_Force()
        for _ in range(self._model.njoints):
            self._external.append(pin.Force.Zero())
        self._acting = spatial_array(self._external)
        self._axes, self._places = placement_arrays(self._data.oMi)
        self._borne = spatial_array(self._data.f)
        self._lacking = self._data.f[1].vector  # at the base, after ``rnea``
        self._stood: Soles | None = None  # the feet that stood last, most often where they stand now
        frames = robot.description.frames
        self._wrenches = {name: WrenchSensor(robot, name, self._data) for name in WRENCHES if name in frames}
        self._feels = {name: self._felt_links(sensor) for name, sensor in self._wrenches.items()}
        self._loads = None if links is None else LinkLoads(links, self._groups())
        self._imu = InertialUnit(robot, "imu", self._data) if "imu" in frames else None
        self._feet = tuple(robot.description.feet)
        carried = [robot.model.frames[robot.frame_index(foot)] for foot in self._feet]
        self._foot_joints = np.array([frame.parentJoint for frame in carried], dtype=int)
        self._soles = np.zeros((len(self._feet), 4, 3))  # corners in the frames of the joints
        for k, (foot, frame) in enumerate(zip(self._feet, carried, strict=True)):
            placement = frame.placement
            self._soles[k] = sole_corners(frames[foot]) @ placement.rotation.T + placement.translation
        # forces and torques about the soles' middles, as they are about the origins of the joints
        middles = [pin.SE3(np.eye(3), sole.mean(axis=0)) for sole in self._soles]
        self._from_middles = np.array([own.toDualActionMatrix() for own in middles]).reshape(-1, 6, 6)
        self._channels = self._make_channels(dict(models or {}), seed)
        self._inexact = {name: channel for name, channel in self._channels.items() if not channel.is_exact}

    @property
    def channels(self) -> tuple[str, ...]:
        """The names that ``models`` may have."""
        return tuple(self._channels)

    @checked
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
        self._take_gravity()
        model, data = self._model, self._data
        if (state.q.shape, state.v.shape, state.a.shape) != self._shapes:
            raise InvalidInputError(
                f"a state of {self.robot.name!r} has q ({model.nq},), v and a ({model.nv},), got "
                f"{state.q.shape}, {state.v.shape}, {state.a.shape}"
            )
        if state.joint_wrenches is not None and state.torques is not None:
            pin.rnea(model, data, state.q, state.v, state.a)
            pin.updateGlobalPlacements(model, data)
            point, pressed = self._feel(state, state.joint_wrenches)
            return self._readings(state.time, self._all_read(state, state.torques, {}, point, pressed))
        torques, before, point, pressed = self._balance(state, stance)
        torques = torques if state.torques is None else state.torques
        return self._readings(state.time, self._all_read(state, torques, before, point, pressed))

    @property
    def soles(self) -> np.ndarray | None:
        """The corners of the soles at the last reading, (feet, 4, 3) [m]; None without feet."""
        return self._corners if self._feet else None

    def note_loads(self) -> None:
        """Take note of how bodies move: a reading in the next frame need not ask solvers for contacts then."""
        if self._loads is not None:
            self._loads.note()

    def state_at_rest(self) -> RobotState:
        """Return the state of the robot at rest where it is now, at the world's time."""
        nothing = np.zeros(self._model.nv)
        time = 0.0 if self.links is None else self.links.world.time
        return RobotState(time, self.robot.configuration(), nothing, nothing)

    def _take_gravity(self) -> bool:
        """Reckon with the gravity that the world has now; return whether it was another before."""
        changed = self._world is not None and take_gravity(self._model, self._world.gravity)
        if changed:
            self._firmly = self._contact_force()
        return changed

    def _contact_force(self) -> float:
        """Return with what force [N] a foot presses at least that has contact."""
        return CONTACT * self.robot.mass * float(np.linalg.norm(self._model.gravity.linear))

    # -- forces

    def _balance(
        self, state: RobotState, stance: Sequence[str] | None
    ) -> tuple[np.ndarray, dict[str, np.ndarray], np.ndarray | None, np.ndarray]:
        """Find by inverse dynamics what bears a robot without dynamics, and leave all forces in Pinocchio's data.

        Returns:
            Torques (n,) of the joints, what acts before wrench sensors as of ``_bear``, the zero moment point, None
            where no foot stands, and how hard each foot presses [N].
        """
        model, data = self._model, self._data
        torques = pin.rnea(model, data, state.q, state.v, state.a)
        pin.updateGlobalPlacements(model, data)
        self._acting[:] = 0.0
        base = self._axes[1]
        force, torque = base @ self._lacking[:3], base @ self._lacking[3:]
        torque += moment(self._places[1], force)
        loads = () if self._loads is None else self._loads.read()
        before = self._bear(loads, force, torque)
        point, pressed = None, np.zeros(len(self._feet))
        standing = self._standing(stance)
        if standing:
            point = self._stand(standing, force, torque, pressed)
        if standing or loads:
            torques = pin.rnea(model, data, state.q, state.v, state.a, self._external)
        return torques[6:], before, point, pressed

    def _feel(self, state: RobotState, wrenches: np.ndarray) -> tuple[np.ndarray | None, np.ndarray]:
        """Take what the joints truly bore for what inverse dynamics say, after ``rnea``.

        Args:
            state: How the robot moves.
            wrenches: (n, 6) of its joints, as in the state.

        Returns:
            The zero moment point, None where no foot is touched, and how hard each foot presses [N].
        """
        data, model = self._data, self._model
        self._borne[2:, :3] = -(wrenches[:, None, :3] @ self._axes[2:])[:, 0]
        self._borne[2:, 3:] = -(wrenches[:, None, 3:] @ self._axes[2:])[:, 0]
        pressed, force, torque = np.zeros(len(self._feet)), np.zeros(3), np.zeros(3)
        for k, joint in enumerate(self._foot_joints.tolist()):
            if self.links is None or self.links.names[self.links.joints.index(joint)] not in state.contacts:
                continue
            moved = model.inertias[joint] * data.a_gf[joint] + model.inertias[joint].vxiv(data.v[joint])
            ground = moved.vector - self._borne[joint]  # beside its leg, a foot's motion has this cause
            axes = self._axes[joint]
            own = axes @ ground[:3]
            pressed[k] = own[2]
            force += own
            torque += axes @ ground[3:] + moment(self._places[joint], own)
        return (zero_moment_point(force, torque, self.ground) if pressed.any() else None), pressed

    def _all_read(
        self, state: RobotState, torques: np.ndarray, before: Mapping[str, Any], point: np.ndarray | None,
        pressed: np.ndarray,
    ) -> dict[str, Any]:  # fmt: skip
        """Return what exact sensors tell, by channel, once all forces are known."""
        read = {
            "positions": self.robot.angles_of(state.q), "velocities": state.v[6:].copy(), "torques": torques.copy(),
            "contacts": pressed, "zero_moment_point": np.full(2, np.nan) if point is None else point,
        }  # fmt: skip
        if self._imu is not None:
            read["orientation"], read["angular_velocity"], read["specific_force"] = self._imu.read()
        for name, sensor in self._wrenches.items():
            read[name] = sensor.read(before.get(name, 0.0))
        return read

    def _bear(self, loads: Sequence[Load], force: np.ndarray, torque: np.ndarray) -> dict[str, np.ndarray]:
        """Let loads act on the joints, and take them off what is lacking at the base.

        Args:
            loads: What bodies do to the links.
            force: (3,) [N], changed here.
            torque: (3,) [N m], about the world's origin, changed here.

        Returns:
            By wrench sensor, what acts on links that its joint carries before it, (6,) in the joint's frame.
        """
        before: dict[str, np.ndarray] = {}
        for load in loads:
            assert self.links is not None
            joint = self.links.joints[load.link]
            turning = load.torque + moment(load.point, load.force)
            force -= load.force
            torque -= turning
            acting = self._act(joint, load.force, turning)
            for name, sensor in self._wrenches.items():
                if sensor.joint == joint and not self._feels[name][load.link]:
                    before[name] = before.get(name, 0.0) + acting
        return before

    def _act(self, joint: int, force: np.ndarray, torque: np.ndarray) -> np.ndarray:
        """Let a force and a torque about the world's origin act on a joint, and return both (6,) in its frame."""
        axes, acting = self._axes[joint], np.empty(6)
        acting[:3] = force @ axes
        acting[3:] = (torque - moment(self._places[joint], force)) @ axes
        self._acting[joint] += acting
        return acting

    def _standing(self, stance: Sequence[str] | None) -> list[int]:
        """The numbers of the feet that stand."""
        if not self._feet:
            return []
        axes, places = self._axes[self._foot_joints], self._places[self._foot_joints]
        self._corners = self._soles @ axes.swapaxes(1, 2) + places[:, None]
        if stance is None:
            heights = lowest_corners(self._corners).tolist()
            return [k for k, height in enumerate(heights) if height < self.ground + LIFTED]
        for foot in stance:
            if foot not in self._feet:
                raise UnknownNameError("foot", str(foot), list(self._feet))
        return [k for k, foot in enumerate(self._feet) if foot in stance]

    def _stand(self, standing: list[int], force: np.ndarray, torque: np.ndarray, pressed: np.ndarray) -> np.ndarray:
        """Let the ground act on the feet; tell how hard each presses [N], and return the zero moment point."""
        corners, stood = self._corners[standing], self._stood
        if stood is None or len(stood.corners) != len(corners) or (stood.corners != corners).any():
            stood = self._stood = Soles(corners)
        forces, torques = stood.share(force, torque)
        pressed[standing] = forces[:, 2]
        joints = self._foot_joints[standing]
        axes, shares = self._axes[joints], np.empty((len(joints), 6, 1))
        shares[:, :3, 0] = (forces[:, None] @ axes)[:, 0]
        shares[:, 3:, 0] = (torques[:, None] @ axes)[:, 0]
        self._acting[joints] += (self._from_middles[standing] @ shares)[:, :, 0]
        return zero_moment_point(force, torque, self.ground)

    def _felt_links(self, sensor: WrenchSensor) -> list[bool]:
        """Return which of the bodies in the world are links beyond a sensor, of those that its joint carries."""
        if self.links is None:
            return []
        return [sensor.feels(link) for link in self.links.names]

    def _groups(self) -> list[str | int]:
        """For each of the bodies in the world, the wrench sensor beyond which its link is, or else its joint."""
        assert self.links is not None
        groups: list[str | int] = []
        for k, joint in enumerate(self.links.joints):
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

    def _readings(self, time: float, read: dict[str, Any]) -> Readings:
        sampled = dict.fromkeys(self._channels, time)
        for name, channel in self._inexact.items():
            if name == "orientation":
                # the true turn goes along: what is told late is how it was turned then
                sampled[name], turned = channel.read(time, _Turned(read[name]))
                read[name] = turned.quaternion()
            else:
                sampled[name], read[name] = channel.read(time, read[name])
        if self._imu is None:
            read |= {"orientation": np.full(4, np.nan)}
            read |= {name: np.full(3, np.nan) for name in ("angular_velocity", "specific_force")}
        return Readings(
            time, read["positions"], read["velocities"], read["torques"], read["orientation"],
            read["angular_velocity"], read["specific_force"], {name: read[name] for name in self._wrenches},
            dict(zip(self._feet, (read["contacts"] > self._firmly).tolist(), strict=True)),
            read["zero_moment_point"], sampled,
        )  # fmt: skip


class _Turned:
    """A turn, and errors about its own axes (3,) [rad] that are added to it."""

    def __init__(self, turn: np.ndarray, error: np.ndarray | None = None) -> None:
        self.turn, self.error = turn, error

    def __add__(self, error: np.ndarray) -> _Turned:
        return _Turned(self.turn, error if self.error is None else self.error + error)

    def quaternion(self) -> np.ndarray:
        """Return the quaternion (4,), (w, x, y, z)."""
        if self.error is None:
            return self.turn
        angle = float(np.linalg.norm(np.broadcast_to(self.error, (3,))))
        if angle == 0.0:
            return self.turn
        return quat.multiply(self.turn, quat.from_axis_angle(self.error / angle, np.array(angle)))


def sole_corners(sole: Any) -> np.ndarray:
    """Return the corners (4, 3) [m] of a sole in its own frame."""
    half = np.zeros(2) if sole.size is None else 0.5 * sole.size
    return np.array([(sx * half[0], sy * half[1], 0.0) for sx in (-1.0, 1.0) for sy in (-1.0, 1.0)])
