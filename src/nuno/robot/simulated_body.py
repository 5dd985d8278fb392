"""SimulatedBody: dynamics of a simulated robot's links, given and taken away at any time."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from nuno.errors import BodyStateError, InvalidInputError
from nuno.robot.link_dynamics import grips_of
from nuno.robot.link_posture import posture_of
from nuno.robot.simulated_senses import SimulatedSenses
from nuno.robot.trajectory_controller import ARRIVED
from nuno.validation import checked

if TYPE_CHECKING:
    from nuno.joints.grip import Grip
    from nuno.robot.balance import Balance
    from nuno.robot.burden import Burden
    from nuno.robot.felt_loads import FeltLoads
    from nuno.robot.gait import Gait
    from nuno.robot.hands import Hand
    from nuno.robot.humanoid import Humanoid
    from nuno.robot.links import Links
    from nuno.robot.motion_guard import MotionGuard
    from nuno.robot.robot_state import RobotState
    from nuno.robot.servo import Servo
    from nuno.robot.simulated_gripper import SimulatedGripper
    from nuno.robot.simulated_joints import SimulatedJoints
    from nuno.robot.wanted_motion import WantedMotion

logger = logging.getLogger(__name__)

TORN = 0.05
"""[m] From how far apart on a joint counts as torn; loads leave micrometres, and a millimetre for a moment."""
WHOLE = 0.01
"""[m] Below it, all joints count as whole again."""


class SimulatedBody(SimulatedSenses):
    """Dynamics of ``SimulatedRobot``.

    Attributes:
        links: Its links in the world.
        joints: Its joints and controllers.
        gait: Its walks.
        hands: Its hands, by name.
        grippers: What closes them, likewise.
        balance: Its dynamics; None where its links are one body for each shape.
        guard: Without dynamics, it keeps the links out of static shapes.
    """

    links: Links
    joints: SimulatedJoints
    gait: Gait
    hands: dict[str, Hand]
    grippers: dict[str, SimulatedGripper]
    balance: Balance | None
    wanted: Humanoid
    _motion: WantedMotion
    guard: MotionGuard
    _burden: Burden
    _felt: FeltLoads
    _entered: bool
    _servo: Servo | None
    _is_torn = False  # and that was told

    @property
    def is_dynamic(self) -> bool:
        """Return True if the links have dynamics."""
        return self.balance is not None and self.balance.dynamics.is_attached

    @property
    def collisions(self) -> str:
        """The setting for motions through static shapes, without dynamics: "stop", "warn" or "ignore"."""
        return self.guard.mode

    @collisions.setter
    def collisions(self, mode: str) -> None:
        self.guard.check_mode(mode)
        with self.world.lock:
            self.guard.mode = mode
            self._look_anew()

    def leave(self) -> None:
        """End the simulation of the robot; links that it brought along leave the world.

        Raises:
            BodyStateError: it has left already.
        """
        with self.world.lock:
            self._check_there()
            self.cancel_angle_vector()
            self.cancel_base()
            self.world.drivers.remove(self)  # type: ignore[arg-type]  # a SimulatedRobot is one
            if self.is_dynamic:
                self.detach()
            if self._entered:
                self.links.leave()

    def restored(self) -> None:
        """Be at rest where the links are: the world was restored from what does not say how the robot moves."""
        with self.world.lock:
            if self.links.missing:
                return  # of before it entered, say; that is told when it is to move
            moving = [body for body in self.links.bodies if body.is_dynamic]
            dynamics = None if self.balance is None else self.balance.dynamics
            joints = () if dynamics is None else dynamics.joints
            kept = bool(joints and moving) and all(joint.active for joint in joints)
            held: dict[str, Sequence[Grip]] = {}
            if not kept:  # links that stood, or moved by the joints of another process
                for name, hand in self.hands.items():
                    hand.take_over()
                    held[name] = hand.grips if moving else ()
                for body in moving:
                    self.world.detach(body)
                if dynamics is not None:
                    dynamics.forget()
                self._set_tolerance()
            self._start_from(posture_of(self.links))
            for name, hand in self.hands.items():
                hand.take_over()
                hand.hold_on(held.get(name, ()))
                if held and moving and hand.has_fingers:  # what it pressed on, as far as places tell
                    hand.close(hand.filled_by())
            if joints and moving and not kept:
                self.attach()

    def _check_there(self) -> None:
        """Refuse what would wait for ever: after ``leave`` no frame of the world moves the robot."""
        if self not in self.world.drivers:
            raise BodyStateError(f"{self.actual.name!r} has left the world; SimulatedRobot(robot, world) enters anew")

    def attach(self) -> None:
        """Give the links dynamics from where they are, at rest: masses, motors, contact and balance.

        Raises:
            BodyStateError: they have them.
            InvalidInputError: links that were made otherwise than by ``dynamics=True`` or ``enter(world, "joints")``.
        """
        if self.balance is None:
            raise InvalidInputError(
                f"the links of {self.actual.name!r} are one body for each shape; dynamics need one for each joint: "
                'SimulatedRobot(..., dynamics=True), or links of robot.enter(world, "joints")'
            )
        with self.world.lock:
            self.balance.dynamics.attach()
            for gripper in self.grippers.values():
                gripper.close_again()
            self._set_tolerance()

    def detach(self) -> None:
        """Take the dynamics away: the robot stands still in its posture, and goes exactly where it is sent from now on.

        The links are where the joints say, also fingers, of which one had slid further than another: they jump by half
        of what they differ.

        Raises:
            BodyStateError: it has none.
        """
        with self.world.lock:
            if self.balance is None or not self.is_dynamic:
                raise BodyStateError(f"{self.actual.name!r} has no dynamics")
            pressed = {name: hand.held for name, hand in self.hands.items() if hand.presses}
            held = {name: hand.grips for name, hand in self.hands.items()}
            self._tell_ending(held)
            self.balance.dynamics.detach()
            if not self.links.missing:
                self.links.follow(0.0)  # fingers slid apart, each as far as its own forces had it
            for name, bodies in pressed.items():  # what fingers pressed on is gripped from now on
                self.hands[name].close([body for body in bodies if body.is_dynamic])
            for name, grips in held.items():
                self.hands[name].hold_on(grips)
            self._set_tolerance()
            self._start_from(self.actual.configuration())

    @checked
    def set_up(self, position: ArrayLike = (0.0, 0.0, 0.0), yaw: float = 0.0) -> None:
        """Stand the robot up in its posture, at rest, wherever it is now, as somebody would who lifts it.

        Args:
            position: (3,) [m], of the point between its soles.
            yaw: Where it looks [rad].
        """
        with self.world.lock:
            was_dynamic = self.is_dynamic
            if was_dynamic:
                self.detach()
            self.actual.angle_vector(self.actual.angles_of(self.actual.posture_configuration()))
            self.actual.stand(position, yaw)
            self.links.follow(0.0)
            self._start_from(self.actual.configuration())
            if was_dynamic:
                self.attach()

    def _drive(self, aim: RobotState, span: float) -> None:
        """Set the motors for a frame of ``span`` [s] at whose end the robot is wanted at ``aim``.

        Raises:
            BodyStateError: somebody took dynamics from a link alone, or the link from the world.
        """
        assert self.balance is not None
        try:
            self.balance.dynamics.drive(*self.balance.command([self._state], [aim], span, self._servo))
            self.balance.dynamics.lead_fingers(self.actual.angles_of(aim.q))
        except BodyStateError as error:
            first = f"add {self.links.missing[0]!r} to the world again, then " if self.links.missing else ""
            raise BodyStateError(
                f"{error}, as its link was detached or removed by itself, and {self.actual.name!r} cannot move without "
                f"it: {first}robot.set_up(), or robot.detach() and robot.attach(), join its links anew; restoring a "
                "snapshot does so, too"
            ) from error

    def _tell_torn(self) -> None:
        """Warn, once until they are whole again, where forces have torn joints of a robot with dynamics apart."""
        assert self.balance is not None
        dynamics = self.balance.dynamics
        gaps = dynamics.gaps()[0]
        farthest = float(gaps.max(initial=0.0))
        if farthest < (WHOLE if self._is_torn else TORN):
            self._is_torn = False
            return
        if self._is_torn:
            return
        self._is_torn = True
        worst, torn = int(gaps.argmax()), int((gaps > TORN).sum())
        joint = (*dynamics.joints, *dynamics.fingers.joints)[worst]
        names = self.actual.joint_names
        name = repr(names[worst]) if worst < len(names) else f"the slide of {joint.body.name!r}"
        others = f" and {torn - 1} more are more than {100.0 * TORN:g} cm" if torn > 1 else " is"
        pressed = sorted({other for own in self._state.contacts.values() for other in own})
        logger.warning(
            "%r is torn at t = %.3f s: %s%s apart, by %.3g m at most: greater forces pulled at its links than joints "
            "bear, mostly as something stands inside a link (it touches %s). What it does from here on is not to be "
            "believed. Move what overlaps its links away, or let their contact be ignored (world.ignore_contact), and "
            "call robot.set_up(), or restore a snapshot",
            self.actual.name, self.world.time, name, others, farthest, ", ".join(pressed) or "nothing",
        )  # fmt: skip

    def _tell_ending(self, held: Mapping[str, Sequence[Grip]]) -> None:
        """Warn of grips by the links that end with their dynamics, as no hand made them."""
        kept, links = {grip for grips in held.values() for grip in grips}, set(self.links.bodies)
        ending = sorted(
            f"{grip.body.name!r} by {grip.target.name!r}" for grip in grips_of(self.world.bodies)
            if grip.target in links and grip.body not in links and grip not in kept
        )  # fmt: skip
        if ending:
            logger.warning(
                "what a program gripped to links of %r, or joined to them, is let go as they lose their dynamics: %s; "
                "grip it anew. What its hands hold stays held", self.actual.name, ", ".join(ending),
            )  # fmt: skip

    def _set_tolerance(self) -> None:
        """Let goals without tolerances end with their time where motors move the joints, as on robots with motors."""
        for controller in self.joints.controllers.values():
            controller.near = np.inf if self.is_dynamic else ARRIVED

    def _start_from(self, q: np.ndarray) -> None:
        self._motion.start_from(q, self.world.time)
        self._look_anew()
        self._state = self._motion.aim
        if self.actual is not self.wanted:
            self.actual.move_to(self.wanted.angle_vector(), q[:7])

    def _look_anew(self) -> None:
        self._felt.forget()
        self.guard.forget()
        self._burden.forget()
