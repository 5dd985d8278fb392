"""Robot models: joints, frames and the configuration of a robot, on Pinocchio."""

from __future__ import annotations

import copy
import math
from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from nuno.camera.camera import Camera
from nuno.errors import InvalidInputError, RobotModelError, UnknownNameError
from nuno.robot.assumed_limits import assume_limits
from nuno.robot.description import FileName, find_description
from nuno.robot.pinocchio import pin
from nuno.robot.placement import frame_called, pose_of
from nuno.robot.support import convex_outline
from nuno.shapes import quaternion as quat
from nuno.shapes.coordinates import Coordinates, compose, invert
from nuno.validation import checked, finite_array, number

IDENTITY = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
"""A base at the origin, as a configuration has it."""
LIMIT_SLACK = 1e-6
"""[rad] What an angle may be beyond its limit and is moved back by: the rounding of those who compute it."""


class RobotModel(Coordinates):
    """A robot as Pinocchio has it: see `nuno.Humanoid`, whose arguments and errors these are."""

    @checked
    def __init__(
        self, name: FileName = "talos", *, srdf: FileName | None = None,
        package_dirs: Sequence[FileName] | None = None, robots: FileName | None = None,
    ) -> None:  # fmt: skip
        super().__init__()
        self.description = find_description(name, srdf, package_dirs, robots)
        try:
            self.model = pin.buildModelFromUrdf(str(self.description.urdf), pin.JointModelFreeFlyer())
        except (ValueError, RuntimeError) as error:
            raise RobotModelError(f"cannot read {str(self.description.urdf)!r} as a URDF: {error}") from error
        joints = range(2, self.model.njoints)
        odd = [self.model.names[j] for j in joints if self.model.joints[j].nv != 1]
        if odd:
            raise RobotModelError(f"joints must be hinges or slides; {odd[0]!r} is neither")
        self.joint_names: tuple[str, ...] = tuple(self.model.names[j] for j in joints)
        self._index = {joint: k for k, joint in enumerate(self.joint_names)}
        self._rows = np.array([self.model.joints[j].idx_q for j in joints], dtype=int)
        self._is_continuous = np.array([self.model.joints[j].nq == 2 for j in joints], dtype=bool)
        self._free = np.flatnonzero(self._is_continuous)
        assume_limits(self.model, self.name, self.is_slide, self.description.velocity_limits)
        self._add_frames()
        self.data, self.scratch = self.model.createData(), self.model.createData()  # of now, and for what might be
        self._angles = np.zeros(len(self.joint_names))
        self._configured: np.ndarray | None = None  # its configuration, while nothing moves it
        self._is_current = False

    @property
    def name(self) -> str:
        """Return what it is called."""
        return self.description.name

    # Joints

    def angle_vector(self, angles: ArrayLike | Mapping[str, float] | None = None) -> np.ndarray:
        """Set the joints where ``angles`` are given, and return them.

        Args:
            angles: (n,) [rad; m for slides] in the order of ``joint_names``, or by name, others staying as they are.

        Returns:
            (n,) float, a copy.

        Raises:
            UnknownNameError: no joint of that name.
            InvalidInputError: another number of angles, not finite, or beyond a limit.
        """
        if angles is not None:
            self._angles = self.checked_angles(angles)
            self._forget_places()
        return self._angles.copy()

    def checked_angles(self, angles: ArrayLike | Mapping[str, float]) -> np.ndarray:
        """Return angles as ``angle_vector`` takes them, (n,) float, complete and within limits; raises as it does."""
        if isinstance(angles, Mapping):
            wanted = self._angles.copy()
            for joint, angle in angles.items():
                wanted[self.joint_index(joint)] = number(f"the angle of {joint!r}", angle)
        else:
            wanted = finite_array("angles", angles, (len(self.joint_names),))
        lower, upper = self.joint_limits
        if (beyond := np.flatnonzero((wanted < lower - LIMIT_SLACK) | (wanted > upper + LIMIT_SLACK))).size:
            k = beyond[0]
            raise InvalidInputError(
                f"{beyond.size} joints are beyond their limits, the first is {self.joint_names[k]!r}: "
                f"{wanted[k]:.4f} is not in [{lower[k]:.4f}, {upper[k]:.4f}]"
            )
        return np.clip(wanted, lower, upper)

    def joint_index(self, joint: str) -> int:
        """Return a joint's place in ``joint_names``.

        Raises:
            UnknownNameError: there is no such joint.
        """
        if not isinstance(joint, str) or joint not in self._index:
            raise UnknownNameError("joint", joint, list(self.joint_names))
        return self._index[joint]

    @cached_property
    def joint_limits(self) -> tuple[np.ndarray, np.ndarray]:
        """Lower and upper limits, (n,) float [rad; m for slides] each; infinite for joints that turn freely."""
        lower = np.where(self._is_continuous, -np.inf, self.model.lowerPositionLimit[self._rows])
        upper = np.where(self._is_continuous, np.inf, self.model.upperPositionLimit[self._rows])
        return lower, upper

    @cached_property
    def is_slide(self) -> np.ndarray:
        """(n,) bool, whether a joint slides; others turn."""
        return np.array(["Prismatic" in own.shortname() or own.shortname()[:-1] == "JointModelP"
                         for own in self.model.joints[2:]], dtype=bool)  # fmt: skip

    @property
    def velocity_limits(self) -> np.ndarray:
        """(n,) float [rad/s; m/s for slides]."""
        return np.array(self.model.velocityLimit[6:])

    @property
    def effort_limits(self) -> np.ndarray:
        """(n,) float [N m; N for slides]."""
        return np.array(self.model.effortLimit[6:])

    def copy(self) -> Self:
        """Return another such robot, at the same place and in the same posture; nothing follows it."""
        made = copy.copy(self)  # what never changes is shared: the description, the model, the meshes
        made._position, made._quaternion = self.pose()
        made._parent, made._children = None, []
        made.data, made.scratch = self.model.createData(), self.model.createData()
        made._angles = self._angles.copy()
        made._forget_places()
        return made

    # Where everything is

    @checked
    def stand(self, position: ArrayLike = (0.0, 0.0, 0.0), yaw: float = 0.0) -> None:
        """Take the description's posture, the point between the soles at ``position`` (3,) [m], facing ``yaw`` [rad].

        A robot without legs has its base there.
        """
        goal = finite_array("position", position, (3,))
        turn = quat.from_axis_angle(np.array([0.0, 0.0, 1.0]), np.array(number("yaw", yaw)))
        self._angles = self._posture()
        self._place(np.zeros(3), quat.IDENTITY)
        between = (np.zeros(3), quat.IDENTITY)
        if self.description.feet:
            soles = [self._pose_of_frame(foot) for foot in self.description.feet]
            between = (np.mean([place for place, _ in soles], axis=0), soles[0][1])
        self._place(*compose((goal, turn), invert(between)))

    @checked
    def camera(self, name: str = "head") -> Camera:
        """Return a camera of the description, where it is now.

        Raises:
            UnknownNameError: there is no such camera.
        """
        cameras = self.description.cameras
        if name not in cameras:
            raise UnknownNameError("camera", name, list(cameras))
        own = cameras[name]
        pose = self.frame_pose(own.frame).translate((own.aside, 0.0, own.ahead))
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = pose.rotation, pose.position
        focal = 0.5 * own.width / math.tan(0.5 * own.field_of_view)
        middle = (0.5 * (own.width - 1), 0.5 * (own.height - 1))
        return Camera(own.width, own.height, focal, focal, *middle, camera_to_world=matrix)

    @property
    def frame_names(self) -> tuple[str, ...]:
        """All frames: the roles of the description, links and joints."""
        return (*self.description.frames, *(f.name for f in self.model.frames if f.name not in self.description.frames))

    @checked
    def frame_pose(self, frame: str) -> Coordinates:
        """Return where a frame is: a role ("left_hand", "head_camera", "imu" ...), a link or a joint.

        Raises:
            UnknownNameError: there is no such frame.
        """
        return Coordinates(*self._pose_of_frame(frame))

    @cached_property
    def mass(self) -> float:
        """[kg], all links."""
        return float(pin.computeTotalMass(self.model))

    @property
    def centre_of_mass(self) -> np.ndarray:
        """(3,) float [m]."""
        return np.array(pin.centerOfMass(self.model, self.data, self.configuration()))

    @property
    def feet(self) -> tuple[str, ...]:
        """The frames of the soles.

        Raises:
            RobotModelError: the robot has no legs, or none that its description names.
        """
        if not self.description.feet:
            raise RobotModelError(
                f"{self.name!r} has no legs to stand on: its description names no feet; describe_robot guesses"
            )
        return self.description.feet

    def support_polygon(self) -> np.ndarray:
        """Return the outline (k, 2) [m] of all soles, counterclockwise, in the world's xy plane.

        Raises:
            RobotModelError: the robot has no legs.
        """
        corners = []
        for foot in self.feet:
            size = self.description.frames[foot].size
            half = np.zeros(2) if size is None else 0.5 * size
            flat = [(sx * half[0], sy * half[1], 0.0) for sx in (-1.0, 1.0) for sy in (-1.0, 1.0)]
            corners.append(self.frame_pose(foot).to_world(flat)[:, :2])
        return convex_outline(np.concatenate(corners))

    def configuration(self) -> np.ndarray:
        """Return Pinocchio's configuration (nq,): base position, quaternion (x, y, z, w), joints.

        Raises:
            InvalidInputError: the robot follows a frame that has a pose for each world of a batch.
        """
        if self._configured is not None:
            return self._configured.copy()
        position, quaternion = self.pose()
        if position.ndim != 1 or quaternion.ndim != 1:
            raise InvalidInputError("a robot has one pose, not one for each world")
        q = self.configuration_of(self._angles, IDENTITY)
        q[:3], q[3:6], q[6] = position, quaternion[1:], quaternion[0]
        self._configured = q
        return q.copy()

    def configuration_of(self, angles: np.ndarray, base: np.ndarray) -> np.ndarray:
        """Return the configuration (nq,) with angles (n,) and a base (7,): position, quaternion (x, y, z, w).

        Of many at once where both have an axis before: (k, n) and (k, 7).
        """
        q = np.empty((*angles.shape[:-1], self.model.nq))
        q[..., :7] = base
        q[..., self._rows] = angles
        if len(self._free):
            first = self._rows[self._free]
            q[..., first], q[..., first + 1] = np.cos(angles[..., self._free]), np.sin(angles[..., self._free])
        return q

    def take_configuration(self, q: np.ndarray) -> None:
        """Take Pinocchio's configuration (nq,): the inverse of ``configuration``.

        Raises:
            InvalidInputError: another length, not finite, or a joint beyond its limit.
        """
        q = finite_array("q", q, (self.model.nq,))
        self._angles = self.checked_angles(self.angles_of(q))
        self._place(q[:3].copy(), quat.unit("q[3:7]", q[[6, 3, 4, 5]], (4,)))

    def angles_of(self, q: np.ndarray) -> np.ndarray:
        """Return the joints' angles (n,) in a configuration (nq,); of many at once (k, n), in (k, nq)."""
        angles = q.take(self._rows, axis=-1)
        if len(self._free):
            angles[..., self._free] = np.arctan2(q[..., self._rows[self._free] + 1], angles[..., self._free])
        return angles

    def move_to(self, angles: np.ndarray, base: np.ndarray | None = None) -> None:
        """Take angles (n,) within limits, and a pose (7,) of the base as in a configuration, without any checks."""
        self._angles = angles
        self._forget_places()
        if base is not None:
            self._place(base[:3].copy(), base[[6, 3, 4, 5]])

    def update(self) -> Any:
        """Return Pinocchio's data, with joints and frames where they are now."""
        if not self._is_current:
            pin.framesForwardKinematics(self.model, self.data, self.configuration())
            self._is_current = True
        return self.data

    # Inside

    def _moved(self) -> None:
        self._forget_places()
        super()._moved()

    def _forget_places(self) -> None:
        self._is_current, self._configured = False, None

    def _pose_of_frame(self, frame: str) -> tuple[np.ndarray, np.ndarray]:
        return pose_of(self.update().oMf[self.frame_index(frame)])

    def frame_index(self, frame: str) -> int:
        """Return Pinocchio's index of a frame.

        Raises:
            UnknownNameError: there is no such frame.
        """
        if not isinstance(frame, str) or not self.model.existFrame(frame):
            raise UnknownNameError("frame", frame, list(self.frame_names))
        return frame_called(self.model, frame)

    def posture_configuration(self) -> np.ndarray:
        """Return the configuration (nq,) of the posture, the base where it is now."""
        return self.configuration_of(self._posture(), self.configuration()[:7])

    def _posture(self) -> np.ndarray:
        posture = self.description.posture
        angles = np.zeros(len(self.joint_names))
        if isinstance(posture, str):
            states = self._srdf_states
            if posture not in states:
                raise UnknownNameError("posture", posture, list(states))
            angles = np.array(states[posture])[self._rows]
        else:
            for joint, angle in posture.items():
                angles[self.joint_index(joint)] = number(f"the angle of {joint!r}", angle)
        lower, upper = self.joint_limits
        return np.clip(angles, lower, upper)

    @cached_property
    def _srdf_states(self) -> dict[str, np.ndarray]:
        if self.description.srdf is None:
            return {}
        pin.loadReferenceConfigurations(self.model, str(self.description.srdf), False)
        return {item.key(): np.array(item.data()) for item in self.model.referenceConfigurations}

    def _add_frames(self) -> None:
        for role, own in self.description.frames.items():
            if not self.model.existFrame(own.link):
                raise UnknownNameError("link", own.link, [frame.name for frame in self.model.frames])
            parent = frame_called(self.model, own.link)
            carrier = self.model.frames[parent]
            w, x, y, z = own.quaternion
            offset = pin.SE3(pin.Quaternion(w, x, y, z).toRotationMatrix(), own.position)
            placement = carrier.placement * offset
            if role != own.link:
                frame = pin.Frame(role, carrier.parentJoint, parent, placement, pin.FrameType.OP_FRAME)
                self.model.addFrame(frame)


def standing_place(robot: RobotModel) -> tuple[float, float, float]:
    """Return where a robot stands: x and y [m] of the middle between its soles, and where they point [rad].

    Of a robot without legs, those of its base.
    """
    poses = [robot.frame_pose(foot) for foot in robot.description.feet] or [robot]
    ahead = np.sum([pose.rotation[:2, 0] for pose in poses], axis=0)
    x, y, _ = np.mean([pose.position for pose in poses], axis=0)
    return float(x), float(y), math.atan2(ahead[1], ahead[0])
