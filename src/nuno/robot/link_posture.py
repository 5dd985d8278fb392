"""The posture of a robot whose links stand somewhere: the inverse of where links are by the joints' angles."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.robot.pinocchio import pin

if TYPE_CHECKING:
    from nuno.robot.links import Links
    from nuno.shapes.coordinates import Pose

CLOSE = 1e-9
"""[m, rad] From where bodies are, which files hold in doubles."""
STEPS = 20
"""Of Newton's method at most."""


def posture_of(links: Links) -> np.ndarray:
    """Return the configuration (nq,) of the robot whose links are where the bodies of ``links`` are now.

    Angles of more than a turn are the nearest to the robot's own, and joints that no body tells of keep theirs.
    """
    robot = links.robot
    model, kept = robot.model, robot.angle_vector()
    placed = _joints_placed(links)
    measured = list(placed)
    base = placed.setdefault(1, robot.data.oMi[1].copy())
    angles = kept.copy()
    for joint in range(2, model.njoints):
        axis = _axis(model.joints[joint])
        above = placed[int(model.parents[joint])] * model.jointPlacements[joint]
        turn, row = axis[3:], joint - 2
        if joint not in placed:
            own = pin.SE3(pin.exp3(kept[row] * turn), kept[row] * axis[:3])
            placed[joint] = above * own
            continue
        moved = above.actInv(placed[joint])
        angle = float(axis[:3] @ moved.translation + turn @ pin.log3(moved.rotation))
        if turn.any():
            angle += 2.0 * np.pi * np.round((kept[row] - angle) / (2.0 * np.pi))
        angles[row] = angle
    q = robot.configuration_of(angles, pin.SE3ToXYZQUAT(base))
    return _refined(model, q, {joint: placed[joint] for joint in measured})


def _refined(model: Any, q: np.ndarray, wanted: dict[int, Any]) -> np.ndarray:
    """Return the configuration near ``q`` in which joints are where they are wanted, by Gauss and Newton.

    Joints without bodies need it, whose angles show in those of the next bodies only.
    """
    data = model.createData()
    for _ in range(STEPS):
        pin.computeJointJacobians(model, data, q)
        errors = np.concatenate([pin.log6(data.oMi[joint].actInv(place)).vector for joint, place in wanted.items()])
        if np.abs(errors).max() < CLOSE:
            break
        rows = [pin.getJointJacobian(model, data, joint, pin.ReferenceFrame.LOCAL) for joint in wanted]
        q = pin.integrate(model, q, np.linalg.lstsq(np.concatenate(rows), errors)[0])
    return q


def _joints_placed(links: Links) -> dict[int, Any]:
    """Return where joints are by the first body that each carries, fingers that slide left out."""
    placed: dict[int, Any] = {}
    sliding = {k for bodies in links.finger_bodies.bodies for k in bodies}
    for k, (joint, body) in enumerate(zip(links.joints, links.bodies, strict=True)):
        if joint not in placed and k not in sliding:
            placed[joint] = _transform(body.pose()) * _transform(links.offset_of(k)).inverse()
    return placed


def _transform(pose: Pose) -> Any:
    position, quaternion = pose
    return pin.XYZQUATToSE3(np.concatenate([position, np.roll(quaternion, -1)]))


def _axis(joint: Any) -> np.ndarray:
    """Return the motion (6,) of a joint of one degree of freedom at unit velocity, in its own frame."""
    data = joint.createData()
    joint.calc(data, np.zeros(joint.nq) if joint.nq == 1 else np.array([1.0, 0.0]))
    return np.asarray(data.S).ravel()
